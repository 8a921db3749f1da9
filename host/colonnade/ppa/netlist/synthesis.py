"""One unit becomes gates: Yosys through its Python package, with the result kept by content.

The recipe was chosen by measurement: Booth multipliers, Sklansky carries, and abc once, without fraig, scorr and dc2,
which merge carry trees into ripples. A 32-bit multiplier of ASAP7 takes 55 FO4 so, and 115 by Yosys's defaults, for 1 %
of area.
"""

from __future__ import annotations

import gzip
import hashlib
import importlib.metadata
import importlib.util
import json
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from colonnade.common import cache, processes
from colonnade.common.atomic_files import replacing
from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.design.toolchain import cache_directory, project_root
from colonnade.ppa.library import liberty
from colonnade.ppa.library.cells import Library
from colonnade.ppa.netlist.hierarchy import Hierarchy

#: Registers that dfflibmap would prefer to smaller ones, since their output is not inverted.
LARGE_REGISTERS = ("DFFHQx4*", "DFFLQx4*")

#: Flip-flops that share an enable and are as many get a gated clock: a gate takes as much as their multiplexers.
LEAST_GATED = 4

#: Transistors of Yosys's own gates in static CMOS, by its ``stat -tech cmos``; four are one gate equivalent.
TRANSISTORS = {
    "$_BUF_": 4,
    "$_NOT_": 2,
    "$_NAND_": 4,
    "$_NOR_": 4,
    "$_XOR_": 12,
    "$_XNOR_": 12,
    "$_MUX_": 12,
    "$_NMUX_": 10,
    "$_AOI3_": 6,
    "$_OAI3_": 6,
    "$_AOI4_": 8,
    "$_OAI4_": 8,
    "$_DFF_P_": 16,
}

#: The file of an entry of the cache.
NETLIST = "netlist.json.gz"

#: Default of ``--delay``, in FO4 of the library.
TARGET_FO4 = 60

_RUN = """
import sys
from pyosys import libyosys
design = libyosys.Design()
for line in open(sys.argv[1]):
    libyosys.run_pass(line.strip(), design)
"""


@dataclass(frozen=True)
class Technology:
    """What units are mapped to: the cells of liberties, or without any Yosys's own gates.

    Attributes:
        library: the cells, from pruned files.
        digest: of these files.
        delay: target for abc in ns.
        sources: the files that the user named.
    """

    library: Library | None
    digest: str
    delay: float | None
    sources: tuple[Path, ...] = ()

    @property
    def gate_area(self) -> float | None:
        """µm² of one gate equivalent."""
        return self.library.nand2.area if self.library else None


@dataclass(frozen=True)
class Gates:
    """Area of one unit.

    Attributes:
        registers: gate equivalents of flip-flops.
        combinational: gate equivalents of all else.
        flops: how many bits of flip-flops.
    """

    registers: float
    combinational: float
    flops: int

    @property
    def total(self) -> float:
        """Gate equivalents."""
        return self.registers + self.combinational


def require_yosys() -> None:
    """Refuse to begin without Yosys."""
    if importlib.util.find_spec("pyosys") is None:
        raise UserError("no Yosys found, which colonnade ppa needs: run tools/ppa-environment, which installs pyosys")


def technology(liberties: tuple[str, ...], delay: float | None) -> Technology:
    """Prune and read the liberties; `delay` in ns, by default `TARGET_FO4` of them."""
    if not liberties:
        if delay is not None:
            raise UserError("--delay means nothing without --liberty: Yosys's own gates have no delays")
        return Technology(None, "", None)
    folder = cache_directory(project_root()) / "liberty"
    folder.mkdir(parents=True, exist_ok=True)
    kept = []
    sources = liberty.find_liberties(liberties)
    for path in sources:
        text = liberty.pruned(path).encode("latin-1")
        # Yosys and OpenSTA take the name as a part of their scripts
        stem = re.sub(r"[^A-Za-z0-9_-]", "_", path.name.split(".")[0])[:100]
        copy = folder / f"{stem}-{hashlib.sha256(text).hexdigest()[:20]}.lib"
        if not copy.is_file() or copy.read_bytes() != text:
            with replacing(copy) as stream:
                stream.write(text)
        kept.append(copy)
    library = liberty.load(kept)
    digest = " ".join(copy.name for copy in kept)
    with liberty.understood(sources[0]):
        aim = delay or round(TARGET_FO4 * library.fo4, 4)
    return Technology(library, digest, aim, sources)


def synthesise(hierarchy: Hierarchy, top: str, into: Technology, progress: Progress = QUIET) -> dict[str, Any]:
    """The netlist of one unit, as Yosys's JSON has it: ``modules[top]``. Taken from the cache when it is there."""
    own, ends = hierarchy.closure(top)
    script = _script(hierarchy, top, own, ends, into)
    digest = hashlib.sha256("\n".join(script).encode())
    for module in own:
        digest.update(hierarchy.files[module].read_bytes())
    boxes = "".join(hierarchy.header(module) for module in ends)
    digest.update(f"{into.digest} {_constraints(into)} {boxes} {importlib.metadata.version('pyosys')}".encode())
    folder = cache_directory(project_root()) / "ppa" / f"{top}-{digest.hexdigest()[:20]}"

    def make(place: Path) -> None:
        with temporary_folder() as work:
            links = {hierarchy.files[module].name: hierarchy.files[module] for module in own}
            links |= {file.name: file for file in (into.library.files if into.library else ())}
            (work / "constraints").write_text(_constraints(into))
            (work / "boxes.sv").write_text(boxes)
            run_yosys([*script, "write_json netlist.json"], work, links, folder.with_suffix(".log"))
            written = json.loads((work / "netlist.json").read_text())["modules"][top]
        (place / NETLIST).write_bytes(gzip.compress(json.dumps(_kept(written)).encode(), 3))

    file = cache.entry(folder, make, f"netlist of {top}", progress) / NETLIST
    netlist: dict[str, Any] = json.loads(gzip.decompress(file.read_bytes()))
    return netlist


def _kept(module: dict[str, Any]) -> dict[str, Any]:
    """A module without what nobody asks for."""
    cells = {
        name: {key: cell[key] for key in ("type", "port_directions", "connections") if key in cell}
        for name, cell in module["cells"].items()
    }
    return {"ports": module["ports"], "cells": cells, "netnames": module["netnames"]}


def _script(hierarchy: Hierarchy, top: str, own: list[str], ends: list[str], into: Technology) -> list[str]:
    boxes = " ".join(f"--blackboxed-module {module}" for module in ends)
    files = " ".join(dict.fromkeys(hierarchy.files[module].name for module in own))
    script = [
        f"read_slang --top {top} {boxes} {files} boxes.sv",
        f"synth -noabc -flatten -top {top} -booth -extra-map +/choices/sklansky.v",
    ]
    recipe = "+strash;&get,-n;&dch,-f;&nf,{D};&put"
    if into.library is None:
        script += ["dfflegalize -cell $_DFF_P_ 01", "opt -nodffe -nosdff", f"abc -script {recipe} -g cmos"]
    else:
        cells = " ".join(f"-liberty {file.name}" for file in into.library.files)
        large = " ".join(f"-dont_use {name}" for name in LARGE_REGISTERS)
        target = f"-D {1000 * (into.delay or 0):.0f} -constr constraints"
        sizing = ";buffer,-c;topo;upsize,{D};dnsize,{D};stime,-p"
        # A register keeps its name though its output may vanish behind an inverter
        script += ["splitnets", "rename -wire -suffix _register t:$_*DFF*"]
        if into.library.has_clock_gates:
            script += [f"clockgate {cells} -min_net_size {LEAST_GATED}"]
        script += [f"dfflibmap {large} {cells}", "opt"]
        script += [f"abc -script {recipe}{sizing} {cells} {target}"]
    return [*script, "setundef -zero", "splitnets", "opt_clean -purge"]


def _constraints(into: Technology) -> str:
    """Inputs come from, and outputs go to, inverters: the load is four of them."""
    if into.library is None:
        return ""
    inverter = into.library.inverter
    load = 4 * next(pin.capacitance for pin in inverter.pins.values() if pin.direction == "input")
    return f"set_driving_cell {inverter.name}\nset_load {1000 * load:.4f}\n"


def run_yosys(script: list[str], place: Path, links: Mapping[str, Path], log: Path) -> None:
    """Run passes in the folder `place`, where `links` name the files they read; what Yosys says goes to `log`."""
    for name, file in links.items():
        (place / name).symlink_to(file.resolve())
    (place / "script.ys").write_text("\n".join(script) + "\n")
    with log.open("w") as stream:
        command = [sys.executable, "-c", _RUN, "script.ys"]
        done = processes.run(command, cwd=place, stdout=stream, stderr=subprocess.STDOUT)
    if done.returncode != 0:
        errors = [line for line in log.read_text(errors="replace").splitlines() if "ERROR" in line or "error:" in line]
        raise RuntimeError(f"Yosys failed: {(errors or ['see there'])[0]} (all of it: {log})")


def count_gates(netlist: dict[str, Any], into: Technology) -> Gates:
    """Gate equivalents of a unit. Other units in it, and memories, are not counted; nothing else may be left out."""
    kinds = Counter(cell["type"] for cell in netlist["cells"].values())
    registers = combinational = 0.0
    flops = 0
    for kind, number in kinds.items():
        if into.library is not None and kind in into.library.cells:
            cell = into.library.cells[kind]
            gates, is_register = cell.area / into.library.nand2.area, cell.is_register
        elif into.library is None and kind in TRANSISTORS:
            gates, is_register = TRANSISTORS[kind] / 4, kind.startswith("$_DFF")
        elif kind.startswith("$") and kind != "$scopeinfo":
            if into.library is None:
                raise RuntimeError(f"{number} cells {kind} were not mapped")
            raise UserError(f"the liberty has nothing for {number} cells {kind}: name all files of the library")
        else:
            continue
        registers += gates * number if is_register else 0.0
        combinational += 0.0 if is_register else gates * number
        flops += number if is_register and not _is_clock_gate(kind, into) else 0
    return Gates(registers, combinational, flops)


def _is_clock_gate(kind: str, into: Technology) -> bool:
    return into.library is not None and into.library.cells[kind].clock_gate is not None
