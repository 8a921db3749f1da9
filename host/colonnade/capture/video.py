"""Reads single frames of a video, through the ffmpeg program of the package imageio-ffmpeg."""

from __future__ import annotations

import io
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from colonnade.common import ledger, processes
from colonnade.common.errors import UserError
from colonnade.common.types import Bytes

#: Bytes of a line of a picture's title.
_MAX_LINE = 64
#: Pixels of a frame: some more than of 4K, as the decoder keeps some dozen frames.
_MAX_PIXELS = 4096 * 2304


def frames_of_video(path: Path, places: Sequence[int]) -> Iterator[Bytes]:
    """Decode the frames at some places of an MP4 file, uint8 [height, width, 3] each, as they are stored.

    Args:
        path: The file.
        places: Ascending numbers of frames, from 0.

    Raises:
        UserError: The file is no video, or has too few frames.
    """
    import imageio_ffmpeg

    ledger.add_input(path, path.stat())
    # Only this file is opened, as this format; the numbers of the frames are in no shell
    command = [
        imageio_ffmpeg.get_ffmpeg_exe(), "-nostdin", "-v", "error", "-threads", "1", "-noautorotate",
        "-max_pixels", _MAX_PIXELS, "-protocol_whitelist", "file", "-f", "mov", "-i", f"file:{path.absolute()}",
        "-map", "0:v:0", "-vf", f"select={_selected(places)}", "-fps_mode", "passthrough", "-frames:v", len(places),
        "-f", "image2pipe", "-c:v", "ppm", "-",
    ]  # fmt: skip
    with (
        tempfile.TemporaryFile("w+", errors="replace") as errors,
        processes.started(command, stdout=subprocess.PIPE, stderr=errors) as program,
    ):
        assert isinstance(program.stdout, io.TextIOWrapper)
        for place in places:
            photo = _picture(program.stdout.buffer)
            if photo is None:
                program.wait()
                errors.seek(0)
                reason = (errors.read(4096).splitlines() or [f"it has no frame {place}"])[0]
                raise UserError(f"cannot read the video {path}: {reason}")
            yield photo


def _selected(places: Sequence[int]) -> str:
    """The filter's expression for places: an arithmetic sequence in short, others one by one."""
    steps = set(np.diff(places).tolist())
    if len(steps) <= 1:
        step = steps.pop() if steps else 1
        return rf"between(n\,{places[0]}\,{places[-1]})*not(mod(n-{places[0]}\,{step}))"
    return "+".join(rf"eq(n\,{place})" for place in places)


def _picture(stream: BinaryIO) -> Bytes | None:
    """The next picture of a stream in the format PPM; None at its end."""
    if stream.readline(_MAX_LINE) != b"P6\n":
        return None
    width, height = map(int, stream.readline(_MAX_LINE).split())
    stream.readline(_MAX_LINE)
    data = stream.read(width * height * 3)
    if len(data) < width * height * 3:
        return None
    return np.frombuffer(data, np.uint8).reshape(height, width, 3)
