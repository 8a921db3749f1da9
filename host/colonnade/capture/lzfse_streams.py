"""Decodes LZFSE streams in a process of its own, as `colonnade.mesh.draco` does with Draco.

The decoder is C, and a stream of a few bytes may ask for any memory. The process has limits of memory and time, and
returns no stream that is longer than expected. The module is also its program.
"""

from __future__ import annotations

import struct
import subprocess
import sys
from collections.abc import Sequence

from colonnade.common.errors import UserError
from colonnade.common.machine_limits import limit_this_process

#: Memory of the process beside its libraries and its input, bytes, and bytes more for each byte of the longest output.
_MEMORY, _MEMORY_OF_A_BYTE = 1 << 26, 4
#: Its processor time, seconds, and streams for one more.
_SECONDS, _STREAMS_OF_A_SECOND = 5, 20

#: Exit status of the process if a stream is damaged or too long.
_DAMAGED = 3


def decode_lzfse(streams: Sequence[tuple[str, bytes, int]], where: str) -> list[bytes]:
    """Decode streams, all in one process.

    Args:
        streams: Name, content, and the bytes that it must have decoded.
        where: The archive, for messages.

    Raises:
        UserError: A stream is damaged, has another length, or asks for more than the limits.
    """
    size = sum(len(data) for _, data, _ in streams)
    memory = _MEMORY + 2 * size + _MEMORY_OF_A_BYTE * max((length for *_, length in streams), default=0)
    memory += sum(length for *_, length in streams)
    seconds = _SECONDS + len(streams) // _STREAMS_OF_A_SECOND
    done = subprocess.run(
        [sys.executable, "-I", "-m", "colonnade.capture.lzfse_streams", str(memory), str(seconds)],
        input=b"".join(struct.pack("<QQ", len(data), length) + data for _, data, length in streams),
        capture_output=True,
        check=False,
    )
    if done.returncode == _DAMAGED:
        name, _, length = streams[min(len(done.stdout), len(streams) - 1)]
        raise UserError(f"{name} in {where} is damaged: its LZFSE data do not have the {length:,} bytes of the picture")
    if done.returncode < 0:
        raise UserError(f"the LZFSE data in {where} take more than {memory >> 20:,} MiB or {seconds} s to decode")
    if done.returncode != 0:
        reason = (done.stderr.decode("utf-8", "replace").splitlines() or ["no reason given"])[-1]
        raise UserError(f"the decoder for LZFSE does not start: {reason}: pip install 'colonnade[capture]'")
    found, at = [], 0
    for *_, length in streams:
        found.append(done.stdout[at : at + length])
        at += length
    return found


def _main() -> None:
    """Decode the streams of standard input, each after its length and that of its content, to standard output.

    If a stream is refused, the output is as many bytes as streams before it.
    """
    import lzfse

    memory, seconds = map(int, sys.argv[1:])
    data = sys.stdin.buffer.read()
    limit_this_process(memory, seconds)
    found: list[bytes] = []
    at = 0
    while at < len(data):
        size, length = struct.unpack_from("<QQ", data, at)
        stream = data[at + 16 : at + 16 + size]
        try:
            # The first block holds its length, by which the decoder asks for memory
            declared = struct.unpack_from("<I", stream, 4)[0]
            content = lzfse.decompress(stream) if declared <= length else b""
        except Exception:  # of the decoder, and MemoryError
            content = b""
        if len(content) != length:
            sys.stdout.buffer.write(bytes(len(found)))
            sys.stdout.flush()
            sys.exit(_DAMAGED)
        found.append(content)
        at += 16 + size
    sys.stdout.buffer.write(b"".join(found))


if __name__ == "__main__":
    _main()
