"""Runs bench.py, or another bench of this folder, in Icarus Verilog or Verilator.

DESIGN is a folder of `colonnade generate --axi BYTES`. For bench, IMAGE and INPUT, a frame file, come from `colonnade
pack`, and OUTPUT receives lines of XRGB8888; with a folder of backdoor.py nothing is loaded through the bus. For
rays_bench, IMAGE and INPUT, batches, come from examples/rays/batches.py, and OUTPUT receives tags and hits.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
from pathlib import Path

from cocotb_tools.check_results import get_results
from cocotb_tools.runner import get_runner

#: The top with AXI4 ports.
AXI4 = Path(__file__).resolve().parents[1] / "axi4"
#: The benches, and the variable that has their INPUT.
BENCHES = {"bench": "FRAME", "rays_bench": "BATCHES"}
#: The oldest Verilator of cocotb 2.
MINIMUM_VERILATOR = (5, 36)


def require_verilator() -> None:
    """End with advice if the Verilator on PATH is too old."""
    answer = subprocess.run(["verilator", "--version"], capture_output=True, text=True, check=True).stdout
    found = re.match(r"Verilator (\d+)\.(\d+)", answer)
    if found is None or (int(found[1]), int(found[2])) < MINIMUM_VERILATOR:
        advice = 'PATH="$(tools/environment verilator):$PATH" make -C examples cocotb SIMULATOR=verilator'
        sys.exit(f"cocotb needs Verilator 5.036 or newer, not {answer.strip()}; run: {advice}")


def main(arguments: argparse.Namespace) -> None:
    """Build and run."""
    simulator, design, backdoor = arguments.simulator, arguments.design, arguments.backdoor
    if simulator == "verilator":
        require_verilator()
    top = "colonnade_axi4" if arguments.axi4 else "ColonnadeAxi"
    sources = [design / line for line in (design / "filelist.f").read_text().split()]
    sources += sorted(AXI4.glob("*.sv")) if arguments.axi4 else []
    sources += [] if backdoor is None else [backdoor / "backdoor.sv"]
    config = json.loads((design / "manifest.json").read_text())["config"]
    memory = config["columnBvhMemory"]
    cache, defines, parameters = memory["cache"], {}, {}
    if arguments.axi4:
        # A device for rays has an id for each column, and one for its batches
        identifiers = int(config["array"]["columns"]).bit_length() if config.get("queries") else 1
        bus_bytes = json.loads((design / "shell.json").read_text())["busBytes"]
        parameters = {"MASTER_BYTES": bus_bytes, "DEVICE_ID": identifiers}
    if arguments.axi4 and cache is not None:
        defines = {"COLONNADE_SCENE": 1}
        parameters |= {"SCENE_ID": 2 if memory["banks"] == 4 else 1, "SCENE_BYTES": cache["busBytes"]}
    build = arguments.output.with_suffix(f".{simulator}")
    runner = get_runner(simulator)
    # Icarus Verilog has no bind: the backdoor is a second top module.
    tops = [] if backdoor is None else ["-s", "colonnade_backdoor"]
    runner.build(
        sources=sources,
        hdl_toplevel=top,
        build_dir=build,
        build_args=["-g2012", *tops] if simulator == "icarus" else ["-Wno-fatal", "-O3"],
        defines=defines,
        parameters=parameters,
        timescale=("1ns", "1ps"),
        log_file=build.with_suffix(".log"),
        always=True,
    )
    files = {"DESIGN": design, "IMAGE": arguments.image, "OUTPUT": arguments.output}
    files[BENCHES[arguments.bench]] = arguments.input
    files |= {} if arguments.scene is None else {"SCENE": arguments.scene}
    sys.path.insert(0, str(Path(__file__).parent))
    results = runner.test(
        hdl_toplevel=top,
        test_module=arguments.bench,
        build_dir=build,
        plusargs=[] if backdoor is None else [f"+backdoor={backdoor}"],
        extra_env={
            "COCOTB_LOG_LEVEL": "WARNING",
            "PYTHONWARNINGS": "ignore",
            **os.environ,
            **{name: str(path) for name, path in files.items()},
        },
    )
    if get_results(results)[1] != 0:
        sys.exit("the bench has failed")


def path(text: str) -> Path:
    """A path from any folder."""
    return Path(text).resolve()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("simulator", choices=["icarus", "verilator"])
    for name in ("design", "image", "input", "output"):
        parser.add_argument(name, type=path, metavar=name.upper())
    parser.add_argument("--bench", choices=BENCHES, default="bench")
    parser.add_argument("--backdoor", type=path, metavar="DIR", help="folder of backdoor.py")
    parser.add_argument("--axi4", action="store_true", help="through the top of examples/axi4")
    parser.add_argument(
        "--scene", type=path, metavar="FILE", help="of --dram-image, for a design whose scene is in DRAM"
    )
    main(parser.parse_args())
