"""Rejected outputs: devices, pipes, links, read-only files, inputs, other outputs, foreign folders."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import hostile
import pytest
from click.testing import CliRunner
from hostile import PACK, RENDER, SCENE, Case, fifo, hard_link_to, link_to, read_only

from colonnade.cli.main import cli
from colonnade.design.design_folder import MARKER, TITLE, check_replaceable, write_marker
from colonnade.design.generator import manifest_for

GENERATE = "generate --config tiny --manifest-only"
LONG = "n" * 300

#: Existing files at an output's path: how to create them, and their description in errors.
EXISTING = {
    "fifo": (fifo, "a pipe"),
    "folder": (lambda path: path.mkdir(), "a folder"),
    "link-to-file": (link_to("a.png"), "a symbolic link"),
    "link-to-nothing": (link_to("nowhere"), "a symbolic link"),
    "link-to-device": (link_to("/dev/null"), "a symbolic link"),
    "read-only": (read_only, "read-only"),
}
#: Every option that names an output file.
OUTPUTS = {
    "render-output": f"{RENDER} --output out",
    "render-hits": f"{RENDER} --hits out",
    "render-json": f"{RENDER} --json out",
    "compare-json": "compare a.png b.png --no-dists --json out",
    "pack-json": f"{PACK} --output q --json out",
    "inspect-json": "inspect p --json out",
    "generate-json": f"{GENERATE} --output d --json out",
    "bench-plot": "bench --plot out",
    "bench-json": "bench --json out",
    "verify-json": "verify --json out",
    "study-json": "study rays room --json out",
    "ppa-json": "ppa --json out",
}
CASES = {
    f"{option}-{kind}": Case(arguments, says, {"out": content})
    for option, arguments in OUTPUTS.items()
    for kind, (content, says) in EXISTING.items()
}
CASES |= {
    f"{option}-device": Case(arguments.replace(" out", " /dev/null"), "a device")
    for option, arguments in OUTPUTS.items()
}
CASES |= {
    f"{option}-long-name": Case(arguments.replace(" out", f" {LONG}"), "File name too long")
    for option, arguments in OUTPUTS.items()
}
CASES |= {
    "full-device": Case(f"{RENDER} --output /dev/full", "a device"),
    "stdout": Case(f"{RENDER} --json /dev/stdout", "/dev/stdout is"),
    "descriptor": Case(f"{RENDER} --json /dev/fd/1", "/dev/fd/1 is"),
    "no-parent": Case(f"{RENDER} --output none/f.png", "not a folder"),
    "parent-is-a-file": Case(f"{RENDER} --output a.png/f.png", "not a folder"),
    "in-proc": Case(f"{RENDER} --output /proc/f.png", "/proc"),
    "long-path": Case(f"{RENDER} --output {'d/' * 3000}f.png", "File name too long"),
    # An input of the same command
    "scene": Case(f"{RENDER.replace('s.toml', 's.png')} --output s.png", "would replace s.png", {"s.png": SCENE}),
    "scene-as-json": Case(f"{RENDER} --json s.toml", "would replace s.toml"),
    "scene-as-hits": Case(f"{RENDER} --hits h", "would replace s.toml", {"h": hard_link_to("s.toml")}),
    "scene-other-spelling": Case(f"{RENDER} --json p/../s.toml", "would replace s.toml"),
    "scene-by-hard-link": Case(f"{RENDER} --output l.png", "would replace s.toml", {"l.png": hard_link_to("s.toml")}),
    "scene-through-link": Case(
        "render l.toml --config tiny --backend model --size 8x8 --json s.toml",
        "would replace l.toml",
        {"l.toml": link_to("s.toml")},
    ),
    "scene-is-json": Case(f"{PACK} --output q --json s.toml", "would replace s.toml"),
    "mesh": Case(f"{RENDER} --mesh tri.obj --json tri.obj", "would replace tri.obj"),
    "mesh-of-the-scene": Case(
        "render x.toml --config tiny --backend model --size 8x8 --json tri.obj",
        "would replace tri.obj",
        {"x.toml": '[mesh]\npath = "tri.obj"\n'},
    ),
    "materials": Case(
        f"{RENDER} --mesh m.obj --json m.mtl",
        "would replace",
        {"m.obj": "mtllib m.mtl\n" + hostile.TRIANGLE, "m.mtl": "newmtl a\nKd 1 0 0\n"},
    ),
    "configuration": Case("render s.toml --config c.json --backend model --json c.json", "would replace c.json"),
    "picture": Case("compare a.png b.png --no-dists --json b.png", "would replace b.png"),
    "hits": Case("compare h.npz h.npz --json h.npz", "would replace h.npz"),
    "image": Case("inspect p --json p/scene.image", "would replace p/scene.image"),
    "camera": Case("inspect --background room --no-dists --json room/meta.json", "would replace room/meta.json"),
    "albedo": Case("inspect --background room --no-dists --json room/albedo.png", "would replace room/albedo.png"),
    "depth": Case("inspect --background room --no-dists --json room/depth.npy", "would replace room/depth.npy"),
    "room-of-a-study": Case("study rays room --json room/normal.png", "would replace room/normal.png"),
    "scene-of-verify": Case(
        "verify --config tiny --mesh cube --no-rtl --no-reference --scene s.toml --json s.toml", "would replace s.toml"
    ),
    # Another output of the same command
    "json-is-output": Case(f"{RENDER} --output f --json f", "two outputs"),
    "hits-is-output": Case(f"{RENDER} --output f --hits f", "two outputs"),
    "json-is-hits": Case(f"{RENDER} --json ./f --hits p/../f", "two outputs"),
    "json-is-output-by-hard-link": Case(
        f"{RENDER} --output a.png --json l.png", "two outputs", {"l.png": hard_link_to("a.png")}
    ),
    "json-is-a-frame": Case(f"{RENDER} --frames 3 --output f.png --json f_0001.png", "two outputs"),
    "hits-are-json": Case(f"{RENDER} --json f.npz --hits f.npz", "two outputs"),
    "picture-as-jpeg": Case(f"{RENDER} --output o.jpg", "o.jpg is written as PNG: end its name in .png"),
    "picture-as-webp": Case(f"{RENDER} --output o.webp", "o.webp is written as PNG"),
    "hits-as-png": Case(f"{RENDER} --hits h.png", "h.png is written as NPZ: end its name in .npz"),
    "waveform-as-png": Case(f"{RENDER} --waveform w.png", "w.png is written as VCD"),
    "plot-as-pdf": Case("bench --plot p.pdf", "p.pdf is written as PNG"),
    "truth-is-a-pipe": Case(f"{RENDER} --background room --truth t.ply", "t.ply: it is a pipe", {"t.ply": fifo}),
    "frame-too-large-after-packing": Case(
        f"{PACK} --output q --frame-file f --size 99999x9", "99999", {"q": lambda path: path.mkdir()}
    ),
    "photo-without-a-room": Case(
        f"{PACK} --output q --photo-file f --size 8x8", "no photo of its view", {"q": lambda path: path.mkdir()}
    ),
    "frame-is-a-pipe": Case(f"{RENDER} --frames 3 --output f.png", "a pipe", {"f_0002.png": fifo}),
    "json-is-plot": Case("bench --plot f --json f", "two outputs"),
    "json-is-image": Case(f"{PACK} --output q.image --json q.image", "two outputs"),
    "json-in-design": Case(
        f"{GENERATE} --output d --json d/manifest.json", "in the folder", {"d": lambda path: path.mkdir()}
    ),
    # Folders
    "pack-into-a-file": Case(f"{PACK} --output Makefile", "a file", {"Makefile": "all:\n"}),
    "pack-over-a-text": Case(f"{PACK} --output notes.txt", "not a scene image", {"notes.txt": "irreplaceable"}),
    "pack-into-a-pipe": Case(f"{PACK} --output q", "a pipe", {"q": fifo}),
    "pack-onto-a-link": Case(f"{PACK} --output q", "a symbolic link", {"q/scene.image": link_to("../a.png")}),
    "pack-over-a-foreign-image": Case(f"{PACK} --output q", "not a scene image", {"q/scene.image": "mine"}),
    "pack-long-name": Case(f"{PACK} --output {LONG}", "File name too long"),
    "maps-into-a-file": Case("inspect --background room --no-dists --output a.png", "a file"),
    "study-into-a-file": Case("study frames room --no-dists --output a.png", "a file"),
    "study-into-a-link": Case("study frames room --output l", "a symbolic link", {"l": link_to("room")}),
    "explore-into-a-file": Case("explore x.toml --output a.png", "a file"),
    "explore-into-a-pipe": Case("explore x.toml --output d", "a pipe", {"d": fifo}),
    "explore-over-a-room": Case("explore x.toml --output room", "room holds files, but no"),
    "explore-long-name": Case(f"explore x.toml --output {LONG}", "File name too long"),
    "explore-below-a-file": Case("explore x.toml --output a.png/d", "not a folder"),
    "generate-into-a-file": Case(f"{GENERATE} --output a.png", "a file"),
    "generate-into-a-pipe": Case(f"{GENERATE} --output d", "a pipe", {"d": fifo}),
    "generate-into-a-link": Case(f"{GENERATE} --output l", "a symbolic link", {"l": link_to("room")}),
    "generate-into-a-link-with-slash": Case(f"{GENERATE} --output l/", "a symbolic link", {"l": link_to("room")}),
    "generate-here": Case(f"{GENERATE} --output .", "working directory"),
    "generate-above": Case(f"{GENERATE} --output ..", "holds"),
    "generate-over-the-root": Case(f"{GENERATE} --output /", MARKER),
    "generate-over-a-room": Case(f"{GENERATE} --output room", MARKER),
    "generate-over-a-foreign-manifest": Case(f"{GENERATE} --output d", MARKER, {"d/manifest.json": "{}"}),
    "generate-over-empty-folders": Case(f"{GENERATE} --output d", MARKER, {"d/e": lambda path: path.mkdir()}),
    "generate-over-a-false-marker": Case(f"{GENERATE} --output d", "cannot be read", {f"d/{MARKER}": "mine\n"}),
    "generate-over-a-binary-marker": Case(f"{GENERATE} --output d", "cannot be read", {f"d/{MARKER}": b"\xff\xfe"}),
    "generate-long-name": Case(f"{GENERATE} --output {LONG}", "File name too long"),
    "generate-below-a-file": Case(f"{GENERATE} --output a.png/d", "not a folder"),
    "generate-nothing": Case(f"{GENERATE} --output ''", "working directory"),
    "control-characters": Case(RENDER + " --output x\x1b[31m/f.png", "\\x1b[31m"),
}


@hostile.parametrised(CASES)
def test_output_is_refused(case: Case, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hostile.run(case, folder, monkeypatch)


def generated(folder: Path) -> Path:
    output = folder / "design"
    arguments = [*GENERATE.split(), "--output", str(output)]
    done = CliRunner().invoke(cli, arguments)
    assert done.exit_code == 0, done.output
    return output


def test_generate_replaces_its_own_unchanged_folder(tmp_path: Path) -> None:
    output = generated(tmp_path)
    first = hostile.snapshot(output)
    assert set(first) == {"manifest.json", MARKER}
    assert hostile.snapshot(generated(tmp_path)) == first
    assert [path.name for path in tmp_path.iterdir()] == ["design"]
    done = subprocess.run(["sha256sum", "--check", "--strict", MARKER], cwd=output, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("change", ["added", "changed", "removed", "link", "hidden", "folder", "unmarked"])
def test_generate_keeps_what_it_did_not_write(tmp_path: Path, change: str) -> None:
    output = generated(tmp_path)
    manifest = output / "manifest.json"
    if change == "added":
        (output / "thesis.txt").write_text("irreplaceable")
    elif change == "changed":
        manifest.write_text(manifest.read_text() + "\n")
    elif change == "removed":
        manifest.unlink()
    elif change == "link":
        (output / "notes").symlink_to("manifest.json")
    elif change == "hidden":
        (output / ".git").mkdir()
        (output / ".git" / "config").write_text("mine")
    elif change == "folder":
        (output / "empty").mkdir()
    elif change == "unmarked":
        (output / MARKER).unlink()
    before = hostile.snapshot(tmp_path)
    done = CliRunner().invoke(cli, [*GENERATE.split(), "--output", str(output)])
    assert done.exit_code == 2
    hostile.one_error_line(done.stderr, "not replaced")
    assert hostile.snapshot(tmp_path) == before


def test_generate_fills_an_empty_folder_but_not_the_working_directory(tmp_path: Path) -> None:
    (tmp_path / "design").mkdir()
    generated(tmp_path)
    here = tmp_path / "here"
    here.mkdir()
    with hostile.inside(here):
        done = CliRunner().invoke(cli, [*GENERATE.split(), "--output", "."])
    hostile.one_error_line(done.stderr, "working directory")


def test_python_and_scala_know_each_others_folders(tmp_path: Path) -> None:
    """`GenerateSpec` checks the same two files and the same list."""
    (tmp_path / "sub").mkdir()
    (tmp_path / "a").write_text("a\n")
    (tmp_path / "sub" / "b").write_text("b\n")
    write_marker(tmp_path)
    assert (tmp_path / MARKER).read_text().splitlines() == [
        TITLE,
        "87428fc522803d31065e7bce3cf03fe475096631e5e07bbd7a0fde60c4cf25c7  a",
        "0263829989b6fd954f72baaf2fc64bc2e2f01d692d4de72986ea808f6e99813f  sub/b",
    ]
    check_replaceable(tmp_path)
    # What the generator itself wrote into the cache: a manifest, or a design that has it
    written, copy = manifest_for("tiny").dir, tmp_path / "copy"
    for name in (MARKER, *(line.split("  ", 1)[1] for line in (written / MARKER).read_text().splitlines()[1:])):
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(written / name, copy / name)
    check_replaceable(copy)


def test_an_output_keeps_the_permissions_of_the_file_it_replaces(folder: Path, valid_files: Path) -> None:
    report = folder / "r.json"
    report.write_text("{}")
    report.chmod(0o600)
    with hostile.inside(folder):
        assert CliRunner().invoke(cli, ["compare", "a.png", "b.png", "--no-dists", "--json", "r.json"]).exit_code == 0
    assert report.stat().st_mode & 0o777 == 0o600
    assert json.loads(report.read_text())["identical"] is False
    assert {path.name for path in folder.iterdir()} - {path.name for path in valid_files.iterdir()} == {"r.json"}
