"""Generates project/dependencies.sha256: the SHA-256 of all artifacts that sbt resolves, and of sbt itself."""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HASHES = ROOT / "project" / "dependencies.sha256"

# Together these commands resolve all artifacts: both class paths, compiler and bridge, plugins, and scalafmt.
_COMMANDS = ["update", "compilers", "scalafmtSbtCheck"]


@dataclass(frozen=True, order=True)
class Artifact:
    """A file of a Maven repository."""

    organization: str
    name: str
    version: str
    file: str
    sha256: str

    @property
    def line(self) -> str:
        """The artifact's line in the committed file."""
        return f"{self.sha256}  {self.organization}:{self.name}:{self.version}:{self.file}"


def read(text: str) -> list[Artifact]:
    """The artifacts of the committed file's text."""
    artifacts = set()
    for line in text.splitlines():
        found = re.fullmatch(r"([0-9a-f]{64})  ([^:]+):([^:]+):([^:]+):([^:]+)", line)
        if found is None:
            raise ValueError(f"{HASHES.name} has a malformed line: {line!r}")
        artifacts.add(Artifact(found[2], found[3], found[4], found[5], found[1]))
    return sorted(artifacts)


def write() -> None:
    """Resolve all artifacts with sbt and write the committed file."""
    with tempfile.TemporaryDirectory() as folder:
        notes = Path(folder) / "resolved"
        environment = {**os.environ, "COLONNADE_LOCK": str(notes)}
        environment.pop("COLONNADE_SBT", None)
        done = subprocess.run([ROOT / "tools" / "sbt", *_COMMANDS], cwd=ROOT, env=environment, check=False)
        if done.returncode != 0:
            sys.exit(2)
        resolved = read(notes.read_text(encoding="utf-8"))
    artifacts = {*resolved, *_sbt_itself({artifact.sha256 for artifact in resolved})}
    HASHES.write_text("".join(f"{artifact.line}\n" for artifact in sorted(artifacts)), encoding="utf-8")


def _sbt_itself(known: set[str]) -> list[Artifact]:
    """The artifacts of sbt itself, with their coordinates from Coursier's cache."""
    boots = list((ROOT / ".cache").glob("sbt-boot-*/scala-*"))
    if len(boots) != 1:
        sys.exit(f"colonnade: error: {len(boots)} versions of sbt in .cache; remove .cache/sbt-boot-* and try again")
    artifacts = []
    for jar in sorted(boots[0].rglob("*.jar")):
        sha256 = hashlib.sha256(jar.read_bytes()).hexdigest()
        if sha256 in known:
            continue
        known.add(sha256)
        cached = next((path for path in coursier_cache().rglob(jar.name) if _sha256_of(path) == sha256), None)
        if cached is None:  # artifacts of the compiler, which lack a version, are known by now
            sys.exit(f"colonnade: error: {jar} is not in Coursier's cache; remove .cache/sbt-boot-* and try again")
        *organization, name, version, file = _inside_repository(cached).parts
        artifacts.append(Artifact(".".join(organization), name, version, file, sha256))
    return artifacts


def _sha256_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _inside_repository(cached: Path) -> Path:
    """The path ``org/…/file.jar`` of a cached file, without the protocol, the host and the repository."""
    parts = cached.relative_to(coursier_cache()).parts
    return Path(*parts[3:])


def coursier_cache() -> Path:
    """The folder of Coursier's download cache."""
    named = os.environ.get("COURSIER_CACHE")
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path("~").expanduser() / ".cache")
    return Path(named) if named else base / "coursier" / "v1"
