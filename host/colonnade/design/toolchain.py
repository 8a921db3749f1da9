"""Locates the checkout, the cache folder, Java and other programs, with advice if one is missing."""

from __future__ import annotations

import os
import re
import shutil
import sys
from pathlib import Path

from colonnade.common import processes
from colonnade.common.errors import UserError

#: The oldest Java version that Chisel supports.
MINIMUM_JAVA = 17


def project_root() -> Path:
    """Find the checkout, which contains the hardware sources and the generator.

    The search order is ``COLONNADE_HOME``, the parent folder of the ``.venv`` in use, the folders above this
    file, the working directory and the folders above it.
    """
    named = os.environ.get("COLONNADE_HOME")
    if named:
        home = Path(named)
        if _is_checkout(home):
            return home.resolve()
        raise UserError(f"COLONNADE_HOME={named} is not a checkout of Colonnade: it lacks build.sbt or tools/sbt")
    here = Path(__file__).resolve()
    for candidate in (Path(sys.prefix).parent, *here.parents, Path.cwd(), *Path.cwd().parents):
        if _is_checkout(candidate):
            return candidate.resolve()
    raise UserError("no checkout of Colonnade found: run this inside one, or set COLONNADE_HOME to it")


def _is_checkout(folder: Path) -> bool:
    return (folder / "build.sbt").is_file() and (folder / "tools" / "sbt").is_file()


def cache_directory(root: Path) -> Path:
    """The cache folder: ``.cache`` of the checkout, or the user's cache folder if the checkout is read-only."""
    local = root / ".cache"
    if os.access(local if local.exists() else root, os.W_OK):
        return local
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "colonnade"


def find_java() -> Path:
    """Find ``java`` for the generator in ``JAVA_HOME`` or on ``PATH``, version `MINIMUM_JAVA` or newer."""
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
        raise UserError(f"{java} cannot be run ({error.strerror}): fix JAVA_HOME or PATH") from error
    match = re.search(r'version "(\d+)', answer.stderr + answer.stdout)
    return int(match.group(1)) if match else None


def require_program(name: str, purpose: str, package: str | None = None) -> Path:
    """Find a program on ``PATH``; the error names the Debian package to install.

    Args:
        name: the program.
        purpose: completes "which … needs", e.g. ``"the rtl backend"``.
        package: the Debian package; by default the program's name.
    """
    found = shutil.which(name)
    if found is None:
        raise UserError(f"no {name} found, which {purpose} needs: sudo apt-get install {package or name}")
    return Path(found)
