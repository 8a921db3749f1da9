"""Decodes LZFSE streams in a process of its own, one after the other; no stream may be longer than expected.

The module is also its program.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Sequence
from itertools import accumulate, pairwise

from colonnade.common.decoder_process import DAMAGED, decode
from colonnade.common.errors import UserError
from colonnade.common.machine_limits import limit_this_process

#: Memory of the process beside its libraries, bytes, and bytes more for each byte of the longest output.
_MEMORY, _MEMORY_OF_A_BYTE = 1 << 26, 8
#: Its processor time, seconds, and streams for one more.
_SECONDS, _STREAMS_OF_A_SECOND = 60, 20
#: The last block of a stream.
_END = b"bvx$"


def longest(length: int) -> int:
    """Bytes of the longest stream of so many bytes; what cannot be compressed is stored in blocks, with their heads."""
    return length * 9 // 8 + 4096


def decode_lzfse(streams: Sequence[tuple[str, bytes, int]], where: str) -> list[bytes]:
    """Decode streams, all in one process.

    Args:
        streams: Name, content, and the bytes that it must have decoded.
        where: The archive, for messages.

    Raises:
        UserError: A stream is damaged, has another length, has bytes after its end, or asks for more than the limits.
    """
    ends = [0, *accumulate(length for *_, length in streams)]
    memory = _MEMORY + _MEMORY_OF_A_BYTE * max((length for *_, length in streams), default=0)
    seconds = _SECONDS + len(streams) // _STREAMS_OF_A_SECOND
    data = b"".join(struct.pack("<QQ", len(stream), length) + stream for _, stream, length in streams)
    done = decode("colonnade.capture.lzfse_streams", memory, seconds, data=data)
    if done.returncode == DAMAGED:
        name, _, length = streams[ends.index(len(done.stdout))]
        raise UserError(f"{name} in {where} is damaged: its LZFSE data do not have the {length:,} bytes of the picture")
    if done.returncode < 0:
        raise UserError(f"the LZFSE data in {where} take more than {memory >> 20:,} MiB or {seconds} s to decode")
    return [done.stdout[first:end] for first, end in pairwise(ends)]


def _main() -> None:
    """Decode the streams of standard input, each after its length and its content's, to standard output.

    The output of streams before one that is refused is whole.
    """
    limit_this_process(*map(int, sys.argv[1:]))
    while head := sys.stdin.buffer.read(16):
        size, length = struct.unpack("<QQ", head)
        content = _content(sys.stdin.buffer.read(size), length)
        if content is None:
            sys.exit(DAMAGED)
        sys.stdout.buffer.write(content)


def _content(stream: bytes, length: int) -> bytes | None:
    """The content of a stream; None if it is damaged or has another length."""
    import lzfse

    try:
        # The first block holds its length, by which the decoder asks for memory
        if not stream.endswith(_END) or struct.unpack_from("<I", stream, 4)[0] > length:
            return None
        content: bytes = lzfse.decompress(stream)
    except Exception:  # of the decoder, and MemoryError
        return None
    try:
        # The decoder ignores what is after the first end: without the last one the stream must be torn
        lzfse.decompress(stream[: -len(_END)])
    except lzfse.error:
        return content if len(content) == length else None
    return None


if __name__ == "__main__":
    _main()
