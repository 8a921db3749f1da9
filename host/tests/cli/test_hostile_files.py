"""Hostile pictures, hits, rooms, scene images and liberty files."""

from __future__ import annotations

import gzip
import io
import json
import struct
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import hostile
import numpy as np
import pytest
from click.testing import CliRunner
from hostile import COMPARE, HITS, PPA, ROOM, Case, Content, altered_image, meta, picture

from colonnade.cli.main import cli

CASES: dict[str, Case] = {}


def png(width: int, height: int) -> bytes:
    """A small PNG file that claims any size."""

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    packed = zlib.compress(b"\0" * 1000)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")


EPS = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 8 8\n%%EndComments\nshowpage\n"
CASES |= {
    "png-50000": Case(COMPARE, "pixels", {"x.png": png(50_000, 50_000)}),
    "png-9000": Case(COMPARE, "pixels", {"x.png": png(9_000, 9_000)}),
    "png-second": Case("compare a.png x.png --no-dists", "pixels", {"x.png": png(50_000, 50_000)}),
    "png-albedo": Case(ROOM, "pixels", {"room/albedo.png": png(50_000, 50_000)}),
    "png-photo": Case(ROOM, "pixels", {"room/photo.png": png(50_000, 50_000)}),
    "png-2-billion": Case(COMPARE, "x.png", {"x.png": png(2**31 - 1, 2**31 - 1)}),
    "png-zero": Case(COMPARE, "x.png", {"x.png": png(0, 0)}),
    "png-cut": Case(COMPARE, "x.png", {"x.png": png(8, 8)[:40]}),
    "png-short": Case(COMPARE, "x.png", {"x.png": png(4000, 4000)}),
    "png-noise": Case(COMPARE, "not a readable picture", {"x.png": np.random.default_rng(1).bytes(3000)}),
    "png-empty": Case(COMPARE, "not a readable picture", {"x.png": b""}),
    "png-of-eps": Case(COMPARE, "PNG, JPEG or WebP", {"x.png": EPS}),
    "albedo-of-eps": Case(ROOM, "PNG, JPEG or WebP", {"room/albedo.png": EPS}),
    "photo-of-eps": Case(ROOM, "PNG, JPEG or WebP", {"room/photo.png": EPS}),
    "png-of-gif": Case(COMPARE, "PNG, JPEG or WebP", picture("x.png", "GIF")),
    "png-of-tiff": Case(COMPARE, "PNG, JPEG or WebP", picture("x.png", "TIFF")),
    "png-of-bmp": Case(COMPARE, "PNG, JPEG or WebP", picture("x.png", "BMP")),
    "png-of-icns": Case(COMPARE, "PNG, JPEG or WebP", {"x.png": b"icns" + b"\0" * 100}),
    "png-name-of-300": Case(f"compare {'n' * 300} a.png", "File name too long"),
    "png-and-hits": Case("compare a.png h.npz", "cannot be compared"),
}


def npz(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def npz_of(members: Mapping[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return buffer.getvalue()


def npy(header: str, data: bytes = b"") -> bytes:
    text = header.encode() + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + data


def broken_zlib() -> bytes:
    good = bytearray(npz(triangle=np.arange(4096).reshape(64, 64), t=np.ones((64, 64))))
    good[60:90] = b"\xff" * 30
    return bytes(good)


def encrypted() -> bytes:
    """An archive whose member has the encryption flag in both headers."""
    data = bytearray(npz(triangle=np.zeros((8, 8), np.int64), t=np.ones((8, 8))))
    for mark, place in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        at = data.find(mark)
        while at >= 0:
            data[at + place] |= 1
            at = data.find(mark, at + 4)
    return bytes(data)


def bomb() -> bytes:
    """An archive whose members claim 4 GB unpacked."""
    data = bytearray(npz(triangle=np.zeros((8, 8), np.int64), t=np.ones((8, 8))))
    at = data.find(b"PK\x01\x02")
    while at >= 0:
        data[at + 24 : at + 28] = b"\xf0\xff\xff\xff"
        at = data.find(b"PK\x01\x02", at + 4)
    return bytes(data)


HUGE = "{'descr': '<i8', 'fortran_order': False, 'shape': (1000000000, 1000000000)}"
NUMBERS = np.zeros((8, 8), np.int64)
CASES |= {
    "npz-zlib": Case(HITS, "not a hits file", {"x.npz": broken_zlib()}),
    "npz-encrypted": Case(HITS, "not a hits file", {"x.npz": encrypted()}),
    "npz-strings": Case(HITS, "not a hits file", {"x.npz": npz(triangle=NUMBERS.astype(str), t=NUMBERS.astype(str))}),
    "npz-string-distance": Case(HITS, "not a hits file", {"x.npz": npz(triangle=NUMBERS, t=NUMBERS.astype(str))}),
    "npz-zero-size": Case(HITS, "empty", {"x.npz": npz(triangle=np.zeros((0, 0), int), t=np.zeros((0, 0)))}),
    "npz-objects": Case(HITS, "not a hits file", {"x.npz": npz(triangle=np.array([[None]]), t=np.ones((1, 1)))}),
    "npz-complex": Case(HITS, "not a hits file", {"x.npz": npz(triangle=NUMBERS, t=NUMBERS.astype(complex))}),
    "npz-three-axes": Case(HITS, "not a hits file", {"x.npz": npz(triangle=NUMBERS[None], t=np.ones((1, 8, 8)))}),
    "npz-other-names": Case(HITS, "not a hits file", {"x.npz": npz(a=NUMBERS)}),
    "npz-huge-shape": Case(HITS, "shape", {"x.npz": npz_of({"triangle.npy": npy(HUGE), "t.npy": npy(HUGE)})}),
    "npz-header-noise": Case(HITS, "header", {"x.npz": npz_of({"triangle.npy": npy("(" * 900), "t.npy": npy("1")})}),
    "npz-bomb": Case(HITS, "too large", {"x.npz": bomb()}),
    "npz-noise": Case(HITS, "not a hits file", {"x.npz": np.random.default_rng(2).bytes(2000)}),
    "npz-empty": Case(HITS, "not a hits file", {"x.npz": b""}),
    "npz-cut": Case(HITS, "not a hits file", {"x.npz": npz(triangle=NUMBERS, t=np.ones((8, 8)))[:-30]}),
    "npz-one-only": Case("compare a.png b.png --no-dists --hits-a h.npz", "both --hits"),
    "depth-objects": Case(ROOM, "array", {"room/depth.npy": npy("{'descr':'|O','fortran_order':False,'shape':(1,)}")}),
    "depth-huge": Case(ROOM, "shape", {"room/depth.npy": npy(HUGE)}),
    "depth-noise": Case(ROOM, "not a readable array", {"room/depth.npy": b"\x93NUMPY\x09\x09"}),
    "depth-empty": Case(ROOM, "not a readable array", {"room/depth.npy": b""}),
}


def of_meta(**changes: Any) -> dict[str, Content]:
    return {"room/meta.json": json.dumps(meta(**changes))}


POSE = meta()["cam_to_world"]
CASES |= {
    "meta-deep": Case(ROOM, "nested too deeply", {"room/meta.json": "[" * 100_000}),
    "meta-deep-object": Case(ROOM, "nested too deeply", {"room/meta.json": '{"a":' * 500 + "1" + "}" * 500}),
    "meta-list": Case(ROOM, "JSON object", {"room/meta.json": "[]"}),
    "meta-duplicate": Case(ROOM, "twice", {"room/meta.json": '{"fx": 1, "fx": 2}'}),
    "meta-nan": Case(ROOM, "NaN", of_meta(fx=float("nan"))),
    "meta-infinity": Case(ROOM, "Infinity", of_meta(cx=float("inf"))),
    "meta-zero-focal": Case(ROOM, "focal", of_meta(fx=0)),
    "meta-tiny-focal": Case(ROOM, "focal", of_meta(fx=1e-300)),
    "meta-huge-centre": Case(ROOM, "finite", of_meta(cx=1e300)),
    "meta-text-focal": Case(ROOM, "finite", of_meta(fy="60")),
    "meta-true-focal": Case(ROOM, "finite", of_meta(fy=True)),
    "meta-digits": Case(
        ROOM, "digits", {"room/meta.json": json.dumps(meta())[:-1] + ', "depth_step": 1' + "0" * 400 + "}"}
    ),
    "meta-pose-short": Case(ROOM, "4 rows", of_meta(cam_to_world=[1, 2])),
    "meta-pose-text": Case(ROOM, "4 rows", of_meta(cam_to_world=[["a"] * 4] * 4)),
    "meta-pose-digits": Case(ROOM, "away", of_meta(cam_to_world=[[*row[:3], 10**30] for row in POSE])),
    "meta-width": Case(ROOM, "width", of_meta(width="\x1b[31m")),
    "meta-encoding": Case(ROOM, "albedo_encoding", of_meta(albedo_encoding=["srgb"])),
    "room-is-a-file": Case("inspect --background a.png", "there is no room"),
    "room-named-300": Case(f"inspect --background {'r' * 300}", "there is no room"),
}


def altered(key: str, value: Any) -> Case:
    def change(header: dict[str, Any]) -> None:
        header[key] = value

    return Case("inspect x.image --config tiny", "x.image", {"x.image": altered_image(change)})


CASES |= {
    f"image-{name}": altered(key, value)
    for name, key, value in (
        ("text-count", "record_count", "12"),
        ("negative-count", "record_count", -1),
        ("huge-count", "record_count", 10**30),
        ("float-count", "triangles", 1.5),
        ("true-count", "triangles", True),
        ("zero-bits", "record_bits", 0),
        ("odd-bits", "record_bits", 33),
        ("other-bits", "record_bits", 32),
        ("text-bounds", "bounds_low", ["a", "b", "c"]),
        ("short-bounds", "bounds_high", [1]),
        ("no-frame", "frame", None),
        ("text-scale", "frame", {"scale": "1", "offset": [0, 0, 0]}),
        ("empty-extent", "extent", {}),
        ("no-outline", "extent", {"low": [0, 0, 0], "high": [1, 1, 1], "outline": []}),
        ("list-tree", "tree", [1]),
        ("odd-tree", "tree", {"nodes": "many"}),
        ("strange-material", "materials", [{"kind": "gold", "albedo": [1, 1, 1], "ior": 1.5}]),
        ("no-material", "materials", []),
        ("number-mesh", "mesh", 7),
        ("sections", "nodes", 10**9),
        ("room", "room", {"name": "r", "depth_unit": 1.0, "memories": [{"memory": "x", "words": 0, "word_bytes": 4}]}),
        (
            "negative-room",
            "room",
            {"name": "r", "depth_unit": 1, "memories": [{"memory": "x", "words": -9, "word_bytes": 1}]},
        ),
        ("deep", "mesh", json.loads("[" * 200 + "]" * 200)),
        ("long-mesh", "mesh", "m" * 10_000),
    )
}
CASES |= {
    "image-deep-header": Case(
        "inspect x.image", "corrupt", {"x.image": b"CLNDIMG5" + struct.pack("<I", 200_000) + b"[" * 200_100}
    ),
    "image-long-header": Case("inspect x.image", "truncated", {"x.image": b"CLNDIMG5\xff\xff\xff\xff" + b" " * 99}),
    "image-other-version": Case("inspect x.image", "another version", {"x.image": b"CLNDIMG1" + b" " * 99}),
    "image-none": Case("inspect none", "run colonnade pack"),
    "image-named-300": Case(f"inspect {'i' * 300}", "File name too long"),
}

LIBRARY = "library (x) {{ {} }}"
CASES |= {
    "liberty-gz": Case("ppa --liberty x.lib.gz --no-power", "unpacked", {"x.lib.gz": b"\x1f\x8b" + b"x" * 100}),
    "liberty-gz-cut": Case(
        "ppa --liberty x.lib.gz --no-power", "unpacked", {"x.lib.gz": gzip.compress(b"library (x) { }" * 99)[:-9]}
    ),
    "liberty-gz-zlib": Case(
        "ppa --liberty x.lib.gz --no-power", "unpacked", {"x.lib.gz": gzip.compress(b"l" * 99)[:12] + b"\xff" * 30}
    ),
    "liberty-empty": Case(PPA, "liberty file", {"x.lib": ""}),
    "liberty-noise": Case(PPA, "liberty file", {"x.lib": np.random.default_rng(3).bytes(3000)}),
    "liberty-no-cells": Case(PPA, "x", {"x.lib": LIBRARY.format("")}),
    "liberty-open": Case(PPA, "braces", {"x.lib": "library (x) {"}),
    "liberty-comments": Case(PPA, "comment", {"x.lib": "library (x) { " + "/*" * 300_000}),
    "liberty-area": Case(PPA, "liberty file", {"x.lib": LIBRARY.format("cell (a) { area : big; }")}),
    "liberty-nan": Case(PPA, "finite", {"x.lib": LIBRARY.format("cell (a) { area : nan; }")}),
    "liberty-load-unit": Case(PPA, "liberty file", {"x.lib": LIBRARY.format("capacitive_load_unit (one, pf);")}),
    "liberty-strange-unit": Case(PPA, "liberty file", {"x.lib": LIBRARY.format("capacitive_load_unit (1, kg);")}),
    "liberty-time-unit": Case(PPA, "time_unit", {"x.lib": LIBRARY.format('time_unit : "1 week";')}),
    "liberty-nameless-cell": Case(PPA, "liberty file", {"x.lib": LIBRARY.format("cell () { area : 1; }")}),
    "liberty-spaces": Case(
        "ppa --liberty 'a b;c.lib' --no-power", "a_b_c", {"a b;c.lib": LIBRARY.format("cell () { }")}
    ),
    "liberty-is-output": Case(f"{PPA} --json x.lib", "would replace", {"x.lib": LIBRARY.format("")}),
    "liberty-none": Case("ppa --liberty none.lib", "no liberty none.lib"),
    "liberty-empty-folder": Case("ppa --liberty room", "holds no .lib"),
    "liberty-named-300": Case(f"ppa --liberty {'l' * 300}", "File name too long"),
}


@hostile.parametrised(CASES)
def test_file_is_refused(case: Case, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Yosys need not be installed to refuse a liberty
    monkeypatch.setattr("colonnade_lab.ppa.measure.require_yosys", lambda: None)
    hostile.run(case, folder, monkeypatch)


def test_no_program_runs_for_a_picture(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Regression: an EPS file made Pillow run ``gs`` from PATH."""
    gs = folder / "bin" / "gs"
    gs.parent.mkdir()
    gs.write_text("#!/bin/sh\ntouch ran\n")
    gs.chmod(0o755)
    monkeypatch.setenv("PATH", str(gs.parent), prepend=":")
    hostile.run(Case(COMPARE, "PNG, JPEG or WebP", {"x.png": EPS}), folder, monkeypatch)


def test_the_content_of_a_picture_counts_not_its_name(folder: Path) -> None:
    from colonnade.common.image_io import read_picture

    (folder / "x.jpg").write_bytes((folder / "a.png").read_bytes())
    assert np.array_equal(read_picture(folder / "x.jpg"), read_picture(folder / "a.png"))


def test_hostile_names_of_an_image_are_shown_harmless(folder: Path) -> None:
    altered_image(lambda header: header.update(mesh="\x1b[31mred\x07\nforged line"))(folder / "x.image")
    with hostile.inside(folder):
        done = CliRunner().invoke(cli, ["inspect", "x.image"])
    assert done.exit_code == 0, done.output
    assert "\\x1b[31mred\\x07 forged line: 12 triangles" in done.stdout
    assert "\x1b" not in done.output
