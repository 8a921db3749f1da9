"""LZFSE streams: what is decoded, and what is refused within limits."""

from __future__ import annotations

import resource
import struct

import lzfse
import numpy as np
import pytest
from capture_files import lzfse_bomb
from hypothesis import given, settings
from hypothesis import strategies as st

from colonnade.capture.lzfse_streams import decode_lzfse, longest
from colonnade.common.errors import UserError

CONTENT = np.arange(3000, dtype="<f4").tobytes()
STREAM = lzfse.compress(CONTENT)
END = b"bvx$"


def stored(content: bytes) -> bytes:
    """A block without compression."""
    return b"bvx-" + struct.pack("<I", len(content)) + content


@settings(max_examples=5)
@given(st.integers(1, 1 << 18), st.booleans())
def test_streams_are_decoded_in_their_order_and_none_is_longer_than_the_longest(size: int, is_noise: bool) -> None:
    content = np.random.default_rng(size).bytes(size) if is_noise else bytes(size)
    streams = [(name, lzfse.compress(data), len(data)) for name, data in (("a", CONTENT), ("b", content), ("c", b"1"))]
    assert decode_lzfse(streams, "x") == [CONTENT, content, b"1"]
    assert len(streams[1][1]) <= longest(size)


def test_blocks_that_are_not_compressed_are_read() -> None:
    assert decode_lzfse([("a", stored(CONTENT[:8]) + stored(CONTENT[8:]) + END, len(CONTENT))], "x") == [CONTENT]


@pytest.mark.parametrize(
    "stream",
    [
        STREAM + bytes(64),
        STREAM + b"ab",
        STREAM + END,
        STREAM + STREAM,
        STREAM + bytes(64) + END,
        STREAM[:-4],
        STREAM[:-5] + END,
        b"",
        END,
    ],
    ids=["zeros", "letters", "end", "twice", "zeros-and-end", "no-end", "torn", "empty", "only-end"],
)
def test_a_stream_is_whole_and_has_no_bytes_after_its_end(stream: bytes) -> None:
    with pytest.raises(UserError, match=r"b in x is damaged: its LZFSE data do not have the 12,000 bytes"):
        decode_lzfse([("a", STREAM, len(CONTENT)), ("b", stream, len(CONTENT)), ("c", STREAM, len(CONTENT))], "x")


def test_a_bomb_takes_little_memory() -> None:
    with pytest.raises(UserError, match="bomb in x is damaged"):
        decode_lzfse([("bomb", lzfse_bomb(4000, 12288), 12288)], "x")
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss < 1 << 20  # KiB
