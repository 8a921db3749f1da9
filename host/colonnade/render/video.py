"""Writes frames as a video, through the ffmpeg program of the package imageio-ffmpeg."""

from __future__ import annotations

import contextlib
import io
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from colonnade.common import processes
from colonnade.common.atomic_files import replacing
from colonnade.common.errors import UserError
from colonnade.common.temporary import temporary_folder

#: Quality of H.264, 0 to 51; lower is better.
_QUALITY = 16
_FILE, _ERRORS = "video.mp4", "errors"


@contextlib.contextmanager
def video(path: Path, width: int, height: int, rate: float) -> Iterator[Callable[[NDArray[np.uint8]], None]]:
    """Write an MP4 video; yields a function that takes the next frame: sRGB, uint8 [height, width, 3].

    An odd width or height gets a black line more. The extra ``capture`` has the package.

    Raises:
        UserError: The program cannot write the video.
    """
    with temporary_folder() as folder:
        with (
            (folder / _ERRORS).open("w") as errors,
            processes.started(
                _command(width, height, rate), cwd=folder, stdin=subprocess.PIPE, stderr=errors
            ) as program,
        ):
            assert isinstance(program.stdin, io.TextIOWrapper)
            pixels = program.stdin.buffer

            def write(frame: NDArray[np.uint8]) -> None:
                with contextlib.suppress(BrokenPipeError):  # the status tells
                    pixels.write(np.ascontiguousarray(frame).data)

            yield write
            with contextlib.suppress(BrokenPipeError):
                program.stdin.close()
        if program.returncode != 0:
            lines = (folder / _ERRORS).read_text(errors="replace").splitlines()
            raise UserError(f"cannot write the video {path}: {(lines or [f'status {program.returncode}'])[0]}")
        with replacing(path) as stream, (folder / _FILE).open("rb") as written:
            shutil.copyfileobj(written, stream)


def _command(width: int, height: int, rate: float) -> list[object]:
    import imageio_ffmpeg

    return [
        imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24",
        "-s", f"{width}x{height}", "-r", f"{rate:g}", "-i", "pipe:0", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2",
        "-c:v", "libx264", "-crf", _QUALITY, "-pix_fmt", "yuv420p", "-movflags", "+faststart", _FILE,
    ]  # fmt: skip
