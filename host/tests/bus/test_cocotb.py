"""ColonnadeAxi in Icarus Verilog, behind cocotbext-axi: the tests of `shell_bench`.

No register or memory has an initial value there, and what depends on one that was not written is unknown. So these
tests also show that nothing which leaves the device depends on its state at power-up.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from colonnade.common.framebuffer_formats import PIXEL_BYTES, framebuffer_bytes
from colonnade.design import toolchain
from colonnade.design.generator import GeneratedDesign, shell_design_for
from colonnade.device.bit_exact import render_model
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.scene.parser import load_scene
from colonnade.scene_image.device_image import device_image
from colonnade.scene_image.dram_image import PAGE_BYTES, dram_image
from colonnade.scene_image.packer import pack

get_runner = pytest.importorskip("cocotb_tools.runner", reason="cocotb has no wheel for this platform").get_runner

pytestmark = pytest.mark.skipif(shutil.which("iverilog") is None, reason="no iverilog: apt-get install iverilog")

WIDTH, HEIGHT, FORMAT = 18, 4, 0
UNWRITTEN = 0xA5
CACHE = {"lines": 16, "ways": 2, "misses": 4, "sharedLines": 32, "sharedWays": 2, "sharedMisses": 8, "busBytes": 16}

#: The bus in bytes, the configuration, and which tests of `shell_bench` run, with how many errors.
CASES: dict[str, tuple[int, tuple[str, ...], dict[str, Any]]] = {
    "scratchpad": (
        16,
        ("array.contexts=2",),
        {"tests": "registers|frames|failed|streamed", "failedLoads": 1, "failedFrames": 2},
    ),
    "scene in DRAM": (
        8,
        (f"columnBvhMemory.cache={json.dumps({**CACHE, 'parity': True})}",),
        {"tests": "frames|failed|flipped", "failedLoads": 0, "failedFrames": 2},
    ),
}


def write_job(folder: Path, design: GeneratedDesign, settings: Mapping[str, Any]) -> None:
    """The files that `shell_bench.Shell` reads."""
    manifest = design.manifest
    image = pack(load_mesh("sphere:1"), manifest)
    scene = load_scene(toolchain.project_root() / "scenes" / "object.toml").with_mesh("sphere:1")
    registers = dict(frame_registers(scene, image.header, manifest, WIDTH, HEIGHT))
    model = render_model(manifest, image, registers)
    assert model.is_object.any() and not model.is_object.all()
    used, tile = WIDTH * PIXEL_BYTES[FORMAT], int(manifest.config["frame"]["tileSize"])
    stride = -(-WIDTH // tile) * tile * PIXEL_BYTES[FORMAT]
    expected = np.full((HEIGHT, stride), UNWRITTEN, dtype=np.uint8)
    expected[:, :used] = framebuffer_bytes(model, FORMAT)
    files = {"image": device_image(image, manifest), "expected": expected.tobytes(), "scene": b""}
    files["shell.json"] = (design.dir / "shell.json").read_bytes()
    if "dram.page" in registers:
        files["scene"] = dram_image(image, manifest)
        registers["dram.page"] = settings["scenePlace"] // PAGE_BYTES
    for name, content in files.items():
        (folder / name).write_bytes(content)
    base = json.loads(files["shell.json"])["deviceBase"]
    words = [word for name, value in registers.items() for word in manifest.registers[name].encode(value)]
    errors = [register.address for register in manifest.registers.values() if register.name.startswith("errors.")]
    job = {
        **settings,
        "frame": [(base + 4 * address, value) for address, value in words],
        "errors": [base + 4 * address for address in errors],
        "stride": stride,
        "format": FORMAT,
    }
    (folder / "job.json").write_text(json.dumps(job))


@pytest.mark.matrix
@pytest.mark.parametrize("case", ["scratchpad", "scene in DRAM"])
def test_the_shell_in_icarus(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bus_bytes, overrides, settings = CASES[case]
    design = shell_design_for("tiny", overrides, bus_bytes=bus_bytes, pixel_stream="streamed" in settings["tests"])
    write_job(tmp_path, design, {"seed": 1, "scenePlace": 1 << 20, **settings})
    run_bench(monkeypatch, tmp_path, "ColonnadeAxi", design.sources, "shell_bench,stream_bench", settings["tests"])


@pytest.mark.matrix
def test_the_axi4_top_of_the_examples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Clean under Verilator's lint with any width of the bus, and registers answer through it."""
    sources = sorted((toolchain.project_root() / "examples" / "axi4").glob("*.sv"))
    for width in (16, 8):
        design = shell_design_for("tiny", ("array.columns=2",), bus_bytes=width)
        command = ["verilator", "--lint-only", "-Wall", "-Wno-fatal", "--top-module", "colonnade_axi4"]
        command += [f"-GMASTER_BYTES={width}", f"-I{design.dir}", *map(str, sources)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        warnings = [
            line for line in done.stderr.splitlines() if re.match(rf"%\S+ {re.escape(str(sources[0].parent))}", line)
        ]
        assert done.returncode == 0 and not warnings, done.stderr
    run_bench(
        monkeypatch, tmp_path, "colonnade_axi4", [*design.sources, *sources], "axi4_bench", "registers_through_axi4"
    )


def run_bench(
    monkeypatch: pytest.MonkeyPatch, folder: Path, top: str, sources: list[Path], modules: str, tests: str
) -> None:
    """Compile ``sources`` with Icarus Verilog, and run the cocotb tests of ``modules`` that ``tests`` names."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    runner = get_runner("icarus")
    runner.build(
        sources=sources,
        hdl_toplevel=top,
        build_dir=folder / "build",
        build_args=["-g2012"],
        timescale=("1ns", "1ps"),
        log_file=folder / "build.log",
    )
    log = folder / "test.log"
    variables = {"COLONNADE_JOB": str(folder), "COCOTB_LOG_LEVEL": "WARNING", "PYTHONWARNINGS": "ignore"}
    try:
        runner.test(
            hdl_toplevel=top,
            test_module=modules,
            test_filter=tests,
            build_dir=folder / "build",
            extra_env={**os.environ, **variables},
            log_file=log,
        )
    except SystemExit:
        pytest.fail(log.read_text(), pytrace=False)
