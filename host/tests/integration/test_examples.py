"""The cocotb benches of ``examples/`` as a user runs them: their frames and hits are the model's.

The bench in C++ is run by ``docs/start/soc.md``.
"""

from __future__ import annotations

import json
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
CACHE = {
    **{"lines": 8, "ways": 2, "misses": 4, "sharedLines": 16, "sharedWays": 2, "sharedMisses": 8},
    **{"busBytes": 16, "parity": False},
}


@pytest.fixture(scope="module")
def design() -> GeneratedDesign:
    return shell_design_for("tiny", (OVERRIDE,), bus_bytes=8)


@pytest.fixture(scope="module")
def output(design: GeneratedDesign, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the examples, with the design that is in the cache."""
    folder = tmp_path_factory.mktemp("examples")
    shutil.copytree(design.dir, folder / "design")
    return folder


#: Of a device for rays with two columns, whose ids and arbiters stand for any number.
COLUMNS = "tiny --set array.columns=2 --set queries={} --set units.rayInterval=1"
needs_icarus = pytest.mark.skipif(shutil.which("iverilog") is None, reason="no iverilog: apt-get install iverilog")


@pytest.fixture
def new_verilator(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that cocotb takes, on PATH."""
    program = EXAMPLES.parent / "tools" / "environment"
    folder = subprocess.run([program, "verilator"], check=True, capture_output=True, text=True).stdout.strip()
    monkeypatch.setenv("PATH", f"{folder}:{os.environ['PATH']}")


def run_example(output: Path, target: str = "cocotb", **settings: str) -> str:
    """What `make -C examples` prints for a target."""
    command = [
        "make",
        "-C",
        EXAMPLES,
        target,
        f"OUT={output}",
        *(f"{name}={value}" for name, value in settings.items()),
    ]
    done = subprocess.run(command, capture_output=True, text=True, env=build_environment())
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.matrix
@needs_icarus
def test_the_frame_of_an_example_is_that_of_the_model(output: Path) -> None:
    """Through the top with AXI4 ports, and by the backdoor; bytes behind the last pixel of a line are unknown.

    The first hits face away from the light: their colours were unknown as long as no other hit had a falloff.
    """
    settings = {"CONFIG": f"tiny --set {OVERRIDE}", "MESH": "sphere:1", "SIZE": "24x16"}
    for choice in ("AXI4", "BACKDOOR"):
        printed = run_example(output, **settings, **{choice: "1"})
        assert ("load: " in printed) is (choice == "AXI4")
        assert "0 of 384 pixels differ from model.png" in printed


@pytest.mark.matrix
@needs_icarus
@pytest.mark.parametrize("axi4", ["1", ""])
def test_the_hits_of_an_example_are_those_of_the_model(tmp_path: Path, axi4: str) -> None:
    """Behind the top with AXI4 ports, which holds the other one. A byte of the results that differs fails."""
    printed = run_example(tmp_path, "cocotb-rays", CONFIG=COLUMNS, AXI4=axi4)
    assert "batches: 9 of 9" in printed
    assert "0 of 6912 bytes of tags and hits differ from scene.results" in printed
    results = tmp_path / "rays" / "cocotb.results"
    content = bytearray(results.read_bytes())
    content[-65] ^= 1
    results.write_bytes(content)
    compare = [sys.executable, EXAMPLES / "rays" / "compare.py", results, results.with_name("scene.results")]
    done = subprocess.run(compare, capture_output=True, text=True)
    assert done.returncode == 1 and done.stdout.startswith("1 of 6912 bytes")


@pytest.mark.matrix
@pytest.mark.usefixtures("new_verilator")
def test_hits_of_a_scene_in_dram_in_verilator(tmp_path: Path) -> None:
    config = f"{COLUMNS} --set 'columnBvhMemory.cache={json.dumps(CACHE)}'"
    settings = {"SIMULATOR": "verilator", "CONFIG": config, "DRAM": "1", "RAYS": "640"}
    assert " 0 of " in " " + run_example(tmp_path, "cocotb-rays", **settings).splitlines()[-2]


@pytest.mark.matrix
@pytest.mark.usefixtures("new_verilator")
@pytest.mark.parametrize("cache", [False, True])
def test_a_frame_through_the_axi4_top_in_verilator(tmp_path: Path, cache: bool) -> None:
    """Also of a design whose scene is in DRAM, through the second master."""
    config = f"tiny --set 'columnBvhMemory.cache={json.dumps(CACHE)}'" if cache else "tiny"
    settings = {"SIMULATOR": "verilator", "AXI4": "1", "MESH": "torus", "SIZE": "32x24"}
    printed = run_example(tmp_path, CONFIG=config, DRAM="1" if cache else "", **settings)
    assert "0 of 768 pixels differ from model.png" in printed


def test_cocotb_refuses_an_old_verilator(tmp_path: Path) -> None:
    (tmp_path / "verilator").write_text("#!/bin/sh\necho 'Verilator 5.006 2023-01-22 rev (Debian 5.006-3)'\n")
    (tmp_path / "verilator").chmod(0o755)
    command = [sys.executable, EXAMPLES / "cocotb" / "run.py", "verilator", *(["none"] * 4)]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PATH": str(tmp_path)})
    assert done.returncode == 1
    assert "cocotb needs Verilator 5.036 or newer" in done.stderr and "tools/environment verilator" in done.stderr
