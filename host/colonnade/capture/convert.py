"""Converts a capture to a folder: ``sequence.toml``, photo and depth of each frame, and the first frame as a room."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from colonnade.capture.level import Levelling, level
from colonnade.capture.picture import fitted, quarter_turns, turned
from colonnade.capture.record3d import Record3D
from colonnade.capture.source import Frame, Source
from colonnade.capture.stray_scanner import StrayScanner
from colonnade.capture.transforms_json import TransformsJson
from colonnade.capture.tum import TumRgbd
from colonnade.common.errors import UserError
from colonnade.common.image_io import encode_srgb
from colonnade.common.input_files import exists, is_folder
from colonnade.common.limits import MAX_FRAMES
from colonnade.common.progress import QUIET, Progress
from colonnade.common.types import Bytes, Floats
from colonnade.environment.camera import read_camera
from colonnade.environment.depth_normals import depth_noise
from colonnade.environment.load import load_environment
from colonnade.environment.repair import MAX_HOLES, filled, holes_of
from colonnade.environment.sequence import load_sequence

#: Size of the maps.
WIDTH, HEIGHT = 640, 480
#: Metres of a step of depth pictures, and the depth that they reach; farther depth is a hole.
DEPTH_STEP = 0.0005
MAX_DEPTH = 32.0
#: Digits of a time after the point, and seconds from a frame to the next on average, at most.
_TIME_DIGITS, _LARGEST_GAP = 6, 1000.0
#: Frames that tell the floor.
_LEVELLING = 6
#: The folder of the first frame, a room.
ROOM = "0000"


@dataclass(frozen=True)
class Conversion:
    """What was written.

    Attributes:
        format: Of the capture.
        frames: Number of frames.
        seconds: Between the first and the last.
        size: Of the maps.
        depth_noise: Error of the depth on flat surfaces, as a share of it.
        notes: What was assumed, left out, or made up, one line each.
    """

    format: str
    frames: int
    seconds: float
    size: tuple[int, int]
    depth_noise: float
    notes: tuple[str, ...]


def source_of(path: Path) -> Source:
    """The reader of a capture, by what it holds."""
    if is_folder(path):
        for name, reader in (
            ("odometry.csv", StrayScanner),
            ("groundtruth.txt", TumRgbd),
            ("transforms.json", TransformsJson),
        ):
            if exists(path / name):
                found: Source = reader(path)
                return found
        raise UserError(
            f"{path} is no capture: it has no odometry.csv (Stray Scanner), groundtruth.txt (TUM RGB-D) or"
            " transforms.json (nerfstudio), which hold the poses"
        )
    if not exists(path):
        raise UserError(f"there is no capture {path}: name an .r3d file or a folder")
    return Record3D(path)


def convert(
    path: Path,
    output: Path,
    every: int = 1,
    only: tuple[int, int] | None = None,
    up: Floats | None = None,
    progress: Progress = QUIET,
) -> Conversion:
    """Convert a capture into an empty folder.

    Args:
        path: A file or folder of a format of `source_of`.
        output: The folder.
        every: Of so many frames one is taken.
        only: First and last frame that is taken; None: all.
        up: What points up in the capture's world; None: the format's vertical, or the floor's.
        progress: Shows the work.

    Raises:
        UserError: The capture lacks what a sequence needs, or is damaged.
    """
    source = source_of(path)
    outline = source.outline
    first, last = only or (0, outline.count - 1)
    numbers = list(range(first, min(last, outline.count - 1) + 1, every))
    if not numbers:
        raise UserError(f"{path} has {outline.count:,} frames, numbered from 0: there is none from {first} to {last}")
    if len(numbers) > MAX_FRAMES:
        raise UserError(f"{len(numbers):,} frames are too many, {MAX_FRAMES:,} are possible: give --every or --frames")
    with progress.step("finding the floor"):
        samples = numbers[:: max(1, len(numbers) // _LEVELLING)][:_LEVELLING]
        levelling = level(source.frames(samples), up if up is not None else outline.up, str(path))
    tables: list[str] = []
    times: list[float] = []
    left_out = []
    noises: list[float] = []
    turns: int | None = None
    start: float | None = None
    with progress.step("converting frames") as report:
        # Not enumerated: one whole frame at a time is in memory
        for frame in source.frames(numbers):
            frame, turns = _level_and_upright(frame, levelling, turns)
            frame = fitted(frame, WIDTH, HEIGHT)
            report((frame.number - first + 1) / (numbers[-1] - first + 1))
            steps = np.where(frame.depth <= MAX_DEPTH, np.rint(frame.depth / DEPTH_STEP), 0).astype(np.uint16)
            if (steps == 0).mean() > MAX_HOLES:
                left_out.append(frame.number)
                continue
            start = frame.time if start is None else start
            time = round(frame.time - start, _TIME_DIGITS)
            if times and time <= times[-1]:
                raise UserError(
                    f"{path}: the time of frame {frame.number} is not a microsecond or more after the frame before:"
                    " give ascending times in seconds"
                )
            camera = {**asdict(frame.lens), "cam_to_world": frame.to_world.tolist()}
            read_camera(camera, Path(f"{path}, frame {frame.number}"))
            name = f"{len(times):04d}"
            if not times:
                (output / ROOM).mkdir()
                _write_room(output / ROOM, frame.photo, steps, camera)
            Image.fromarray(frame.photo).save(output / f"{name}.png")
            Image.fromarray(steps).save(output / f"{name}.depth.png")
            if len(noises) < _LEVELLING:
                noises.append(_noise(steps))
            times.append(time)
            tables.append(_table(name, time, camera))
    if not times:
        raise UserError(
            f"{path}: no frame has certain depth in half of its pixels, as a room needs: come nearer to the surfaces"
        )
    seconds, gaps = times[-1], max(len(times) - 1, 1)
    if seconds / gaps > _LARGEST_GAP:
        raise UserError(
            f"{path}: its frames are {seconds / gaps:.3g} s apart, {_LARGEST_GAP:g} s at most: give times in seconds"
        )
    rate = gaps / seconds if seconds > 0 else 30.0
    noise = float(np.median(noises))
    head = f"width = {WIDTH}\nheight = {HEIGHT}\nrate = {rate:.3f}\n"
    head += f"depth_step = {DEPTH_STEP}\ndepth_noise = {noise:.5f}\n"
    (output / "sequence.toml").write_text(head + "".join(tables), encoding="utf-8")
    try:
        load_sequence(output / "sequence.toml")
    except UserError as error:
        raise UserError(f"{path} gives no sequence that can be read: {error}") from None
    with progress.step("deriving normals and albedo"):
        room = load_environment(output / ROOM)
        Image.fromarray(np.rint((room.normals * 0.5 + 0.5) * 255).astype(np.uint8)).save(output / ROOM / "normal.png")
        Image.fromarray(encode_srgb(room.albedo)).save(output / ROOM / "albedo.png")
    notes = [*outline.notes, levelling.note]
    if turns:
        notes.append(f"frames were turned by {90 * turns}° counter-clockwise, so that up is up in the picture")
    if left_out:
        notes.append(
            f"{len(left_out)} of {len(numbers)} frames were left out: less than half of their depth is certain"
        )
    if room.notes:
        notes.append(f"room {ROOM}: {'; '.join(room.notes)}")
    return Conversion(outline.format, len(times), seconds, (WIDTH, HEIGHT), noise, tuple(notes))


def _level_and_upright(frame: Frame, levelling: Levelling, turns: int | None) -> tuple[Frame, int]:
    frame = replace(frame, to_world=levelling.applied(frame.to_world))
    turns = quarter_turns(frame.to_world) if turns is None else turns
    return turned(frame, turns), turns


def _noise(steps: NDArray[np.uint16]) -> float:
    holes = holes_of(steps.astype(np.float64))
    return depth_noise(filled(steps.astype(np.float64), holes), holes)


def _write_room(folder: Path, photo: Bytes, steps: NDArray[np.uint16], camera: dict[str, Any]) -> None:
    Image.fromarray(photo).save(folder / "photo.png")
    Image.fromarray(steps).save(folder / "depth.png")
    meta = {
        "width": WIDTH,
        "height": HEIGHT,
        **camera,
        "cam_to_world": [*camera["cam_to_world"], [0.0, 0.0, 0.0, 1.0]],
        "albedo_encoding": "srgb",
        "depth_step": DEPTH_STEP,
    }
    (folder / "meta.json").write_text(json.dumps(meta, indent=1) + "\n", encoding="utf-8")


def _table(name: str, time: float, camera: dict[str, Any]) -> str:
    rows = (f"[{', '.join(f'{value:.9f}' for value in row)}]" for row in camera["cam_to_world"])
    return (
        f'\n[[frame]]\ntime = {time:.{_TIME_DIGITS}f}\nphoto = "{name}.png"\ndepth = "{name}.depth.png"\n'
        + "".join(f"{key} = {camera[key]:.6f}\n" for key in ("fx", "fy", "cx", "cy"))
        + f"cam_to_world = [{', '.join(rows)}]\n"
    )
