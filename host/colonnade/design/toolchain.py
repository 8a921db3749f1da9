"""Where the programs and the sources are that the host runs, and what to say when one is missing."""

from __future__ import annotations

import os
import re
import shutil
import sys
from pathlib import Path

from colonnade.common import processes
from colonnade.common.errors import UserError

#: The oldest Java that Chisel's compiler runs on.
MINIMUM_JAVA = 17


def project_root() -> Path:
    """Find the checkout: the hardware's sources and the generator are not part of the Python package.

    Looked for in this order: ``COLONNADE_HOME``, the folder that holds the ``.venv`` in use, the folders above this
    file, the working directory and those above it.
    """
    named = os.environ.get("COLONNADE_HOME")
    if named:
        home = Path(named)
        if _is_checkout(home):
            return home.resolve()
        raise UserError(f"COLONNADE_HOME={named} is no checkout of Colonnade: it holds no build.sbt and tools/sbt")
    here = Path(__file__).resolve()
    for candidate in (Path(sys.prefix).parent, *here.parents, Path.cwd(), *Path.cwd().parents):
        if _is_checkout(candidate):
            return candidate.resolve()
    raise UserError("no checkout of Colonnade found: run this inside one, or set COLONNADE_HOME to it")


def _is_checkout(folder: Path) -> bool:
    return (folder / "build.sbt").is_file() and (folder / "tools" / "sbt").is_file()


def cache_directory(root: Path) -> Path:
    """The folder for what can be made again: ``.cache`` of the checkout, or the user's where that is read-only."""
    local = root / ".cache"
    if os.access(local if local.exists() else root, os.W_OK):
        return local
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "colonnade"


def find_java() -> Path:
    """The ``java`` to run the generator with: of ``JAVA_HOME``, or on ``PATH``; 17 or newer."""
    advice = f"install a JDK {MINIMUM_JAVA} or newer, e.g. sudo apt-get install openjdk-{MINIMUM_JAVA}-jdk-headless"
    home = os.environ.get("JAVA_HOME")
    in_home = Path(home) / "bin" / "java" if home else None
    found = str(in_home) if in_home and in_home.is_file() else shutil.which("java")
    if found is None:
        raise UserError(f"no Java found, which the generator needs: {advice}")
    version = _java_version(found)
    if version is not None and version < MINIMUM_JAVA:
        raise UserError(f"{found} is Java {version}, too old for the generator: {advice}")
    return Path(found)


def _java_version(java: str) -> int | None:
    try:
        command = [java, "-version"]
        answer = processes.run(command)
    except OSError as error:
        raise UserError(f"{java} cannot be run ({error.strerror}): mend JAVA_HOME or PATH") from error
    match = re.search(r'version "(\d+)', answer.stderr + answer.stdout)
    return int(match.group(1)) if match else None


def require_program(name: str, purpose: str, package: str | None = None) -> Path:
    """Find ``name`` on ``PATH``, or say which package holds it.

    Args:
        name: the program.
        purpose: completes "which … needs", e.g. ``"the rtl backend"``.
        package: the Debian package; the program's name unless given.
    """
    found = shutil.which(name)
    if found is None:
        raise UserError(f"no {name} found, which {purpose} needs: sudo apt-get install {package or name}")
    return Path(found)
