"""Runs a decoder of untrusted data in a process of its own, with limits of memory and time.

A decoder in C may ask for any memory and time for a few bytes, or end its process. Its module is also its program: it
calls `colonnade.common.machine_limits.limit_this_process` with its first two arguments, and exits with `DAMAGED` if it
refuses the data.
"""

from __future__ import annotations

import os
import subprocess
import sys

from colonnade.common.errors import UserError

#: Exit status of a decoder that refuses its data.
DAMAGED = 3


def decode(
    module: str, memory: int, seconds: int, *arguments: object, data: bytes = b""
) -> subprocess.CompletedProcess[bytes]:
    """Run a decoder to its end: with status 0, `DAMAGED`, or the negative number of the signal that ended it.

    Args:
        module: Its module.
        memory: That it may take beside what its libraries take, bytes.
        seconds: Of processor time that it may take.
        arguments: More arguments.
        data: Its input.

    Raises:
        UserError: It does not start.
    """
    words = [sys.executable, "-I", "-m", module, memory, seconds, *arguments]
    # Memory of more threads of linear algebra would count
    own = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    done = subprocess.run(list(map(str, words)), input=data, capture_output=True, check=False, env=own)
    if done.returncode > 0 and done.returncode != DAMAGED:
        raise UserError(f"the decoder {module} does not start: {last_line(done.stderr)}: install Colonnade again")
    return done


def last_line(output: bytes) -> str:
    """The last line that a decoder printed, the reason for its end."""
    return (output.decode("utf-8", "replace").splitlines() or ["no reason given"])[-1]
