"""The program that makes the bitstream of the board's SoC, as far as it needs neither Yosys nor nextpnr."""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

PROGRAM = Path(__file__).resolve().parents[3] / "soc" / "litex" / "bitstream.py"


def test_the_clock_with_the_least_margin_counts() -> None:
    clock = runpy.run_path(str(PROGRAM))["clock"]
    sys_clock = {"achieved": 48.0, "constraint": 50.0}
    report = {"fmax": {"oscillator": {"achieved": 30.0, "constraint": 25.0}, "sys": sys_clock}}
    assert clock(report) == sys_clock


def test_missing_arguments_give_the_usage() -> None:
    done = subprocess.run([sys.executable, PROGRAM, "out"], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "Usage: bitstream.py" in done.stderr
