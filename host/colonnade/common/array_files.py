"""Reads ``.npy`` and ``.npz`` data from untrusted files: no pickled objects, no array larger than its data."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from colonnade.common.limits import MAX_PIXELS

if TYPE_CHECKING:
    from numpy.typing import NDArray

#: Bytes of an array's header, at most.
_MAX_HEADER = 4096
#: Bytes of an array element, at most.
_MAX_BYTES = 16


def parse_npy(data: bytes) -> NDArray[Any]:
    """Parse a ``.npy`` file: a numeric array of any shape, which shares its memory and cannot be written.

    Raises:
        ValueError: The data is not a numeric array; the message says why.
    """
    import numpy as np

    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        if version not in ((1, 0), (2, 0)):
            raise ValueError("the format version is unknown")
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, is_fortran, dtype = read_header(stream, max_header_size=_MAX_HEADER)
    except ValueError:
        raise
    except Exception as error:  # the header parser raises many types on invalid data
        raise ValueError(f"the header cannot be read ({type(error).__name__})") from None
    if dtype.hasobject or dtype.kind not in "iuf":
        raise ValueError("the array is not numeric")
    if math.prod(shape) * dtype.itemsize != len(data) - stream.tell():
        raise ValueError(f"the data size does not match the shape {shape}")
    if math.prod(shape) == 0:
        raise ValueError("the array is empty")
    return np.frombuffer(data, dtype, offset=stream.tell()).reshape(shape, order="F" if is_fortran else "C")


def parse_npz(data: bytes, names: Sequence[str]) -> list[NDArray[Any]]:
    """Parse the named arrays of a ``.npz`` file.

    Raises:
        ValueError: An array is missing or is not numeric.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            found = [_member(archive, f"{name}.npy") for name in names]
    except ValueError:
        raise
    except Exception as error:  # a corrupt or encrypted archive raises many types
        raise ValueError(f"{type(error).__name__}: {error}") from None
    return [parse_npy(member) for member in found]


def _member(archive: zipfile.ZipFile, name: str) -> bytes:
    """Unpack one member. The size limit is the largest image's, whatever the archive claims."""
    maximum = MAX_PIXELS * _MAX_BYTES
    too_large = ValueError(f"{name} is too large")
    if archive.getinfo(name).file_size > maximum:
        raise too_large
    with archive.open(name) as stream:
        content = stream.read(maximum + 1)
    if len(content) > maximum:
        raise too_large
    return content


def has_array(data: bytes, name: str) -> bool:
    """Whether a ``.npz`` file, which was parsed before, holds an array of that name."""
    return f"{name}.npy" in zipfile.ZipFile(io.BytesIO(data)).namelist()
