"""File names of a sequence of frames."""

from __future__ import annotations

from pathlib import Path

from colonnade.common.errors import UserError


def numbered(path: Path, frames: int) -> list[Path]:
    """The numbered file of each frame: ``out.png`` becomes ``out_0000.png`` and so on."""
    digits = max(4, len(str(frames - 1)))
    return [path.with_name(f"{path.stem}_{frame:0{digits}d}{path.suffix}") for frame in range(frames)]


def picture_files(output: Path, frames: int) -> list[Path]:
    """The files of several frames: numbered PNG files, or one WebP animation.

    Raises:
        UserError: The name of the output ends with neither .png nor .webp.
    """
    if output.suffix.lower() == ".webp":
        return [output]
    if output.suffix.lower() != ".png":
        raise UserError(
            f"--frames cannot write {output}: use --output FILE.png for numbered files, or FILE.webp for an animation"
        )
    return numbered(output, frames)
