"""Synthesis of one unit with Yosys's Python package, cached by content.

The recipe was chosen by measurement: Booth multipliers, Sklansky adders, and one run of abc without fraig, scorr and
dc2, which turn carry trees into ripple chains. With ASAP7 a 32-bit multiplier then takes 55 FO4 instead of 115 by
Yosys's defaults, for 1 % more area.
"""

from __future__ import annotations

import gzip
import hashlib
import importlib.metadata
import json
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from colonnade.common import cache
from colonnade.common.atomic_files import replacing
from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.design.toolchain import cache_directory, project_root
from colonnade.design.verilog import without_places

from colonnade_lab.common.yosys import run_yosys
from colonnade_lab.ppa.library import liberty, liberty_files, liberty_syntax
from colonnade_lab.ppa.library.cells import Library
from colonnade_lab.ppa.library.one_library import library_files
from colonnade_lab.ppa.netlist.hierarchy import Hierarchy

#: Large registers that dfflibmap would prefer to smaller ones because their output is not inverted.
LARGE_REGISTERS = ("DFFHQx4*", "DFFLQx4*")

#: Fewest flip-flops with a common enable that get a gated clock: a clock gate is as large as their multiplexers.
MIN_GATED_REGISTERS = 4

#: Static-CMOS transistors of Yosys's generic gates, from ``stat -tech cmos``; four are one gate equivalent.
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

#: The file of a cache entry.
NETLIST = "netlist.json.gz"

#: Default of ``--delay``, FO4 of the library.
TARGET_FO4 = 60


@dataclass(frozen=True)
class Technology:
    """The target of technology mapping: the cells of a library, or Yosys's generic gates.

    Attributes:
        library: The cells of the pruned files; None: Yosys's generic gates.
        digest: Digest of the pruned files.
        delay: Target delay of abc, ns.
        sources: The original files, in the order of the library's.
    """

    library: Library | None
    digest: str
    delay: float | None
    sources: tuple[Path, ...] = ()

    @property
    def gate_area(self) -> float | None:
        """Area of one gate equivalent, µm²."""
        return self.library.nand2.area if self.library else None


@dataclass(frozen=True)
class Gates:
    """Area of one unit.

    Attributes:
        registers: Gate equivalents of flip-flops and clock gates.
        combinational: Gate equivalents of all other cells.
        flops: Number of flip-flops.
    """

    registers: float
    combinational: float
    flops: int

    @property
    def total(self) -> float:
        """Gate equivalents of all cells."""
        return self.registers + self.combinational


def technology(liberties: tuple[str, ...], delay: float | None) -> Technology:
    """Prune and read liberty files.

    Args:
        liberties: Files or folders; empty: Yosys's generic gates.
        delay: Target delay, ns; None: `TARGET_FO4`.
    """
    if not liberties:
        if delay is not None:
            raise UserError("--delay needs --liberty: Yosys's generic gates have no delays")
        return Technology(None, "", None)
    folder = cache_directory(project_root()) / "liberty"
    folder.mkdir(parents=True, exist_ok=True)
    pruned: list[tuple[Path, Path]] = []
    for path in library_files(liberties):
        text = liberty_files.pruned(path).encode("latin-1")
        # The name becomes part of the scripts of Yosys and OpenSTA
        stem = re.sub(r"[^A-Za-z0-9_-]", "_", path.name.split(".")[0])[:100]
        copy = folder / f"{stem}-{hashlib.sha256(text).hexdigest()[:20]}.lib"
        if not copy.is_file() or copy.read_bytes() != text:
            with replacing(copy) as stream:
                stream.write(text)
        pruned.append((copy, path))
    # abc loses the cells of a small file that it reads before a large one
    pruned.sort(key=lambda pair: (-pair[0].stat().st_size, pair[0].name))
    copies, sources = zip(*pruned, strict=True)
    library = liberty.load(copies)
    digest = " ".join(copy.name for copy in copies)
    with liberty_syntax.parsing(sources[0]):
        target = delay or round(TARGET_FO4 * library.fo4, 4)
    return Technology(library, digest, target, sources)


def synthesise(hierarchy: Hierarchy, top: str, tech: Technology, progress: Progress = QUIET) -> dict[str, Any]:
    """The netlist of one unit, ``modules[top]`` of Yosys's JSON, from the cache if it is there."""
    own, black_boxes = hierarchy.closure(top)
    script = _script(hierarchy, top, own, black_boxes, tech)
    digest = hashlib.sha256("\n".join(script).encode())
    for module in own:
        digest.update(without_places(hierarchy.files[module].read_text(encoding="utf-8")).encode())
    boxes = "".join(hierarchy.header(module) for module in black_boxes)
    digest.update(f"{tech.digest} {_constraints(tech)} {boxes} {importlib.metadata.version('pyosys')}".encode())
    folder = cache_directory(project_root()) / "ppa" / f"{top}-{digest.hexdigest()[:20]}"
    with cache.entry(folder, f"netlist of {top}", progress) as empty:
        if empty is not None:
            with temporary_folder() as work:
                links = {hierarchy.files[module].name: hierarchy.files[module] for module in own}
                links |= {file.name: file for file in (tech.library.files if tech.library else ())}
                (work / "constraints").write_text(_constraints(tech))
                (work / "boxes.sv").write_text(boxes)
                run_yosys([*script, "write_json netlist.json"], work, folder.with_suffix(".log"), links)
                written = json.loads((work / "netlist.json").read_text())["modules"][top]
            (empty / NETLIST).write_bytes(gzip.compress(json.dumps(_trimmed(written)).encode(), 3))
    netlist: dict[str, Any] = json.loads(gzip.decompress((folder / NETLIST).read_bytes()))
    return netlist


def _trimmed(module: dict[str, Any]) -> dict[str, Any]:
    """A module with only the keys that are used."""
    cells = {
        name: {key: cell[key] for key in ("type", "port_directions", "connections") if key in cell}
        for name, cell in module["cells"].items()
    }
    return {"ports": module["ports"], "cells": cells, "netnames": module["netnames"]}


def _script(hierarchy: Hierarchy, top: str, own: list[str], black_boxes: list[str], tech: Technology) -> list[str]:
    boxes = " ".join(f"--blackboxed-module {module}" for module in black_boxes)
    files = " ".join(dict.fromkeys(hierarchy.files[module].name for module in own))
    script = [
        f"read_slang --top {top} {boxes} {files} boxes.sv",
        f"synth -noabc -flatten -top {top} -booth -extra-map +/choices/sklansky.v",
    ]
    recipe = "+strash;&get,-n;&dch,-f;&nf,{D};&put"
    if tech.library is None:
        script += ["dfflegalize -cell $_DFF_P_ 01", "opt -nodffe -nosdff", f"abc -script {recipe} -g cmos"]
    else:
        cells = " ".join(f"-liberty {file.name}" for file in tech.library.files)
        large = " ".join(f"-dont_use {name}" for name in LARGE_REGISTERS)
        target = f"-D {1000 * (tech.delay or 0):.0f} -constr constraints"
        sizing = ";buffer,-c;topo;upsize,{D};dnsize,{D};stime,-p"
        # Keep the names of registers, whose outputs may be merged into an inverter
        script += ["splitnets", "rename -wire -suffix _register t:$_*DFF*"]
        if tech.library.has_clock_gates:
            script += [f"clockgate {cells} -min_net_size {MIN_GATED_REGISTERS}"]
        script += [f"dfflibmap {large} {cells}", "opt"]
        script += [f"abc -script {recipe}{sizing} {cells} {target}"]
    return [*script, "setundef -zero", "splitnets", "opt_clean -purge"]


def _constraints(tech: Technology) -> str:
    """Constraints for abc: an inverter drives each input, and each output drives four inverters."""
    if tech.library is None:
        return ""
    inverter = tech.library.inverter
    load = 4 * next(pin.capacitance for pin in inverter.pins.values() if pin.direction == "input")
    return f"set_driving_cell {inverter.name}\nset_load {1000 * load:.4f}\n"


def count_gates(netlist: dict[str, Any], tech: Technology) -> Gates:
    """Gate equivalents of a unit, without inner units and memories.

    Raises:
        UserError: The library lacks a cell for some logic.
    """
    kinds = Counter(cell["type"] for cell in netlist["cells"].values())
    registers = combinational = 0.0
    flops = 0
    for kind, number in kinds.items():
        if tech.library is not None and kind in tech.library.cells:
            cell = tech.library.cells[kind]
            gates, is_register = cell.area / tech.library.nand2.area, cell.is_register
        elif tech.library is None and kind in TRANSISTORS:
            gates, is_register = TRANSISTORS[kind] / 4, kind.startswith("$_DFF")
        elif kind.startswith("$") and kind != "$scopeinfo":
            if tech.library is None:
                raise RuntimeError(f"{number} cells {kind} were not mapped")
            raise UserError(f"the liberty has no cell for {number} {kind}: give all files of the library")
        else:
            continue
        registers += gates * number if is_register else 0.0
        combinational += 0.0 if is_register else gates * number
        flops += number if is_register and not _is_clock_gate(kind, tech) else 0
    return Gates(registers, combinational, flops)


def _is_clock_gate(kind: str, tech: Technology) -> bool:
    return tech.library is not None and tech.library.cells[kind].clock_gate is not None
