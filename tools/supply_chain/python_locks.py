"""Generates host/locks from pyproject.toml of host and laboratory, and checks offline that the locks are up to date.

A lock lists all packages that pip may install, with their version for each Python and the SHA-256 of their files.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]
PROJECT = ROOT / "host" / "pyproject.toml"
LABORATORY = ROOT / "lab" / "pyproject.toml"
LOCKS = ROOT / "host" / "locks"
REMADE_BY = "run: tools/lock"

_MARK = "# dependencies-sha256: "


@dataclass(frozen=True)
class Lock:
    """One file of host/locks and the requirements that it resolves."""

    name: str
    requirements: tuple[str, ...]
    requires_python: str

    @property
    def path(self) -> Path:
        """The file of the lock."""
        return LOCKS / f"{self.name}.txt"

    @property
    def digest(self) -> str:
        """The digest of the tables of pyproject.toml that determine the lock."""
        text = json.dumps([self.requires_python, sorted(self.requirements)])
        return hashlib.sha256(text.encode()).hexdigest()


def project_tables() -> dict[str, Any]:
    """The content of host/pyproject.toml."""
    return tomllib.loads(PROJECT.read_text(encoding="utf-8"))


def wanted_locks() -> list[Lock]:
    """The locks: build requirements, `make render`, all of .venv, extras apart, `yosys`, `ppa`, each further group."""
    data = project_tables()
    laboratory = tomllib.loads(LABORATORY.read_text(encoding="utf-8"))["project"]
    tools = {
        extra: [one for one in requirements if not one.startswith(laboratory["name"])]
        for extra, requirements in laboratory["optional-dependencies"].items()
    }
    project = data["project"]
    extras: dict[str, list[str]] = dict(project.get("optional-dependencies", {}))
    # A checkout has a JDK, and no test needs 88 MB of Open Image Denoise
    apart = {name: extras.pop(name) for name in ("java", "denoise")}
    groups: dict[str, list[str]] = dict(data.get("dependency-groups", {}))
    build = [*data["build-system"]["requires"], *groups.pop("build", [])]
    # The laboratory also depends on the host itself
    measures = [one for one in laboratory["dependencies"] if not one.startswith(project["name"])]
    host = [*project["dependencies"], *itertools.chain(*extras.values()), *measures]
    tables = {
        "build": build,
        "render": project["dependencies"],
        "host": host,
        **apart,
        **tools,
        **groups,
    }
    return [Lock(name, tuple(table), project["requires-python"]) for name, table in tables.items()]


def write(uv: str, upgrade: bool) -> None:
    """Regenerate all locks with ``uv``. Versions change only with ``upgrade`` or by pyproject.toml."""
    LOCKS.mkdir(exist_ok=True)
    locks = wanted_locks()
    for lock in locks:
        _compile(uv, lock, upgrade)
    for stale in set(LOCKS.glob("*.txt")) - {lock.path for lock in locks}:
        stale.unlink()


def _compile(uv: str, lock: Lock, upgrade: bool) -> None:
    oldest = re.sub(r"[^0-9.]", "", lock.requires_python)
    command = [uv, "pip", "compile", "--quiet", "--universal", "--python-version", oldest, "--generate-hashes"]
    command += ["--no-python-downloads", "--no-header", "--no-annotate", "--no-emit-index-url"]
    with tempfile.TemporaryDirectory() as folder:
        requirements, result = Path(folder) / "requirements.in", Path(folder) / "lock.txt"
        requirements.write_text("\n".join(lock.requirements) + "\n", encoding="utf-8")
        if lock.path.is_file() and not upgrade:
            result.write_text(lock.path.read_text(encoding="utf-8"), encoding="utf-8")
        # Locks of the same .venv share their versions.
        for earlier in ("build", "render", "host"):
            if earlier == lock.name:
                break
            command += ["--constraints", str(LOCKS / f"{earlier}.txt")]
        command += ["--output-file", str(result), str(requirements)]
        done = subprocess.run(command, cwd=ROOT / "host", check=False)
        if done.returncode != 0:
            sys.exit(2)
        text = result.read_text(encoding="utf-8")
    header = f"# Made by tools/lock from host/pyproject.toml. Do not edit.\n{_MARK}{lock.digest}\n"
    lock.path.write_text(header + text, encoding="utf-8")


def check() -> list[str]:
    """The errors of the locks, one line each; needs no network."""
    locks = wanted_locks()
    faults = [fault for lock in locks for fault in _faults(lock)]
    for stale in sorted(set(LOCKS.glob("*.txt")) - {lock.path for lock in locks}):
        faults.append(f"host/locks/{stale.name} has no table in pyproject.toml; {REMADE_BY}")
    return faults


def _faults(lock: Lock) -> list[str]:
    name = f"host/locks/{lock.path.name}"
    if not lock.path.is_file():
        return [f"{name} is missing; {REMADE_BY}"]
    text = lock.path.read_text(encoding="utf-8")
    if _MARK + lock.digest not in text.splitlines():
        return [f"{name} is older than the dependencies in pyproject.toml; {REMADE_BY}"]
    faults = [f"{name}: {pin.name} {pin.version} has no hash; {REMADE_BY}" for pin in read(text) if not pin.hashes]
    if "://" in text:
        faults.append(f"{name} contains a URL; {REMADE_BY}")
    return faults


@dataclass(frozen=True)
class Pin:
    """A package of a lock: its version if ``marker`` is true, and the SHA-256 of the files that pip accepts."""

    name: str
    version: str
    marker: str
    hashes: tuple[str, ...]


def read(text: str) -> list[Pin]:
    """Parse the packages of a lock."""
    pins = []
    for entry in re.sub(r"\\\n", " ", text).splitlines():
        found = re.match(r"([A-Za-z0-9._-]+)==([^ ;]+)(?: ; (.*?))?(?=\s+--hash|\s*$)", entry)
        if found:
            hashes = tuple(re.findall(r"--hash=sha256:([0-9a-f]{64})", entry))
            pins.append(Pin(found[1], found[2], (found[3] or "").strip(), hashes))
    return pins
