"""Writes the designs of the presets: Verilog, with and without the AXI4 shell, their registers, and the driver in C."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import archives

ROOT = Path(__file__).resolve().parents[2]


#: Runs a command, `generate` or `registers`, with arguments.
Run = Callable[..., None]


def write(preset: str, run: Run, work: Path, archive: Path, time: int) -> None:
    """Generate a preset and pack it as ``colonnade-PRESET/``: ``device``, ``shell``, ``registers`` and ``driver``."""
    folder = work / preset
    run("generate", "--config", preset, "--output", str(folder / "device"))
    run("generate", "--config", preset, "--output", str(folder / "shell"), "--axi", "auto")
    run("registers", "--config", preset, "--output", str(folder / "registers"))
    for part in ("include", "src"):
        shutil.copytree(ROOT / "driver" / part, folder / "driver" / part)
    shutil.copy(ROOT / "LICENSE", folder)
    archives.write_tar(folder, f"colonnade-{preset}", archive, time)


def by_jar(jar: Path) -> Run:
    """The generator of a jar, and the installed host."""
    programs = {
        "generate": ["java", "-Xss16m", "-jar", str(jar)],
        "registers": [str(ROOT / ".venv" / "bin" / "colonnade"), "registers"],
    }
    return lambda command, *arguments: _run([*programs[command], *arguments])


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"colonnade: error: {' '.join(command)} failed:\n{done.stdout}{done.stderr}")
