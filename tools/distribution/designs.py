"""Writes the designs of the presets: Verilog, with and without the AXI4 shell, their registers, and the driver in C."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import archives

ROOT = Path(__file__).resolve().parents[2]
#: Bytes of the shell's bus.
_BUS = "16"


def write(preset: str, jar: Path, work: Path, archive: Path, time: int) -> None:
    """Generate a preset and pack it as ``colonnade-PRESET/``: ``device``, ``shell``, ``registers`` and ``driver``."""
    folder = work / preset
    generator = ["java", "-Xss16m", "-jar", str(jar), "--config", preset, "--output"]
    _run([*generator, str(folder / "device")])
    _run([*generator, str(folder / "shell"), "--axi", _BUS])
    colonnade = ROOT / ".venv" / "bin" / "colonnade"
    _run([str(colonnade), "registers", "--config", preset, "--output", str(folder / "registers")])
    for part in ("include", "src"):
        shutil.copytree(ROOT / "driver" / part, folder / "driver" / part)
    shutil.copy(ROOT / "LICENSE", folder)
    archives.write_tar(folder, f"colonnade-{preset}", archive, time)


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"colonnade: error: {' '.join(command)} failed:\n{done.stdout}{done.stderr}")
