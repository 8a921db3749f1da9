"""Many frames of different images in one run of the simulator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from colonnade.common.framebuffer import Frame
from colonnade.common.temporary import temporary_folder
from colonnade.design.manifest import Manifest
from colonnade.device.verilator import PIXEL, run_program
from colonnade.evaluation.fuzz.cases import Case
from colonnade.scene_image.file import SceneImage


@dataclass(frozen=True)
class Delivered:
    """A frame of the hardware, whatever state it is in.

    Attributes:
        frame: Its pixels, those missing all zero.
        missing: Pixels that never came.
    """

    frame: Frame
    missing: int


def run_cases(
    program: Path, manifest: Manifest, cases: Sequence[Case], rows: int
) -> tuple[list[Delivered], str | None]:
    """Renders cases one after the other.

    Args:
        program: The simulator.
        manifest: Of its design.
        cases: With their registers.
        rows: Records to write at each load; shorter images are followed by zeros.

    Returns:
        The frames, and None; or those before the one at which the harness gave up, and what it said.
    """
    with temporary_folder() as place:
        job, outputs = _write_job(place, manifest, cases, rows)
        failure = None
        try:
            run_program([str(program), job.name], place, lambda share: None)
        except RuntimeError as error:
            failure = str(error)
        values = _values(place / "results")
        return [
            _delivered(manifest, case, output, value)
            for case, output, value in zip(cases, outputs, values, strict=False)
        ], failure


def _write_job(place: Path, manifest: Manifest, cases: Sequence[Case], rows: int) -> tuple[Path, list[Path]]:
    empty = place / "empty"
    depth, record_bytes = int(manifest.memories["columnBvh"]["depth"]), manifest.record_bits // 8
    empty.write_bytes(bytes(depth * record_bytes))
    lines = [f"load {empty.name} {record_bytes} 0"]
    readable = [register for register in manifest.registers.values() if register.access == "ro"]
    start = manifest.registers["control.start"].address
    loaded: dict[str, object] = {}
    outputs = []
    for number, case in enumerate(cases):
        lines += _loads(place, f"{number}", manifest, case.image, rows, loaded)
        for name, value in case.registers.items():
            lines += [f"write {address} {word}" for address, word in manifest.registers[name].encode(value)]
        outputs.append(place / f"pixels{number}")
        size = f"{case.registers['frame.width']} {case.registers['frame.height']}"
        lines.append(f"frame {outputs[-1].name} {size} {start} {case.registers['frame.watchdogCycles']}")
        lines += [f"read {register.name} {register.address} {register.words}" for register in readable]
    job = place / "job"
    job.write_text("\n".join(lines) + "\n")
    return job, outputs


def _loads(
    place: Path, name: str, manifest: Manifest, image: SceneImage, rows: int, loaded: dict[str, object]
) -> list[str]:
    """Loads of what the memories do not hold yet; `loaded` has the arrays that they hold."""
    lines = []
    if loaded.get("") is not image.records:
        loaded[""] = image.records
        records = place / f"records{name}"
        record_bytes = image.records.shape[1]
        records.write_bytes(image.records.tobytes() + bytes((rows - len(image.records)) * record_bytes))
        lines.append(f"load {records.name} {record_bytes} 0")
    for section in image.attributes:
        if loaded.get(section.memory) is section.words:
            continue
        loaded[section.memory] = section.words
        words = place / f"{section.memory}{name}"
        words.write_bytes(section.words.tobytes())
        lines.append(f"load {words.name} {section.words.shape[1]} {manifest.memories[section.memory]['target']}")
    return lines


def _values(results: Path) -> list[dict[str, int]]:
    """Registers read after each frame that was completed."""
    values: list[dict[str, int]] = []
    for line in results.read_text().splitlines():
        words = line.split()
        if words[0] == "simulated":
            values.append({})
        elif words[0] == "value":
            values[-1][words[1]] = int(words[2])
    return values


def _delivered(manifest: Manifest, case: Case, output: Path, values: dict[str, int]) -> Delivered:
    shape = case.registers["frame.height"], case.registers["frame.width"]
    pixels = np.fromfile(output, dtype=PIXEL).reshape(shape)
    is_object = pixels["is_object"] != 0
    frame = Frame(
        colour=np.ascontiguousarray(pixels["colour"]),
        is_object=is_object,
        triangle=np.where(is_object, pixels["triangle"].astype(np.int64), -1),
        distance=pixels["distance"] * 2.0 ** -manifest.numbers["gridFraction"],
        counters={name.removeprefix("counters."): n for name, n in values.items() if name.startswith("counters.")},
        errors=[name.removeprefix("errors.") for name, bit in values.items() if name.startswith("errors.") and bit],
        ratio=pixels["ratio"].copy() if case.registers.get("room.isThere", 0) else None,
    )
    return Delivered(frame, int((pixels["is_seen"] == 0).sum()))
