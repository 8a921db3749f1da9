"""Writes captures to the layout of each format, from a room whose depth and cameras are known.

A `Recording` has one picture and one depth map; its cameras stand on one floor and differ in place and direction about
the vertical. Its world may be turned.
"""

from __future__ import annotations

import io
import json
import struct
import subprocess
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage
from scipy.spatial.transform import Rotation

from colonnade.environment.load import load_environment
from colonnade.environment.model import Environment

Floats = NDArray[np.float64]
ROOMS = Path(__file__).resolve().parents[2] / "scenes" / "rooms"
OPENGL = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class Recording:
    """A recording.

    Attributes:
        photo: uint8 [h, w, 3].
        depth: Metres, float64 [h, w].
        lens: fx, fy, cx, cy of the photo; its first pixel's centre is at (0.5, 0.5).
        poses: View space to world, float64 [4, 4] each.
        confidence: uint8 of the size of depth, or None: 2 everywhere.
    """

    photo: NDArray[np.uint8]
    depth: Floats
    lens: tuple[float, float, float, float]
    poses: list[Floats]
    confidence: NDArray[np.uint8] | None = None

    @property
    def times(self) -> list[float]:
        return [100.0 + number / 30 for number in range(len(self.poses))]

    def confident(self) -> NDArray[np.uint8]:
        return np.full(self.depth.shape, 2, np.uint8) if self.confidence is None else self.confidence

    def turned_world(self, rotation: Floats) -> Recording:
        """In a world that is turned and shifted."""
        turn = np.eye(4)
        turn[:3, :3] = rotation
        turn[:3, 3] = 0.4, 0.9, -0.7
        return replace(self, poses=[turn @ pose for pose in self.poses])


def room_recording(name: str = "living", frames: int = 2) -> Recording:
    """The recording of a room of the repository: each camera 3 cm further and 2 degrees to the side."""
    return recording_of(load_environment(ROOMS / name), frames)


def recording_of(room: Environment, frames: int) -> Recording:
    first = np.vstack([room.camera_to_world, [0, 0, 0, 1]])
    poses = []
    for number in range(frames):
        move = np.eye(4)
        move[:3, :3] = Rotation.from_euler("y", 2.0 * number, degrees=True).as_matrix()
        move[:3, 3] = [0.03 * number, 0.0, -0.01 * number]
        poses.append(move @ first)
    assert room.photo is not None
    return Recording(room.photo, room.depth, (room.fx, room.fy, room.cx, room.cy), poses)


def phone(recording: Recording, noise: float = 0.0, seed: int = 1) -> Recording:
    """With depth as a phone's sensor gives it: 256x192, and correlated noise, a share of the depth."""
    rows, columns = recording.depth.shape
    grid = np.ix_(
        ((np.arange(192) + 0.5) * rows / 192).astype(int), ((np.arange(256) + 0.5) * columns / 256).astype(int)
    )
    error = ndimage.gaussian_filter(np.random.default_rng(seed).standard_normal((192, 256)), 1.0)
    return replace(recording, depth=recording.depth[grid] * (1.0 + noise * error / error.std()))


def png(samples: NDArray[Any]) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(samples).save(buffer, format="PNG", compress_level=1)
    return buffer.getvalue()


def jpeg(samples: NDArray[np.uint8]) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(samples).save(buffer, format="JPEG", quality=95)
    return buffer.getvalue()


def record3d_members(recording: Recording) -> dict[str, bytes]:
    """The members of an .r3d file."""
    import lzfse

    fx, fy, cx, cy = recording.lens
    rows, columns = recording.depth.shape
    poses = []
    for pose in recording.poses:
        turn = Rotation.from_matrix(pose[:3, :3] @ OPENGL)
        poses.append([*turn.as_quat().tolist(), *pose[:3, 3].tolist()])
    meta = {
        "w": recording.photo.shape[1],
        "h": recording.photo.shape[0],
        "dw": columns,
        "dh": rows,
        "fps": 30,
        "K": [fx, 0, 0, 0, fy, 0, cx, cy, 1],
        "poses": poses,
        "frameTimestamps": recording.times,
        "initPose": [0, 0, 0, 1, 0, 0, 0],
    }
    members = {"metadata": json.dumps(meta).encode(), "icon": jpeg(recording.photo[:48, :64])}
    for number in range(len(poses)):
        members[f"rgbd/{number}.jpg"] = jpeg(recording.photo)
        members[f"rgbd/{number}.depth"] = lzfse.compress(recording.depth.astype("<f4").tobytes())
        members[f"rgbd/{number}.conf"] = lzfse.compress(recording.confident().tobytes())
    return members


def lzfse_bomb(mebibytes: int, claimed: int) -> bytes:
    """A stream of zeros whose blocks of a mebibyte claim to have at most some bytes."""
    import lzfse

    block = bytearray(lzfse.compress(bytes(1 << 20))[:-4])
    struct.pack_into("<I", block, 4, min(claimed, 1 << 20))
    return bytes(block) * mebibytes + b"bvx$"


def write_zip(path: Path, members: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def write_record3d(folder: Path, recording: Recording) -> Path:
    return write_zip(folder / "capture.r3d", record3d_members(recording))


def write_stray_scanner(folder: Path, recording: Recording) -> Path:
    import imageio_ffmpeg

    target = folder / "stray"
    for name in ("depth", "confidence"):
        (target / name).mkdir(parents=True)
    fx, fy, cx, cy = recording.lens
    (target / "camera_matrix.csv").write_text(f"{fx}, 0.0, {cx}\n0.0, {fy}, {cy}\n0.0, 0.0, 1.0\n")
    lines = ["timestamp, frame, x, y, z, qx, qy, qz, qw"]
    for number, (time, pose) in enumerate(zip(recording.times, recording.poses, strict=True)):
        values = [*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat()]
        lines.append(", ".join([f"{time:.6f}", f"{number:06d}", *(f"{value:.9f}" for value in values)]))
        depth = np.rint(recording.depth * 1000).astype(np.uint16)
        (target / "depth" / f"{number:06d}.png").write_bytes(png(depth))
        (target / "confidence" / f"{number:06d}.png").write_bytes(png(recording.confident()))
    (target / "odometry.csv").write_text("\n".join(lines) + "\n")
    height, width = recording.photo.shape[:2]
    command = [
        imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
        "-s", f"{width}x{height}", "-r", "30", "-i", "-", "-c:v", "libx265", "-x265-params", "crf=12:log-level=none",
        "-tag:v", "hvc1", "-pix_fmt", "yuv420p", target / "rgb.mp4",
    ]  # fmt: skip
    subprocess.run(command, input=recording.photo.tobytes() * len(recording.poses), check=True)
    return target


def write_tum(folder: Path, recording: Recording) -> Path:
    """The lens of a TUM folder is its camera's: `TUM_LENS`."""
    target = folder / "rgbd_dataset"
    for name in ("rgb", "depth"):
        (target / name).mkdir(parents=True)
    lists: dict[str, list[str]] = {name: ["# made by a test"] for name in ("rgb", "depth", "groundtruth")}
    for time, pose in zip(recording.times, recording.poses, strict=True):
        (target / f"rgb/{time:.6f}.png").write_bytes(png(recording.photo))
        (target / f"depth/{time + 0.005:.6f}.png").write_bytes(png(np.rint(recording.depth * 5000).astype(np.uint16)))
        lists["rgb"].append(f"{time:.6f} rgb/{time:.6f}.png")
        lists["depth"].append(f"{time + 0.005:.6f} depth/{time + 0.005:.6f}.png")
        values = [*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat()]
        lists["groundtruth"].append(" ".join([f"{time + 0.002:.4f}", *(f"{value:.6f}" for value in values)]))
    for name, lines in lists.items():
        (target / f"{name}.txt").write_text("\n".join(lines) + "\n")
    return target


def write_transforms(folder: Path, recording: Recording) -> Path:
    target = folder / "nerfstudio"
    for name in ("images", "depths"):
        (target / name).mkdir(parents=True)
    fx, fy, cx, cy = recording.lens
    height, width = recording.photo.shape[:2]
    data: dict[str, Any] = {
        "camera_model": "OPENCV",
        "fl_x": fx,
        "fl_y": fy,
        "cx": cx,
        "cy": cy,
        "w": width,
        "h": height,
    }
    data["frames"] = []
    for number, pose in enumerate(recording.poses):
        matrix = pose.copy()
        matrix[:3, :3] = matrix[:3, :3] @ OPENGL
        names = f"images/frame_{number:05d}.png", f"depths/frame_{number:05d}.png"
        (target / names[0]).write_bytes(png(recording.photo))
        (target / names[1]).write_bytes(png(np.rint(recording.depth * 1000).astype(np.uint16)))
        data["frames"].append({"file_path": names[0], "depth_file_path": names[1], "transform_matrix": matrix.tolist()})
    (target / "transforms.json").write_text(json.dumps(data))
    return target


WRITERS = {
    "record3d": write_record3d,
    "stray": write_stray_scanner,
    "tum": write_tum,
    "transforms": write_transforms,
}
