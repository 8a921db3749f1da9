"""Captures that lack something or are made to do harm: one line, status 2, and nothing is written."""

from __future__ import annotations

import json
import struct
import subprocess
import zipfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import lzfse
import numpy as np
import pytest
from capture_files import (
    Recording,
    jpeg,
    lzfse_bomb,
    phone,
    png,
    record3d_members,
    room_recording,
    write_stray_scanner,
    write_transforms,
    write_tum,
    write_zip,
)
from hostile import Case, run
from imageio_ffmpeg import get_ffmpeg_exe

from colonnade.capture import record3d
from colonnade.capture.record3d import Record3D

Change = Callable[[Path], None]
MEBIBYTE = 1 << 20


@cache
def recording() -> Recording:
    """Small, so that each case is quick."""
    whole = phone(room_recording("living", 2))
    return replace(whole, depth=whole.depth[::4, ::4], photo=whole.photo[::4, ::4])


@cache
def members() -> dict[str, bytes]:
    return record3d_members(recording())


def meta(**changes: Any) -> dict[str, bytes]:
    """The members of an archive with changes of its metadata; None removes a key."""
    data = json.loads(members()["metadata"]) | changes
    return {"metadata": json.dumps({key: value for key, value in data.items() if value is not None}).encode()}


def padded(size: int) -> bytes:
    """A stream, and zeros after its end."""
    return members()["rgbd/0.depth"].ljust(size, b"\0")


def deep() -> bytes:
    return b'{"a":' * 1000 + b"1" + b"}" * 1000


POSES = json.loads(record3d_members(replace(room_recording("living", 2), depth=np.ones((8, 8))))["metadata"])["poses"]

#: Members of an .r3d file that are replaced (None: removed), and the line.
RECORD3D: dict[str, tuple[Callable[[], dict[str, bytes | None]], str]] = {
    "no-metadata": (lambda: {"metadata": None}, "lacks metadata"),
    "no-poses": (lambda: {**meta(poses=None)}, "lacks poses"),
    "face-camera": (lambda: {**meta(poses=[[0, 0, 0, 1, 0, 0, 0]] * 2)}, "no pose of the camera"),
    "pose-zero": (lambda: {**meta(poses=[[0.0] * 7] * 2)}, "quaternion of length 0"),
    "pose-short": (lambda: {**meta(poses=[[1, 0, 0]])}, "must have poses[0] with 7 numbers"),
    "pose-far": (lambda: {**meta(poses=[POSES[0], [*POSES[1][:4], 1e30, 0, 0]])}, "within 1e+06 metres"),
    "pose-text": (lambda: {**meta(poses=[["a"] * 7])}, "with 7 numbers"),
    "no-lens": (lambda: {**meta(K=None)}, "must have K with 9 numbers"),
    "lens-zero": (lambda: {**meta(K=[0] * 9)}, "focal lengths"),
    "no-depth": (lambda: {"rgbd/0.depth": None}, "has no depth"),
    "depth-of-a-frame": (lambda: {"rgbd/1.depth": None}, "lacks rgbd/1.depth"),
    "no-photo": (lambda: {"rgbd/0.jpg": None}, "lacks rgbd/0.jpg"),
    "depth-huge": (lambda: {**meta(dw=65536, dh=65536)}, "has depth of 65536x65536 pixels"),
    "depth-size-text": (lambda: {**meta(dw="wide")}, "must have dw"),
    "depth-other-size": (lambda: {**meta(dw=63)}, "do not have the"),
    "photo-huge": (lambda: {"rgbd/0.jpg": huge_png()}, "too many pixels"),
    "photo-text": (lambda: {"rgbd/0.jpg": b"no picture"}, "rgbd/0.jpg in x.r3d is not a readable picture"),
    "lzfse-text": (lambda: {"rgbd/0.depth": b"no stream at all"}, "rgbd/0.depth in x.r3d is damaged"),
    "lzfse-empty": (lambda: {"rgbd/0.depth": b""}, "rgbd/0.depth in x.r3d is damaged"),
    "lzfse-torn": (lambda: {"rgbd/1.depth": members()["rgbd/1.depth"][:500]}, "rgbd/1.depth in x.r3d is damaged"),
    "lzfse-claims-4-gigabytes": (
        lambda: {"rgbd/0.depth": members()["rgbd/0.depth"][:4] + b"\xff\xff\xff\xff" + bytes(40)},
        "rgbd/0.depth in x.r3d is damaged",
    ),
    "lzfse-bomb": (lambda: {"rgbd/0.depth": lzfse_bomb(8, 12288)}, "rgbd/0.depth in x.r3d is damaged"),
    "lzfse-long": (lambda: {"rgbd/0.depth": padded(1 << 26)}, "rgbd/0.depth in x.r3d is too large: it may have 17,920"),
    "lzfse-padded": (lambda: {"rgbd/0.depth": padded(17_920)}, "rgbd/0.depth in x.r3d is damaged"),
    "metadata-groups": (lambda: {"metadata": b"[" + b"[]," * (1 << 20) + b"[]]"}, "more than 1,048,576 lists"),
    "times-far": (lambda: {**meta(frameTimestamps=[0, 1.7e308])}, "its frames are 1.7e+308 s apart, 1000 s at most"),
    "times-infinite": (lambda: {**meta(frameTimestamps=[-1.7e308, 1e308])}, "its frames are inf s apart"),
    "times-33-ns": (lambda: {**meta(frameTimestamps=[0, 33e-9])}, "frame 1 is not a microsecond or more after"),
    "times-equal": (lambda: {**meta(frameTimestamps=[7, 7])}, "frame 1 is not a microsecond or more after"),
    "times-that-print-equal": (
        lambda: {**meta(frameTimestamps=[0.0, 4e-7])},
        "the time of frame 1 is not a microsecond or more after the frame before",
    ),
    "lens-of-a-later-frame": (
        lambda: {**meta(perFrameIntrinsicCoeffs=[[*recording().lens], [3e5, 3e5, 80, 60]])},
        "x.r3d, frame 1: fx must be a finite number of pixels up to 1e+06",
    ),
    "metadata-bomb": (lambda: {"metadata": bytes(40 * MEBIBYTE)}, "metadata in x.r3d is too large"),
    "metadata-deep": (lambda: {"metadata": deep()}, "nested too deeply"),
    "metadata-list": (lambda: {"metadata": b"[]"}, "must be a JSON object"),
    "metadata-text": (lambda: {"metadata": b"\xff"}, "is not JSON"),
    "no-certain-depth": (
        lambda: {f"rgbd/{n}.conf": lzfse.compress(bytes(recording().depth.size)) for n in range(2)},
        "no frame has certain depth in half of its pixels",
    ),
}


def huge_png() -> bytes:
    """A picture whose header claims 50,000 x 50,000 pixels."""
    data = bytearray(png(np.zeros((8, 8, 3), np.uint8)))
    data[16:24] = struct.pack(">II", 50_000, 50_000)
    import zlib

    data[29:33] = struct.pack(">I", zlib.crc32(bytes(data[12:29])))
    return bytes(data)


def one(folder: Path, says: str, monkeypatch: pytest.MonkeyPatch, source: str, options: str = "") -> None:
    run(Case(f"capture {source} --output out {options}", says), folder, monkeypatch)


@pytest.mark.parametrize("name", RECORD3D)
def test_record3d(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    change, says = RECORD3D[name]
    changed = {key: value for key, value in {**members(), **change()}.items() if value is not None}
    with zipfile.ZipFile(tmp_path / "x.r3d", "w", zipfile.ZIP_DEFLATED) as archive:
        for key, value in changed.items():
            archive.writestr(key, value)
    one(tmp_path, says, monkeypatch, "x.r3d")


def test_archives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = write_zip(tmp_path / "whole.r3d", members()).read_bytes()
    at = whole.rfind(b"PK\x05\x06")
    torn = bytearray(whole)
    torn[whole.find(b"PK\x01\x02") : whole.find(b"PK\x01\x02") + 4] = b"....."[:4]
    lists = bytearray(whole)
    struct.pack_into("<I", lists, at + 12, 1 << 31)
    encrypted = bytearray(whole)
    for mark, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        encrypted[whole.find(mark) + flags] |= 1
    damaged = bytearray(whole)
    first = whole.find(b"rgbd/0.depth") + 12
    damaged[first : first + 64] = bytes(64)
    cases: dict[str, tuple[bytes, str]] = {
        "half": (whole[: len(whole) // 2], "is not a whole ZIP archive"),
        "empty": (b"", "is not a whole ZIP archive"),
        "text": (b"no archive", "is not a whole ZIP archive"),
        "torn-list": (bytes(torn), "is not a whole ZIP archive"),
        "long-list": (bytes(lists), "has too many members"),
        "large": (whole[:at] + b"PK\x06\x07" + bytes(16) + whole[at:], "has too many members"),
        "encrypted": (bytes(encrypted), "metadata in encrypted.r3d is damaged"),
        "damaged": (bytes(damaged), "rgbd/0.depth in damaged.r3d is damaged"),
    }
    for name, (content, says) in cases.items():
        (tmp_path / f"{name}.r3d").write_bytes(content)
        one(tmp_path, says, monkeypatch, f"{name}.r3d")
    one(tmp_path, "there is no capture nowhere.r3d", monkeypatch, "nowhere.r3d")
    (tmp_path / "folder").mkdir()
    one(tmp_path, "folder is no capture", monkeypatch, "folder")


def test_members_cannot_leave_the_archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No member is unpacked by its name."""
    write_zip(tmp_path / "x.r3d", {**members(), "../evil": b"evil", "/tmp/evil": b"evil", "rgbd/0.depth": b""})
    one(tmp_path, "rgbd/0.depth in x.r3d is damaged", monkeypatch, "x.r3d")


def test_few_bytes_are_decoded_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of small frames several, else one."""
    calls: list[int] = []

    def decoded(streams: list[tuple[str, bytes, int]], where: str) -> list[bytes]:
        calls.append(sum(length for *_, length in streams))
        return [bytes(length) for *_, length in streams]

    monkeypatch.setattr(record3d, "decode_lzfse", decoded)
    for size in (500, 2000):
        write_zip(tmp_path / "x.r3d", {**members(), **meta(dw=size, dh=size)})
        list(Record3D(tmp_path / "x.r3d").frames([0, 1]))
    assert calls == [2 * 5 * 500**2, 5 * 2000**2, 5 * 2000**2]


def removed(name: str) -> Change:
    return lambda folder: (folder / name).unlink()


def written(name: str, content: str | bytes) -> Change:
    data = content.encode() if isinstance(content, str) else content
    return lambda folder: (folder / name).write_bytes(data) and None


def linked(name: str, target: str = "/etc/passwd") -> Change:
    def change(folder: Path) -> None:
        (folder / name).unlink()
        (folder / name).symlink_to(target)

    return change


def edited(name: str, old: str, new: str) -> Change:
    def change(folder: Path) -> None:
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))

    return change


def large_video(folder: Path) -> None:
    command = [get_ffmpeg_exe(), "-v", "error", "-y", "-f", "lavfi", "-i", "color=s=4096x2320", "-frames:v", "1"]
    subprocess.run([*command, "-c:v", "libx264", "-preset", "ultrafast", str(folder / "rgb.mp4")], check=True)


def transforms(**changes: Any) -> Change:
    def change(folder: Path) -> None:
        data = json.loads((folder / "transforms.json").read_text())
        for frame in data["frames"]:
            for key in [key for key in changes if key in frame]:
                frame[key] = changes[key]
                if changes[key] is None:
                    del frame[key]
        data |= {key: value for key, value in changes.items() if key in data or key == "camera_model"}
        (folder / "transforms.json").write_text(json.dumps({k: v for k, v in data.items() if v is not None}))

    return change


TITLES = "timestamp, frame, x, y, z, qx, qy, qz, qw\n"
FOLDERS: dict[str, tuple[Callable[[Path, Recording], Path], Change, str]] = {
    "stray-no-video": (write_stray_scanner, removed("rgb.mp4"), "lacks rgb.mp4"),
    "stray-video-text": (write_stray_scanner, written("rgb.mp4", "no video"), "cannot read the video"),
    "stray-video-empty": (write_stray_scanner, written("rgb.mp4", b""), "cannot read the video"),
    "stray-video-large": (write_stray_scanner, large_video, "Picture size 4096x2320 exceeds"),
    "stray-no-matrix": (write_stray_scanner, removed("camera_matrix.csv"), "lacks camera_matrix.csv"),
    "stray-matrix-short": (write_stray_scanner, written("camera_matrix.csv", "1, 2\n"), "three lines of three"),
    "stray-matrix-text": (write_stray_scanner, written("camera_matrix.csv", "a,b,c\n" * 3), "finite numbers"),
    "stray-no-poses": (write_stray_scanner, written("odometry.csv", TITLES), "has no poses: it has no lines"),
    "stray-no-rotation": (write_stray_scanner, edited("odometry.csv", ", qw", ", w"), "lacks the column qw"),
    "stray-pose-nan": (write_stray_scanner, written("odometry.csv", TITLES + "1,0,nan,0,0,0,0,0,1\n"), "finite"),
    "stray-more-poses": (
        write_stray_scanner,
        written("odometry.csv", TITLES + "1,7,0,0,0,0,0,0,1\n"),
        "it has no frame 7",
    ),
    "stray-frame-negative": (write_stray_scanner, written("odometry.csv", TITLES + "1,-1,0,0,0,0,0,0,1\n"), "ascend"),
    "stray-frame-huge": (write_stray_scanner, written("odometry.csv", TITLES + "1,1e300,0,0,0,0,0,0,1\n"), "frame"),
    "stray-lines": (write_stray_scanner, written("odometry.csv", TITLES + "1\n" * 100_001), "too many lines"),
    "stray-line": (write_stray_scanner, written("odometry.csv", TITLES + "0," * 2049), "line 2 has 4,098 characters"),
    "stray-quote": (write_stray_scanner, written("odometry.csv", f'"{TITLES}1,0\n'), "lacks the column timestamp"),
    "stray-link": (write_stray_scanner, linked("depth/000001.png"), "names depth/000001.png: a file must lie in the"),
    "stray-no-depth": (write_stray_scanner, removed("depth/000001.png"), "there is no x/depth/000001.png"),
    "stray-depth-8-bits": (
        write_stray_scanner,
        written("depth/000000.png", png(np.ones((8, 8), np.uint8))),
        "8 bits per pixel",
    ),
    "stray-confidence-size": (
        write_stray_scanner,
        written("confidence/000000.png", png(np.ones((8, 8), np.uint8))),
        "has another size",
    ),
    "stray-depth-huge": (write_stray_scanner, written("depth/000000.png", huge_png()), "too many pixels"),
    "tum-no-depth": (write_tum, removed("depth.txt"), "lacks depth.txt"),
    "tum-no-photos": (write_tum, removed("rgb.txt"), "lacks rgb.txt"),
    "tum-empty": (write_tum, written("depth.txt", "# nothing\n"), "has no lines"),
    "tum-other-times": (write_tum, written("groundtruth.txt", "5 0 0 0 0 0 0 1\n"), "no photo has depth and a pose"),
    "tum-pose-short": (write_tum, written("groundtruth.txt", "5 0 0 0\n"), "8 words were expected"),
    "tum-pose-text": (write_tum, written("groundtruth.txt", "100.0 a b c d e f g\n"), "finite numbers"),
    "tum-time-text": (write_tum, written("rgb.txt", "now rgb/a.png\n"), "finite numbers"),
    "tum-lines": (write_tum, written("rgb.txt", "1 a\n" * ((1 << 19) + 1)), "rgb.txt has too many lines"),
    "tum-escape": (write_tum, written("rgb.txt", "100.0 ../../etc/passwd\n"), "must lie in the folder"),
    "tum-absolute": (write_tum, written("rgb.txt", "100.0 /etc/passwd\n"), "must lie in the folder"),
    "tum-no-file": (write_tum, written("rgb.txt", "100.0 rgb/nothing.png\n"), "no picture x/rgb/nothing.png"),
    "transforms-no-depth": (write_transforms, transforms(depth_file_path=None), "has no depth"),
    "transforms-no-pose": (write_transforms, transforms(transform_matrix=None), "has no pose"),
    "transforms-pose-text": (write_transforms, transforms(transform_matrix="identity"), "has no pose"),
    "transforms-mirrored": (
        write_transforms,
        transforms(transform_matrix=np.diag([-1.0, 1, 1, 1]).tolist()),
        "right-handed",
    ),
    "transforms-no-lens": (write_transforms, transforms(fl_x=None), "fl_x must be a number"),
    "transforms-lens-text": (write_transforms, transforms(cx="middle"), "cx must be a number"),
    "transforms-no-frames": (write_transforms, transforms(frames=[]), "has no frames"),
    "transforms-fisheye": (write_transforms, transforms(camera_model="OPENCV_FISHEYE"), "OPENCV_FISHEYE"),
    "transforms-escape": (write_transforms, transforms(file_path="../x.png"), "must lie in the folder"),
    "transforms-number": (write_transforms, transforms(file_path=7), "lacks file_path"),
    "transforms-size-zero": (write_transforms, transforms(w=0), "w and h must be"),
    "transforms-text": (write_transforms, written("transforms.json", "{"), "is not JSON"),
    "transforms-link": (write_transforms, linked("images/frame_00000.png"), "must lie in the folder"),
    "transforms-circle": (
        write_transforms,
        linked("images/frame_00000.png", "frame_00000.png"),
        "frame 0 names images/frame_00000.png: a file must lie in the folder",
    ),
    "transforms-array": (
        write_transforms,
        lambda folder: (
            np.save(folder / "a.npy", np.zeros((5000, 8000), np.int8)) or transforms(depth_file_path="a.npy")(folder)
        ),
        "a.npy has too many pixels: an array may have 33,554,432",
    ),
}


@pytest.mark.parametrize("name", FOLDERS)
def test_folders(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write, change, says = FOLDERS[name]
    folder = write(tmp_path, recording()).rename(tmp_path / "x")
    change(folder)
    one(tmp_path, says, monkeypatch, "x")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ("--frames 7-9", "there is none from 7 to 9"),
        ("--frames 3-1", "is not a range of frames"),
        ("--frames 3", "is not a range of frames"),
        ("--every 0", "0 is not in the range"),
        ("--up 0,0,0", "is not a direction"),
        ("--up 1,2", "is not a direction"),
        ("--up nan,0,1", "is not a direction"),
    ],
)
def test_options(options: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_transforms(tmp_path, recording())
    one(tmp_path, says, monkeypatch, "nerfstudio", options)


def test_outputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_transforms(tmp_path, recording())
    (tmp_path / "file").write_text("kept")
    run(Case("capture nerfstudio --output file", "is a file"), tmp_path, monkeypatch)
    run(Case("capture nerfstudio --output nerfstudio", "is not empty"), tmp_path, monkeypatch)
    run(Case("capture nerfstudio --output file/out", "cannot make the folder"), tmp_path, monkeypatch)


def test_photos_of_other_sizes_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The lens is in pixels of the size that the metadata give."""
    large = np.repeat(np.repeat(recording().photo, 2, axis=0), 2, axis=1)
    changed = {**members(), "rgbd/0.jpg": jpeg(large)}
    first, second = Record3D(write_zip(tmp_path / "x.r3d", changed)).frames([0, 1])
    assert first.lens.fx == pytest.approx(2 * second.lens.fx) and first.lens.cy == pytest.approx(2 * second.lens.cy)
