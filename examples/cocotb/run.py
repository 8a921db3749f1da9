"""Runs bench.py in Icarus Verilog or Verilator.

usage: run.py icarus|verilator DESIGN IMAGE FRAME OUTPUT [BACKDOOR]

DESIGN is a folder of `colonnade generate --axi BYTES`; IMAGE and FRAME come from `colonnade pack`; OUTPUT receives
lines of XRGB8888. With a folder of backdoor.py nothing is loaded through the bus.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from cocotb_tools.check_results import get_results
from cocotb_tools.runner import get_runner

#: The oldest Verilator of cocotb 2.
MINIMUM_VERILATOR = (5, 36)


def require_verilator() -> None:
    """End with advice if the Verilator on PATH is too old."""
    answer = subprocess.run(["verilator", "--version"], capture_output=True, text=True, check=True).stdout
    found = re.match(r"Verilator (\d+)\.(\d+)", answer)
    if found is None or (int(found[1]), int(found[2])) < MINIMUM_VERILATOR:
        advice = 'PATH="$(tools/verilator-environment):$PATH" make -C examples cocotb SIMULATOR=verilator'
        sys.exit(f"cocotb needs Verilator 5.036 or newer, not {answer.strip()}; run: {advice}")


def main(simulator: str, design: Path, image: Path, frame: Path, output: Path, backdoor: Path | None = None) -> None:
    """Build and run."""
    if simulator == "verilator":
        require_verilator()
    sources = [design / line for line in (design / "filelist.f").read_text().split()]
    build = output.with_suffix(f".{simulator}")
    runner = get_runner(simulator)
    extra = [] if backdoor is None else [backdoor / "backdoor.sv"]
    # Icarus Verilog has no bind: the backdoor is a second top module.
    tops = [word for _ in extra for word in ("-s", "colonnade_backdoor")]
    runner.build(
        sources=[*sources, *extra],
        hdl_toplevel="ColonnadeAxi",
        build_dir=build,
        build_args=["-g2012", *tops] if simulator == "icarus" else ["-Wno-fatal", "-O3"],
        timescale=("1ns", "1ps"),
        log_file=build.with_suffix(".log"),
        always=True,
    )
    files = {"DESIGN": design, "IMAGE": image, "FRAME": frame, "OUTPUT": output}
    sys.path.insert(0, str(Path(__file__).parent))
    results = runner.test(
        hdl_toplevel="ColonnadeAxi",
        test_module="bench",
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


if __name__ == "__main__":
    if len(sys.argv) not in (6, 7) or sys.argv[1] not in ("icarus", "verilator"):
        sys.exit(__doc__)
    main(sys.argv[1], *(Path(argument).resolve() for argument in sys.argv[2:]))
