"""Mutants of units: Yosys changes one bit of one cell, and the bench tells it from the unit at the ports.

All mutants of a unit are in one module, whose input `mutant` chooses one; so a unit is compiled once. Random inputs
come first. abc answers for the mutants that they leave: one is equivalent, or differs for inputs that they missed.
"""

from __future__ import annotations

import random
import re
import resource
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from colonnade.common.temporary import temporary_folder
from colonnade.device.simulator_build import simulator_tools, verilator_command

from colonnade_lab.common.yosys import run_yosys
from colonnade_lab.units import bench
from colonnade_lab.units.bench import MUTANT, Bench, Difference
from colonnade_lab.units.compare import LARGEST_MEMORY
from colonnade_lab.units.verilog import Modules

#: What becomes of a mutant: random inputs tell it apart; only abc does; abc proves it equal; none of these.
CLASSES = ("random", "proof", "equivalent", "open")


@dataclass(frozen=True)
class Survey:
    """The mutants of one unit.

    Attributes:
        unit: The module.
        classes: The class of each mutant, by its number from 1, and the change as Yosys words it.
        seconds: CPU seconds of the random inputs of all mutants, without the build.
        build: CPU seconds of the mutants and the build.
    """

    unit: str
    classes: dict[int, tuple[str, str]]
    seconds: float
    build: float

    @property
    def counts(self) -> Counter[str]:
        """Mutants by class."""
        return Counter(kind for kind, _ in self.classes.values())


def survey(modules: Modules, unit: str, count: int, seed: int, cycles: int, limit: int) -> Survey:
    """Mutate a unit without the modules below it, and tell its mutants apart; one without cells has none.

    Args:
        modules: The design.
        unit: The module.
        count: At most so many mutants.
        seed: Chooses them.
        cycles: Cycles of random inputs for each.
        limit: CPU seconds of a question to abc.
    """
    start = _seconds()
    with temporary_folder() as folder:
        changes = _write(modules, unit, count, seed, folder)
        if not changes:
            return Survey(unit, {}, 0.0, _seconds() - start)
        sides = Bench(unit, unit, modules.ports(unit), has_mutants=True)
        (folder / "bench.sv").write_text(sides.verilog(modules.has_clock(unit)))
        sources = [folder / "unit.v", folder / "parts.sv"]
        program = bench.build(folder, sources, verilator_command(simulator_tools()), folder / "bench.log")
        built = _seconds()
        found = {n: bench.simulate(program, sides, cycles, seed, n) for n in range(1, len(changes) + 1)}
        ended = _seconds()
        is_small = modules.bits(unit) <= LARGEST_MEMORY
        kinds = {
            n: "random" if one else _by_proof(folder, sides, modules, unit, n, limit) if is_small else "open"
            for n, one in found.items()
        }
    return Survey(unit, {n: (kind, changes[n - 1]) for n, kind in kinds.items()}, ended - built, built - start)


def _write(modules: Modules, unit: str, count: int, seed: int, folder: Path) -> Sequence[str]:
    """Write the unit with mutants as `unit.v`, and the modules below it; the changes."""
    (folder / "source.sv").write_text(modules.texts[unit])
    parts = [modules.texts[name] for name in modules.closure(unit) if name != unit]
    (folder / "parts.sv").write_text("\n".join(parts))
    read = ["read_verilog -sv source.sv", "proc -norom", "opt_clean"]
    run_yosys([*read, f"mutate -list {4 * count} -seed {seed} -o list {unit}"], folder, folder / "list.log")
    # Changes of cells, not of the wires of a port
    found = [line.strip() for line in (folder / "list").read_text().splitlines() if re.search(r"-cell \$", line)]
    changes = random.Random(seed).sample(found, min(count, len(found)))
    apply = [line.replace("mutate ", f"mutate -ctrl {MUTANT} 16 {n} ", 1) for n, line in enumerate(changes, 1)]
    run_yosys([*read, *apply, "write_verilog -noattr unit.v"], folder, folder / "write.log")
    return changes


def _by_proof(folder: Path, sides: Bench, modules: Modules, unit: str, number: int, limit: int) -> str:
    """The class of a mutant that random inputs do not tell apart."""
    (folder / "bench.sv").write_text(sides.verilog(modules.has_clock(unit), number))
    found = bench.prove(folder, sides, [folder / "unit.v", folder / "parts.sv"], limit)
    return "proof" if isinstance(found, Difference) else "equivalent" if found else "open"


def _seconds() -> float:
    """CPU seconds of this process and its children."""
    used = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in used)
