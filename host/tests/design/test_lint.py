"""The generated Verilog is clean under Verilator's strictest lint, with the waivers of tools/lint.vlt."""

from __future__ import annotations

import shutil
import subprocess

import pytest

from colonnade.design.generator import design_for
from colonnade.design.toolchain import project_root


@pytest.mark.skipif(shutil.which("verilator") is None, reason="Verilator is not installed")
@pytest.mark.parametrize("overrides", [(), ("geometry.bvh=false", "precision=17b19s23d")], ids=["tree", "odd"])
def test_verilog_is_clean(overrides: tuple[str, ...]) -> None:
    design = design_for("tiny", overrides)
    command = ["verilator", "--lint-only", "-Wall", str(project_root() / "tools" / "lint.vlt")]
    command += ["--top-module", "Colonnade", *map(str, sorted(design.dir.glob("*.sv")))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
