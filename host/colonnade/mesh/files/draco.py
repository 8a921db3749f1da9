"""Decodes Draco streams in a process of its own, with limits in proportion to the streams; also its program."""

from __future__ import annotations

import io
import struct
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common.decoder_process import DAMAGED, decode
from colonnade.common.errors import UserError
from colonnade.common.machine_limits import limit_this_process

#: Memory of the process beside its libraries, bytes, more for each byte of the streams, and the most. A vertex with a
#: normal, a texture coordinate and a colour takes 120 bytes, of 4 to 20 in the stream.
_MEMORY, _MEMORY_OF_A_BYTE, _MOST_MEMORY = 1 << 29, 500, 1 << 33
#: Its processor time, seconds, and bytes of the streams for one more. It decodes 30 MB in a second.
_SECONDS, _BYTES_OF_A_SECOND = 60, 1 << 20


@dataclass(frozen=True)
class DracoMesh:
    """The content of a stream.

    Attributes:
        faces: Triangles, uint32 [m, 3].
        attributes: The attributes of the vertices by their unique id, [n, components]: float32; uint8 and uint32 if
            the stream has unsigned integers.
    """

    faces: npt.NDArray[np.uint32]
    attributes: Mapping[int, npt.NDArray[Any]]


def decode_draco(streams: Sequence[bytes]) -> list[DracoMesh]:
    """The meshes of Draco streams, all of one process.

    Raises:
        UserError: A stream is damaged, holds no triangles, or asks for more than the limits.
    """
    size = sum(map(len, streams))
    memory = min(_MEMORY + _MEMORY_OF_A_BYTE * size, _MOST_MEMORY)
    seconds = _SECONDS + size // _BYTES_OF_A_SECOND
    data = b"".join(struct.pack("<Q", len(stream)) + stream for stream in streams)
    done = decode("colonnade.mesh.files.draco", memory, seconds, data=data)
    if done.returncode != 0:
        raise UserError(
            f"its Draco data are damaged, or take more than {memory >> 20:,} MiB or {seconds} s to decode:"
            " export it without compression"
        )
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as arrays:
        found: list[dict[str, npt.NDArray[Any]]] = [{} for _ in streams]
        for name in arrays.files:
            number, key = name.split()
            found[int(number)][key] = arrays[name]
    return [DracoMesh(each.pop("faces"), {int(key): values for key, values in each.items()}) for each in found]


def _main() -> None:
    """Decode the streams of standard input, each after its length, to an NPZ file on standard output."""
    import DracoPy

    memory, seconds = map(int, sys.argv[1:])
    data = sys.stdin.buffer.read()
    limit_this_process(memory, seconds)
    try:
        arrays: dict[str, npt.NDArray[Any]] = {}
        at = number = 0
        while at < len(data):
            (size,) = struct.unpack_from("<Q", data, at)
            mesh = DracoPy.decode(data[at + 8 : at + 8 + size])
            arrays[f"{number} faces"] = mesh.faces
            for attribute in mesh.attributes:
                if attribute["data"] is not None:
                    arrays[f"{number} {attribute['unique_id']}"] = attribute["data"]
            at, number = at + 8 + size, number + 1
        np.savez(sys.stdout.buffer, **arrays)  # type: ignore[arg-type]
    except Exception:  # of many types, and MemoryError
        sys.exit(DAMAGED)


if __name__ == "__main__":
    _main()
