"""Renders frames of different scene images in one simulator run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from colonnade.common.framebuffer import Frame
from colonnade.common.temporary import temporary_folder
from colonnade.design.manifest import Manifest
from colonnade.device.harness_job import frame_commands, parse_output, read_frame
from colonnade.device.verilator import run_program
from colonnade.scene_image.file import SceneImage

from colonnade_lab.evaluation.fuzz.cases import Case
from colonnade_lab.evaluation.fuzz.dram import PAGE


@dataclass(frozen=True)
class SimulatedFrame:
    """A frame of the RTL, which may be incomplete.

    Attributes:
        frame: The frame; missing pixels are zero.
        missing: Number of missing pixels.
    """

    frame: Frame
    missing: int


def run_cases(
    program: Path, manifest: Manifest, cases: Sequence[Case], rows: int
) -> tuple[list[SimulatedFrame], str | None]:
    """Render cases in order.

    Args:
        program: The simulator.
        manifest: The manifest of its design.
        cases: The frames to render.
        rows: Records to write per load; shorter images are padded with zeros.

    Returns:
        The frames and None; or the frames before the one at which the harness failed, and its message.
    """
    with temporary_folder() as folder:
        job, pixel_files = _write_job(folder, manifest, cases, rows)
        failure = None
        try:
            run_program([str(program), job.name], folder, lambda share: None)
        except RuntimeError as error:
            failure = str(error)
        outputs = parse_output((folder / "results").read_text().splitlines())
        return [
            SimulatedFrame(*read_frame(manifest, case.registers, pixel_file, output))
            for case, pixel_file, output in zip(cases, pixel_files, outputs, strict=False)
        ], failure


def _write_job(folder: Path, manifest: Manifest, cases: Sequence[Case], rows: int) -> tuple[Path, list[Path]]:
    empty = folder / "empty"
    depth, record_bytes = int(manifest.memories["columnBvh"]["depth"]), manifest.record_bits // 8
    empty.write_bytes(bytes(depth * record_bytes))
    lines = [f"load {empty.name} {record_bytes} 0"]
    loaded: dict[str, object] = {}
    # Caches hold the records of the frame before
    invalidate = manifest.registers.get("control.invalidate")
    pixel_files: list[Path] = []
    for number, case in enumerate(cases):
        loads = _loads(folder, f"{number}", manifest, case.image, rows, loaded)
        page = case.registers.get(PAGE)
        if invalidate is not None and (loads or loaded.get(PAGE) != page):
            loads.append(f"write {invalidate.address} 1")
        loaded[PAGE] = page
        lines += loads
        pixel_files.append(folder / f"pixels{number}")
        lines += frame_commands(manifest, case.registers, pixel_files[-1].name)
    job = folder / "job"
    job.write_text("\n".join(lines) + "\n")
    return job, pixel_files


def _loads(
    folder: Path, name: str, manifest: Manifest, image: SceneImage, rows: int, loaded: dict[str, object]
) -> list[str]:
    """Load commands for the arrays of an image that are not in the memories yet. Updates `loaded`, which lists them."""
    lines = []
    if loaded.get("") is not image.records:
        loaded[""] = image.records
        records = folder / f"records{name}"
        record_bytes = image.records.shape[1]
        records.write_bytes(image.records.tobytes() + bytes((rows - len(image.records)) * record_bytes))
        lines.append(f"load {records.name} {record_bytes} 0")
    for section in image.attributes:
        if loaded.get(section.memory) is section.words:
            continue
        loaded[section.memory] = section.words
        words = folder / f"{section.memory}{name}"
        words.write_bytes(section.words.tobytes())
        lines.append(f"load {words.name} {section.words.shape[1]} {manifest.memories[section.memory]['target']}")
    return lines
