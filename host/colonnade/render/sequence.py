"""Several frames: the files they go to, and one report of them all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from colonnade.common.errors import UserError

#: What the frames of one path have in common.
_COMMON = ("backend", "config", "mesh", "size", "bytes")


def numbered(path: Path, frames: int) -> list[Path]:
    """A file for each frame: ``out.png`` becomes ``out_0000.png`` and so on."""
    digits = max(4, len(str(frames - 1)))
    return [path.with_name(f"{path.stem}_{frame:0{digits}d}{path.suffix}") for frame in range(frames)]


def picture_files(output: Path, frames: int) -> list[Path]:
    """Where the pictures of several frames go: numbered PNG files, or all into one WebP.

    Raises:
        UserError: The file can be neither.
    """
    if output.suffix.lower() == ".webp":
        return [output]
    if output.suffix.lower() != ".png":
        raise UserError(
            f"--frames cannot write {output}: name --output FILE.png for numbered files, or FILE.webp for one animation"
        )
    return numbered(output, frames)


def frames_report(reports: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The reports of several frames as one of the same form: sums, and under ``frames`` what each frame has."""
    first = reports[0]
    cycles = None if first["cycles"] is None else sum(report["cycles"] for report in reports)
    rays = {kind: sum(report["rays"].get(kind) or 0 for report in reports) for kind in first["rays"]}
    seconds = dict(first["seconds"]) | {"run": sum(report["seconds"]["run"] for report in reports)}
    everything = sum(count for kind, count in rays.items() if kind != "in_box")
    return {
        **{key: first[key] for key in _COMMON if key in first},
        "cycles": cycles,
        "rays": rays,
        "rays_per_cycle": everything / cycles if cycles else None,
        "rays_per_cycle_in_box": rays["in_box"] / cycles if cycles else None,
        "errors": [],
        "seconds": seconds,
        "frames": [{key: value for key, value in report.items() if key not in _COMMON} for report in reports],
    }
