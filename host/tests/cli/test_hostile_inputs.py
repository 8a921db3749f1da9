"""Hostile scenes, configurations and options, and inputs that are not regular files."""

from __future__ import annotations

import socket
from collections.abc import Callable, Mapping
from pathlib import Path

import hostile
import pytest
from click.testing import CliRunner
from hostile import COMPARE, HITS, PACK, PPA, RENDER, ROOM, Case, Content, fifo, link_to, scene

from colonnade.cli.main import cli

X = "render x.toml --config tiny --backend model --size 8x8"
NINES = "9" * 400
DEEP = 20_000
TWENTY = list(range(20))
STUDY = "explore x.toml --output o"


def study(axes: str) -> dict[str, Content]:
    """A study file x.toml with these axes."""
    text = 'title = "x"\n[design]\nconfig = "tiny"\n[workload]\nscenes = ["s.toml"]\nsize = [8, 8]\n[cycles]\n[axes]\n'
    return {"x.toml": text + axes}


def unix_socket(path: Path) -> None:
    with hostile.inside(path.parent):
        socket.socket(socket.AF_UNIX).bind(path.name)


#: Files that are not regular, with their description in errors.
KINDS: Mapping[str, tuple[str, dict[str, Content]]] = {
    "fifo": ("a pipe", {"X": fifo}),
    "socket": ("a socket", {"X": unix_socket}),
    "device": ("a device", {"X": link_to("/dev/zero")}),
    "folder": ("a folder", {"X": lambda path: path.mkdir()}),
    "linked-fifo": ("a pipe", {"X": link_to("pipe"), "pipe": fifo}),
    "dangling": ("", {"X": link_to("nowhere")}),
    "circle": ("Too many levels", {"X": link_to("X")}),
}
#: Command lines with an input X, for each kind of input.
INPUTS = {
    "scene": ("render x.toml --config tiny", "x.toml"),
    "packed-scene": ("pack x.toml --config tiny --output q", "x.toml"),
    "configuration": ("generate --config x.json --print", "x.json"),
    "mesh": (f"{RENDER} --mesh x.obj", "x.obj"),
    "picture": (COMPARE, "x.png"),
    "hits": (HITS, "x.npz"),
    "hits-option": ("compare a.png b.png --no-dists --hits-a h.npz --hits-b x.npz", "x.npz"),
    "image": ("inspect x.image", "x.image"),
    "liberty": (PPA, "x.lib"),
    "study": (STUDY, "x.toml"),
}
CASES: dict[str, Case] = {}
for place, (arguments, file) in INPUTS.items():
    for kind, (says, files) in KINDS.items():
        if kind == "folder" and place in ("image", "liberty"):
            continue
        named = {name.replace("X", file): link_to(file) if kind == "circle" else made for name, made in files.items()}
        CASES[f"{place}-{kind}"] = Case(arguments, says, named)


def replaced(name: str, kind: str) -> Callable[[Path], None]:
    """Replaces a file of the room."""

    def write(path: Path) -> None:
        path.unlink()
        made = KINDS[kind][1]["X"]
        assert callable(made)
        made(path)

    return write


CASES |= {
    f"room-{name}-{kind}": Case(ROOM, KINDS[kind][0], {f"room/{name}": replaced(name, kind)})
    for name in ("meta.json", "albedo.png", "normal.png", "depth.npy")
    for kind in ("fifo", "folder", "device")
}
CASES |= {
    "device-scene": Case("render /dev/zero --config tiny", "a device"),
    "device-image": Case("inspect /dev/zero", "a device"),
    "device-picture": Case("compare /dev/zero a.png --no-dists", "a device"),
    "terminal-scene": Case("render /dev/tty --config tiny", "/dev/tty"),
    "folder-scene": Case("render room --config tiny", "a folder"),
    # Scenes
    "digits": Case(X, "more than 40 digits", scene(f"[paths]\nbounces = {NINES}\n")),
    "digits-of-a-float": Case(X, "transform.scale", scene(f"[transform]\nscale = {NINES}.0\n")),
    "digits-beyond-python": Case(X, "not TOML", scene(f"[paths]\nbounces = {'9' * 5000}\n")),
    "digits-in-a-vector": Case(X, "more than 40 digits", scene(f"[camera]\nup = [0, {NINES}, 0]\n")),
    "arrays-deep": Case(X, "nested too deeply", scene(f"[camera]\nup = {'[' * DEEP}{']' * DEEP}\n")),
    "arrays-100-deep": Case(X, "nested too deeply", scene(f"[camera]\nup = {'[' * 100}{']' * 100}\n")),
    "tables-deep": Case(X, "nested too deeply", {"x.toml": f"{'.'.join('a' * 90)} = 1\n"}),
    "mesh-name-of-5-MB": Case(X, "too large", {"x.toml": f'[mesh]\nname = "{"n" * 5_000_000}"\n'}),
    "mesh-name-of-5-kB": Case(X, "characters", {"x.toml": f'[mesh]\nname = "{"n" * 5_000}"\n'}),
    "mesh-name-of-300": Case(X, "no mesh ", {"x.toml": f'[mesh]\nname = "{"n" * 300}"\n'}),
    "mesh-path-of-300": Case(X, "File name too long", {"x.toml": f'[mesh]\npath = "{"n" * 300}.obj"\n'}),
    "mesh-path-with-zero": Case(X, "not a file name", {"x.toml": '[mesh]\npath = "a\\u0000b.obj"\n'}),
    "mesh-name-with-zero": Case(X, "no mesh ", {"x.toml": '[mesh]\nname = "a\\u0000b"\n'}),
    "mesh-name-with-escapes": Case(X, "x1b[31mred", {"x.toml": '[mesh]\nname = "\\u001b[31mred\\u001b[0m"\n'}),
    "mesh-name-with-line": Case(X, "no mesh ", {"x.toml": '[mesh]\nname = "a\\ncolonnade: error: b"\n'}),
    "mesh-name-right-to-left": Case(X, "u202e", {"x.toml": '[mesh]\nname = "\\u202egpj.exe"\n'}),
    "key-with-escapes": Case(X, "x1b[2J", scene('"\\u001b[2J" = 1\n')),
    "kind-with-escapes": Case(X, "material.kind", scene('[material]\nkind = "\\u001b[2J"\n')),
    "room-with-zero": Case(X, "no memory for a room", scene('[background]\nroom = "a\\u0000"\n')),
    "room-of-300": Case(X, "no memory for a room", scene(f'[background]\nroom = "{"r" * 300}"\n')),
    "not-utf-8": Case(X, "not TOML", {"x.toml": b"\xff\xfe\x00"}),
    "nul-bytes": Case(X, "not TOML", {"x.toml": b"\0" * 100}),
    "empty": Case(X, "[mesh]", {"x.toml": ""}),
    "mesh-is-a-number": Case(X, "must be text", {"x.toml": "[mesh]\nname = 7\n"}),
    "mesh-is-a-list": Case(X, "must be a table", {"x.toml": "mesh = []\n"}),
    "light-is-empty": Case(X, "must be a table", {"x.toml": f"light = []\n{hostile.SCENE}"}),
    "lights-of-numbers": Case(X, "must be a table", {"x.toml": f"light = [1, 2]\n{hostile.SCENE}"}),
    "nan-scale": Case(X, "transform.scale", scene("[transform]\nscale = nan\n")),
    "zero-scale": Case(X, "transform.scale", scene("[transform]\nscale = 0\n")),
    "negative-scale": Case(X, "transform.scale", scene("[transform]\nscale = -1\n")),
    "infinite-translation": Case(X, "finite", scene("[transform]\ntranslate = [inf, 0, 0]\n")),
    "far-translation": Case(X, "beyond", scene("[transform]\ntranslate = [1e300, 0, 0]\n")),
    "nan-camera": Case(X, "finite", scene("[camera]\nposition = [nan, 0, 0]\n")),
    "infinite-fov": Case(X, "camera.fov", scene("[camera]\nfov = inf\n")),
    "zero-up": Case(X, "must not be zero", scene("[camera]\nup = [0, 0, 0]\n")),
    "nan-colour": Case(X, "from 0 to 15", scene("[light]\ncolour = [nan, 1, 1]\n")),
    "negative-colour": Case(X, "from 0", scene("[background]\ncolour = [-1, 0, 0]\n")),
    "negative-falloff": Case(X, "light.falloff", scene("[light]\nfalloff = -1\n")),
    "infinite-pixel": Case(X, "two numbers", scene('[object]\nstand_at = [inf, 1]\n[background]\nroom = "room"\n')),
    **{
        f"objects-{name}": Case(X, message, {"x.toml": text})
        for name, message, text in (
            ("none", "object must be a table", "object = []\n"),
            ("numbers", "must be tables", "object = [1]\n"),
            ("without-mesh", "object 2 has no mesh", '[[object]]\nmesh.name = "cube"\n[[object]]\n'),
            ("mesh-number", "object.mesh must be a table", "[[object]]\nmesh = 1\n"),
            ("mesh-nothing", "either a name or a path", "[[object]]\nmesh = {}\n"),
            ("unknown", "unknown key object.colour", '[[object]]\nmesh.name = "cube"\ncolour = 1\n'),
            ("deep-unknown", "unknown key object.material.x", '[[object]]\nmesh.name = "cube"\nmaterial.x = 1\n'),
            ("nan", "object.transform.scale", '[[object]]\nmesh.name = "cube"\ntransform.scale = nan\n'),
            ("albedo", "object.material.albedo", '[[object]]\nmesh.name = "cube"\nmaterial.albedo = [2, 0, 0]\n'),
            ("no-room", "needs background.room", '[[object]]\nmesh.name = "cube"\nsize = 0.2\n'),
            ("and-mesh", "leave out [mesh]", 'mesh.name = "cube"\n[[object]]\nmesh.name = "cube"\n'),
            ("and-motion", "give motion.translate", '[[object]]\nmesh.name = "cube"\n[motion]\nstand_at = [9, 9]\n'),
            ("many", "at most 64", '[[object]]\nmesh.name = "cube"\n' * 65),
            ("far", "beyond", '[[object]]\nmesh.name = "cube"\ntransform.translate = [1e300, 0, 0]\n'),
            (
                "both",
                "leave out object.size, or object.transform.scale",
                '[[object]]\nmesh.name = "cube"\nsize = 1\ntransform.scale = 2\n[background]\nroom = "room"\n',
            ),
        )
    },
    "objects-and-mesh-option": Case(
        f"{X} --mesh cube", "has 1 [[object]]", {"x.toml": '[[object]]\nmesh.name = "cube"\n'}
    ),
    "objects-and-frames": Case(
        f"{X} --frames 2", "stand still: give object.motion", {"x.toml": '[[object]]\nmesh.name = "cube"\n'}
    ),
    "nan-ior": Case(X, "material.ior", scene('[material]\nkind = "glass"\nior = nan\n')),
    "zero-width": Case(X, "frame.width", scene("[frame]\nwidth = 0\n")),
    "negative-bounces": Case(X, "paths.bounces", scene("[paths]\nbounces = -1\n")),
    "true-bounces": Case(X, "paths.bounces", scene("[paths]\nbounces = true\n")),
    "a-date": Case(X, "transform.scale", scene("[transform]\nscale = 2026-11-20\n")),
    # Configurations
    "duplicate-section": Case("generate --config x.json --print", "twice", {"x.json": '{"array": 1, "array": 2}'}),
    "duplicate-field": Case("generate --config x.json --print", "twice", {"x.json": '{"array":{"rows":1,"rows":2}}'}),
    "keys-deep": Case(X, "nested too deeply", {"x.toml": f"{'a.' * 400_000}b = 1\n"}),
    "json-deep": Case("generate --config x.json --print", "nested too deeply", {"x.json": "[" * 100_000}),
    "json-100-deep": Case("generate --config x.json --print", "nested", {"x.json": "[" * 100 + "]" * 100}),
    "rows-of-1000-digits": Case("generate --config x.json --print", "digits", {"x.json": f'{{"a": {"9" * 1000}}}'}),
    "infinite-number": Case("generate --config x.json --print", "too large", {"x.json": '{"array": 1e999}'}),
    "json-nan": Case("generate --config x.json --print", "not a JSON number", {"x.json": '{"array": NaN}'}),
    "json-binary": Case("generate --config x.json --print", "UTF-8", {"x.json": b"\xff\x00"}),
    "json-empty": Case("generate --config x.json --print", "not JSON", {"x.json": ""}),
    "json-of-2-MB": Case("generate --config x.json --print", "too large", {"x.json": " " * 2_000_000}),
    "configuration-of-300": Case(f"generate --config {'n' * 300} --print", "File name too long"),
    "configuration-with-escapes": Case("generate --config \x1b[31mred --print", "\\x1b[31mred"),
    "precision-of-19-digits": Case("generate --config 9999999999999999999b1s1d --print", "digits"),
    "precision-of-1000-digits": Case(f"generate --config {'9' * 1000}b1s1d --print", "digits"),
    "set-deep": Case(f"generate --config tiny --set array={'[' * 4000} --print", "value"),
    "set-long": Case(f"generate --config tiny --set array={'x' * 50_000} --print", "characters"),
    "set-digits": Case(f"generate --config tiny --set array.rows={'9' * 1000} --print", "digits"),
    "set-duplicate": Case("""generate --config tiny --set 'array={"rows":1,"rows":2}' --print""", "twice"),
    "set-old-key": Case("generate --config small --set physicalAttributeMemory.shellPlanes=4 --print", "unknown key"),
    "set-nothing": Case("generate --config tiny --set =1 --print", "key.path=value"),
    # Studies
    "study-of-many-points": Case(
        STUDY, "more than 1,000 points", study("".join(f"a{k} = {TWENTY}\n" for k in range(5)))
    ),
    "study-of-nothing": Case(STUDY, "title", {"x.toml": ""}),
    "study-keys-deep": Case(STUDY, "nested too deeply", study(f"{'a.' * 400_000}b = 1\n")),
    "study-deep": Case(STUDY, "nested too deeply", study(f"a = {'[' * DEEP}{']' * DEEP}\n")),
    "study-digits": Case(STUDY, "digits", study(f"a = [{NINES}]\n")),
    "study-with-escapes": Case(STUDY, "x1b[2J", study('"\\u001b[2J" = 1\n')),
    "study-of-5-MB": Case(STUDY, "too large", study(f"# {'n' * 5_000_000}\n")),
    # Numbers of options
    "frames": Case(f"{RENDER} --frames 1000000000 --output f.png", "1<=x<=10000"),
    "no-frames": Case(f"{RENDER} --frames 0 --output f.png", "1<=x<=10000"),
    "frames-digits": Case(f"{RENDER} --frames {NINES} --output f.png", "--frames"),
    "size-digits": Case(f"render s.toml --config tiny --size {NINES}x8", "WIDTHxHEIGHT"),
    "hardware-without-frames": Case("render s.toml --config traversal --backend model", "(queries)"),
    "rays-of-hardware-for-frames": Case("bench --rays 1 --config tiny --mesh none", "choose one with queries"),
    "rays-of-two-meshes": Case("bench --rays 1 --config traversal --mesh none --mesh none", "one --mesh"),
    "size-too-wide": Case("render s.toml --config tiny --backend model --size 999999999x8", "frame.maxWidth"),
    "delay-nan": Case("ppa --delay nan", "finite"),
    "clock-inf": Case("ppa --clock inf", "finite"),
    "teapot-digits": Case(f"{RENDER} --mesh teapot:{'9' * 5000}", "after the colon"),
    "sphere-superscript": Case(f"{RENDER} --mesh sphere:²", "after the colon"),
    "mesh-with-escapes": Case(f"{RENDER} --mesh '\x1b]0;title\x07'", "\\x1b]0;title\\x07"),
    "scene-with-escapes": Case("render '\x1b[31m' --config tiny", "\\x1b[31m"),
    "option-with-escapes": Case("render s.toml '--\x1b[31m'", "\\x1b[31m"),
    "command-with-escapes": Case("'\x1b[31m'", "\\x1b[31m"),
    "scene-not-utf-8": Case("render '\udcff.toml' --config tiny", "\\xff.toml"),
    "scene-of-300": Case(f"render {'s' * 300} --config tiny", "File name too long"),
    # Folders of meshes
    "meshes-overlong": Case(f"{RENDER} --mesh none", "cannot search", environment={"COLONNADE_MESHES": "m" * 5000}),
    "meshes-long": Case(f"{RENDER} --mesh none", "cannot search", environment={"COLONNADE_MESHES": "m" * 300}),
    "meshes-a-file": Case(f"{RENDER} --mesh none", "no mesh", environment={"COLONNADE_MESHES": "a.png"}),
    "meshes-fifo": Case(f"{RENDER} --mesh none", "no mesh", {"none.obj": fifo}, {"COLONNADE_MESHES": "."}),
}


@hostile.parametrised(CASES)
def test_input_is_refused(case: Case, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Yosys need not be installed to refuse a liberty
    monkeypatch.setattr("colonnade_lab.ppa.measure.require_yosys", lambda: None)
    hostile.run(case, folder, monkeypatch)


def test_packing_is_unchanged_by_the_cases(folder: Path) -> None:
    with hostile.inside(folder):
        assert CliRunner().invoke(cli, [*PACK.split(), "--output", "q"]).exit_code == 0
    assert (folder / "q" / "scene.image").read_bytes() == (folder / "p" / "scene.image").read_bytes()
