"""Runs Yosys, by its Python package."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from colonnade.common import processes
from colonnade.common.errors import UserError
from colonnade.design.toolchain import project_root

_RUN = """
import sys
from pyosys import libyosys
design = libyosys.Design()
for line in open(sys.argv[1]):
    libyosys.run_pass(line.strip(), design)
"""


def require_yosys() -> None:
    """Raise a `UserError` if this interpreter has no Yosys, whose version is part of what it makes."""
    if importlib.util.find_spec("pyosys") is None:
        raise UserError("colonnade ppa needs Yosys: run tools/environment ppa, which installs pyosys")


def abc_program() -> Path:
    """The program abc of the package."""
    return next(_python().parents[1].glob("lib/python*/site-packages/pyosys/yosys-abc"))


def _python() -> Path:
    """The interpreter that has Yosys: this one, or the one of `tools/environment proof`."""
    if importlib.util.find_spec("pyosys") is not None:
        return Path(sys.executable)
    apart = project_root() / ".cache" / "proof-environment" / "bin" / "python"
    if not apart.exists():
        raise UserError("Yosys is not installed: run tools/environment proof")
    return apart


def run_yosys(script: list[str], folder: Path, log: Path, links: Mapping[str, Path] | None = None) -> None:
    """Run Yosys commands.

    Args:
        script: The commands.
        folder: Working folder.
        log: File for the output of Yosys.
        links: Input files by the name that the commands use.

    Raises:
        RuntimeError: Yosys fails.
    """
    for name, file in (links or {}).items():
        (folder / name).symlink_to(file.resolve())
    (folder / "script.ys").write_text("\n".join(script) + "\n")
    with log.open("w") as stream:
        command = [_python(), "-c", _RUN, "script.ys"]
        # Yosys shares converted libraries below TMPDIR between processes
        environment = os.environ | {"TMPDIR": str(folder)}
        done = processes.run(command, cwd=folder, env=environment, stdout=stream, stderr=subprocess.STDOUT)
    if done.returncode != 0:
        errors = [line for line in log.read_text(errors="replace").splitlines() if "ERROR" in line or "error:" in line]
        raise RuntimeError(f"Yosys failed: {(errors or ['no error message'])[0]} (see {log})")
