"""Test cases of hostile command lines: arguments, files and the expected error line."""

from __future__ import annotations

import hashlib
import io
import json
import os
import shlex
import stat
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from colonnade.cli.main import cli
from colonnade.design import toolchain

#: Content of a file: bytes, text, or a function that creates the file.
Content = bytes | str | Callable[[Path], None]

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
SCENE = '[mesh]\nname = "cube"\n'
#: Command lines for `s.toml`, without a simulator.
RENDER_BY = "render s.toml --config tiny --size 8x8 --backend"
RENDER = f"{RENDER_BY} model"
COMPARE = "compare x.png a.png --no-dists"
HITS = "compare x.npz h.npz"
ROOM = "inspect --background room --no-dists"
PPA = "ppa --liberty x.lib --no-power"
PACK = "pack s.toml --config tiny"


@dataclass(frozen=True)
class Case:
    """One hostile command line.

    Attributes:
        arguments: Arguments of ``colonnade``.
        says: Expected part of the error line.
        files: Files in addition to `world`'s, by path.
        environment: Environment variables.
        status: Exit status.
    """

    arguments: str
    says: str
    files: Mapping[str, Content] = field(default_factory=dict)
    environment: Mapping[str, str] = field(default_factory=dict)
    status: int = 2


def parametrised(cases: Mapping[str, Case]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("case", list(cases.values()), ids=list(cases))


def world(folder: Path) -> None:
    """Create the valid files that the cases use, in ``folder``."""
    (folder / "s.toml").write_text(SCENE)
    (folder / "tri.obj").write_text(TRIANGLE)
    for name, level in (("a.png", 30), ("b.png", 200)):
        Image.fromarray(np.full((8, 8, 3), level, dtype=np.uint8)).save(folder / name)
    shape = (8, 8)
    np.savez(folder / "h.npz", triangle=np.zeros(shape, np.int64), t=np.ones(shape))
    (folder / "c.json").write_bytes((toolchain.project_root() / "configs" / "tiny.json").read_bytes())
    environment = folder / "room"
    environment.mkdir()
    (environment / "meta.json").write_text(json.dumps(meta()))
    for name, colour in (("albedo.png", (128, 128, 128)), ("normal.png", (128, 128, 0))):
        Image.new("RGB", (64, 48), colour).save(environment / name)
    np.save(environment / "depth.npy", np.full((48, 64), 2.0))
    with inside(folder):
        packed = CliRunner().invoke(cli, shlex.split(f"{PACK} --output p"))
    assert packed.exit_code == 0, packed.output


def meta(**changes: Any) -> dict[str, Any]:
    """The content of a room's ``meta.json``."""
    pose = [[1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 1.5], [0.0, 0.0, -1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    return {"fx": 60.0, "fy": 60.0, "cx": 32.0, "cy": 24.0, "cam_to_world": pose} | changes


def run(case: Case, folder: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Run a case in ``folder``, check the common properties of errors, and return the error line."""
    for name, content in case.files.items():
        make(folder / name, content)
    for variable, value in case.environment.items():
        monkeypatch.setenv(variable, value)
    before = snapshot(folder)
    with inside(folder):
        result = CliRunner().invoke(cli, shlex.split(case.arguments))
    line = refused(result, case)
    assert snapshot(folder) == before, "files were made, changed or removed"
    return line


def refused(result: Result, case: Case) -> str:
    assert result.exit_code == case.status, f"exit {result.exit_code}: {result.output[-2000:]} {result.exception!r}"
    return one_error_line(result.stderr, case.says)


def one_error_line(stderr: str, says: str) -> str:
    assert stderr.endswith("\n") and stderr.count("\n") == 1, stderr[-2000:]
    line = stderr[:-1]
    assert line.startswith("colonnade: error: "), line
    assert says in line, line
    assert line.isprintable(), repr(line)
    assert len(line) < 1200, len(line)
    return line


def make(path: Path, content: Content) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    if callable(content):
        content(path)
    else:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())


def fifo(path: Path) -> None:
    os.mkfifo(path)


def link_to(target: str) -> Callable[[Path], None]:
    return lambda path: path.symlink_to(target)


def hard_link_to(name: str) -> Callable[[Path], None]:
    return lambda path: path.hardlink_to(path.parent / name)


def read_only(path: Path) -> None:
    path.write_text("kept")
    path.chmod(0o444)


def scene(text: str) -> dict[str, Content]:
    """A scene file x.toml of the cube with additional lines."""
    return {"x.toml": SCENE + text}


def picture(name: str, kind: str, **options: Any) -> dict[str, Content]:
    buffer = io.BytesIO()
    Image.fromarray(np.full((8, 8, 3), 90, dtype=np.uint8)).save(buffer, format=kind, **options)
    return {name: buffer.getvalue()}


def altered_image(change: Callable[[dict[str, Any]], object]) -> Callable[[Path], None]:
    """A scene image with a changed header and a correct checksum, made from p/scene.image."""

    def write(path: Path) -> None:
        data = (path.parent / "p" / "scene.image").read_bytes()
        (length,) = struct.unpack_from("<I", data, 8)
        header = json.loads(data[12 : 12 + length])
        change(header)
        text = json.dumps(header).encode()
        body = data[:8] + struct.pack("<I", len(text)) + text + data[12 + length : -32]
        path.write_bytes(body + hashlib.sha256(body).digest())

    return write


def snapshot(folder: Path) -> dict[str, Any]:
    """Kind, mode, and content or link target of each file in a folder."""
    found: dict[str, Any] = {}
    for path in sorted(folder.rglob("*")):
        status = path.lstat()
        content: Any = None
        if stat.S_ISREG(status.st_mode):
            content = path.read_bytes()
        elif stat.S_ISLNK(status.st_mode):
            content = str(path.readlink())
        found[path.relative_to(folder).as_posix()] = (oct(status.st_mode), content)
    return found


@contextmanager
def inside(folder: Path) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
