"""Arrays in numpy's formats, from files that may come from anywhere: no objects, and no sizes beyond the bytes."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from colonnade.common.limits import MAX_PIXELS

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Of an array's header.
_MAX_HEADER = 4096
#: Of an element.
_MAX_BYTES = 16


def array_in(data: bytes) -> NDArray[Any]:
    """The array of numbers in the bytes of a ``.npy`` file.

    Raises:
        ValueError: They hold anything else; the message says what.
    """
    import numpy as np

    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        if version not in ((1, 0), (2, 0)):
            raise ValueError("its version of the format is not known")
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read_header(stream, max_header_size=_MAX_HEADER)
    except ValueError:
        raise
    except Exception as error:  # whatever the parser of the header makes of noise
        raise ValueError(f"its header cannot be read ({type(error).__name__})") from None
    if dtype.hasobject or dtype.kind not in "iuf":
        raise ValueError("it must hold an array of numbers")
    if math.prod(shape) * dtype.itemsize != len(data) - stream.tell():
        raise ValueError(f"it has not the bytes of its shape {shape}")
    if math.prod(shape) == 0:
        raise ValueError("it is empty")
    stream.seek(0)
    array: NDArray[Any] = np.load(stream, allow_pickle=False)
    return array


def arrays_in(data: bytes, names: Sequence[str]) -> list[NDArray[Any]]:
    """The named arrays of the bytes of a ``.npz`` file.

    Raises:
        ValueError: There are no such arrays.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            found = [_member(archive, f"{name}.npy") for name in names]
    except ValueError:
        raise
    except Exception as error:  # a broken or encrypted archive ends in many ways
        raise ValueError(f"{type(error).__name__}: {error}") from None
    return [array_in(member) for member in found]


def _member(archive: zipfile.ZipFile, name: str) -> bytes:
    """Unpacked; no more than the largest picture may take, whatever the archive says."""
    maximum = MAX_PIXELS * _MAX_BYTES
    too_large = ValueError(f"{name} is too large")
    if archive.getinfo(name).file_size > maximum:
        raise too_large
    with archive.open(name) as stream:
        content = stream.read(maximum + 1)
    if len(content) > maximum:
        raise too_large
    return content
