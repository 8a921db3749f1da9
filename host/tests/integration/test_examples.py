"""The cocotb bench of ``examples/`` as a user runs it: its frames are the model's, loaded through the bus or not.

The bench in C++ is run by ``docs/start/soc.md``.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from colonnade.design import toolchain
from colonnade.design.generator import GeneratedDesign, shell_design_for
from colonnade.device.simulator_build import build_environment

EXAMPLES = toolchain.project_root() / "examples"
OVERRIDE = "array.columns=2"


@pytest.fixture(scope="module")
def design() -> GeneratedDesign:
    return shell_design_for("tiny", (OVERRIDE,), bus_bytes=16)


@pytest.fixture(scope="module")
def output(design: GeneratedDesign, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the examples, with the design that is in the cache."""
    folder = tmp_path_factory.mktemp("examples")
    shutil.copytree(design.dir, folder / "design")
    return folder


@pytest.mark.skipif(shutil.which("iverilog") is None, reason="no iverilog: apt-get install iverilog")
def test_the_frame_of_an_example_is_that_of_the_model(output: Path) -> None:
    settings = {"OUT": output, "CONFIG": f"tiny --set {OVERRIDE}", "MESH": "sphere:0", "SIZE": "16x8"}
    command = ["make", "-C", EXAMPLES, "cocotb", *(f"{name}={value}" for name, value in settings.items())]
    for backdoor in ("", "1"):
        arguments = [*command, f"BACKDOOR={backdoor}"]
        done = subprocess.run(arguments, capture_output=True, text=True, env=build_environment())
        assert done.returncode == 0, done.stdout + done.stderr
        assert ("load: " in done.stdout) is not bool(backdoor)
        assert "0 of 128 pixels differ from model.png" in done.stdout


def test_cocotb_refuses_an_old_verilator(tmp_path: Path) -> None:
    (tmp_path / "verilator").write_text("#!/bin/sh\necho 'Verilator 5.006 2023-01-22 rev (Debian 5.006-3)'\n")
    (tmp_path / "verilator").chmod(0o755)
    command = [sys.executable, EXAMPLES / "cocotb" / "run.py", "verilator", *(["none"] * 4)]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PATH": str(tmp_path)})
    assert done.returncode == 1
    assert "cocotb needs Verilator 5.036 or newer" in done.stderr and "tools/verilator-environment" in done.stderr
