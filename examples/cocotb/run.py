"""Runs bench.py in Icarus Verilog.

usage: run.py DESIGN IMAGE FRAME OUTPUT [BACKDOOR]

DESIGN is a folder of `colonnade generate --axi BYTES`; IMAGE and FRAME come from `colonnade pack`; OUTPUT receives
lines of XRGB8888. With a folder of backdoor.py nothing is loaded through the bus.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from cocotb_tools.check_results import get_results
from cocotb_tools.runner import get_runner


def main(design: Path, image: Path, frame: Path, output: Path, backdoor: Path | None = None) -> None:
    """Build and run."""
    sources = [design / line for line in (design / "filelist.f").read_text().split()]
    build = output.with_suffix(".icarus")
    runner = get_runner("icarus")
    extra = [] if backdoor is None else [backdoor / "backdoor.sv"]
    runner.build(
        sources=[*sources, *extra],
        hdl_toplevel="ColonnadeAxi",
        build_dir=build,
        build_args=[
            "-g2012",
            *("-s" for _ in extra),
            *("colonnade_backdoor" for _ in extra),
        ],
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
    if len(sys.argv) not in (5, 6):
        sys.exit(__doc__)
    main(*(Path(argument).resolve() for argument in sys.argv[1:]))
