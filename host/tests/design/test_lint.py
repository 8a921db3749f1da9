"""The device as a whole is clean under Verilator's strictest lint, with the waivers of tools/lint.vlt.

`EmitSpec` checks the modules of arrays of other shapes, at any precision.
"""

from __future__ import annotations

import subprocess

import pytest

from colonnade.design.generator import design_for
from colonnade.design.toolchain import project_root


@pytest.mark.verilator
def test_verilog_is_clean() -> None:
    design = design_for("tiny")
    command = ["verilator", "--lint-only", "-Wall", str(project_root() / "tools" / "lint.vlt")]
    command += ["--top-module", "Colonnade", *map(str, sorted(design.dir.glob("*.sv")))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
