"""Jobs: measurements with a key made of their inputs, and the cache of their results.

The cache entry of a result is ``explore/KIND-KEY``.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import inspect
import json
import pickle
import shutil
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from colonnade.common import cache, processes
from colonnade.common.errors import UserError
from colonnade.common.temporary import temporary_folder
from colonnade.design.generator import source_hash
from colonnade.design.toolchain import cache_directory, project_root

from colonnade_lab.explore import work
from colonnade_lab.explore.result import Content


@dataclass(frozen=True)
class Kind:
    """A kind of jobs.

    Attributes:
        name: Its name, as of its function in `colonnade_lab.explore.work`.
        packages: Folders of the host's packages whose sources, beside the function's, determine the result.
        needs: Resources of a worker: programs by their names, and ``memory`` in MB.
        uses_generator: The hardware's sources determine the result.
        uses_model: The compiled sources do: the tree builder's and the model's.
    """

    name: str
    packages: tuple[str, ...]
    needs: Mapping[str, int]
    uses_generator: bool = False
    uses_model: bool = False


_SCENE = tuple(f"colonnade.{name}" for name in ("mesh", "scene", "environment", "scene_image", "registers"))

#: All kinds by name.
KINDS = {
    kind.name: kind
    for kind in (
        Kind("reference", (*_SCENE, "colonnade.reference", "colonnade.render"), {"memory": 1000}),
        Kind(
            "picture", (*_SCENE, "colonnade.device", "colonnade.render"), {"memory": 1000, "java": 1}, uses_model=True
        ),
        Kind("comparison", ("colonnade.quality",), {"memory": 1000}),
        Kind(
            "cycles",
            (*_SCENE, "colonnade.device", "colonnade.render", "colonnade_lab.evaluation"),
            {"memory": 3000, "java": 1, "verilator": 1},
            uses_generator=True,
            uses_model=True,
        ),
        Kind(
            "counted",
            (*_SCENE, "colonnade.device", "colonnade_lab.evaluation"),
            {"memory": 1000, "java": 1},
            uses_model=True,
        ),
        Kind("area", ("colonnade_lab.ppa",), {"memory": 2000, "java": 1, "yosys": 1}, uses_generator=True),
        Kind(
            "power",
            (*_SCENE, "colonnade.device", "colonnade_lab.ppa"),
            {"memory": 3000, "java": 1, "yosys": 1, "verilator": 1},
            uses_generator=True,
            uses_model=True,
        ),
    )
}


@dataclass(frozen=True)
class Job:
    """One measurement.

    Attributes:
        kind: Its kind.
        title: Its title in progress and failures.
        identity: What determines the result, besides the kind's sources and the results of `inputs`.
        arguments: Arguments of its function; anything that pickle stores.
        inputs: Keys of the jobs whose results it reads.
        after: Keys of jobs that fill a cache for it; they end first.
    """

    kind: Kind
    title: str
    identity: Mapping[str, Any]
    arguments: Mapping[str, Any] = field(repr=False)
    inputs: tuple[str, ...] = ()
    after: tuple[str, ...] = ()

    @functools.cached_property
    def key(self) -> str:
        """The name of its cache entry."""
        parts: dict[str, Any] = {
            "identity": self.identity,
            "inputs": list(self.inputs),
            "function": inspect.getsource(getattr(work, self.kind.name)),
            "packages": {package: package_digest(package) for package in self.kind.packages},
        }
        if self.kind.uses_generator:
            parts["generator"] = source_hash(project_root())
        if self.kind.uses_model:
            parts["model"] = _model_digest()
        digest = hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()
        return f"{self.kind.name}-{digest[:24]}"


class JobFailed(Exception):
    """A job failed; the message is one line."""


@functools.cache
def package_digest(package: str) -> str:
    """SHA-256 of the sources of a package of the host or the laboratory."""
    digest = hashlib.sha256()
    with resources.as_file(resources.files(package)) as folder:
        for path in sorted(folder.rglob("*")):
            if path.is_file() and path.suffix != ".pyc":
                content = path.read_bytes()
                digest.update(f"{path.relative_to(folder).as_posix()} {len(content)}\n".encode() + content)
    return digest.hexdigest()


@functools.cache
def _model_digest() -> str:
    folder = project_root() / "host" / "cpp"
    digest = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        digest.update(path.relative_to(folder).as_posix().encode() + b"\n" + path.read_bytes())
    return digest.hexdigest()


def entry_of(job: Job) -> Path:
    """The cache entry of a job's result."""
    return cache_directory(project_root()) / "explore" / job.key


def cached(job: Job) -> Path | None:
    """The intact result of a job; None if there is none."""
    folder = entry_of(job)
    return folder if (folder / cache.CONTENTS).is_file() and cache.is_intact(folder) else None


def forget(job: Job) -> None:
    """Drop the result of a job, so that it is made anew."""
    with contextlib.suppress(FileNotFoundError):
        shutil.rmtree(entry_of(job))


def content_of(folder: Path) -> dict[str, bytes]:
    """The files of a result, for another machine."""
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.name != cache.CONTENTS}


def keep(job: Job, content: Content) -> Path:
    """Store a result that another machine made; returns its cache entry."""
    entry = entry_of(job)
    with cache.entry(entry, f"result of {job.title}") as empty:
        if empty is not None:
            for name, data in content.items():
                (empty / Path(name).name).write_bytes(data)
    return entry


def run(job: Job, inputs: tuple[Content, ...]) -> dict[str, bytes]:
    """Run a job in a process of its own, unless its result is cached here; returns the result's files.

    Args:
        job: The job.
        inputs: The results of ``job.inputs``.

    Raises:
        JobFailed: The job failed.
    """
    entry = entry_of(job)
    try:
        with cache.entry(entry, f"result of {job.title}") as empty:
            if empty is not None:
                _measure(job, inputs, empty)
        return content_of(entry)
    except UserError as error:
        raise JobFailed(str(error)) from None


def _measure(job: Job, inputs: tuple[Content, ...], folder: Path) -> None:
    with temporary_folder() as work:
        (work / "job").write_bytes(pickle.dumps((job.kind.name, dict(job.arguments), inputs)))
        command = [sys.executable, "-m", "colonnade_lab.explore.worker", work / "job", folder]
        done = processes.run(command, cwd=work)
    if done.returncode != 0:
        lines = [line for line in done.stderr.splitlines() if line.strip()] or [f"status {done.returncode}"]
        raise JobFailed(lines[-1].removeprefix("colonnade: error: ").strip())
