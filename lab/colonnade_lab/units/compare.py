"""Whether the units of two designs are equal: by text, by a proof at their ports, or as far as random inputs tell.

Modules are compared from the bottom up. One whose text and whose parts are equal is equal. Another is compared at its
ports; where it differs, or its ports do, so is each module around it. So a unit may differ while the device is equal.
Inputs of a unit keep no contract but the streams': it may differ in states that its neighbours never reach.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.device.simulator_build import simulator_tools, verilator_command

from colonnade_lab.units import bench
from colonnade_lab.units.bench import Bench, Difference
from colonnade_lab.units.verilog import Modules

#: Modules with more lines, those below counted, are not compared at their ports.
LARGEST = 25_000

#: Bits of memories beyond which a unit has no proof.
LARGEST_MEMORY = 1 << 15

#: Verdicts, and what they mean.
VERDICTS = {
    "equal": "proved equal",
    "alike": "not told apart",
    "different": "differs",
    "ports": "other ports",
    "large": "too large to compare",
    "added": "new",
    "removed": "gone",
}


@dataclass(frozen=True)
class Verdict:
    """What is known of a unit whose text, or a part's, changed.

    Attributes:
        unit: The module.
        verdict: One of `VERDICTS`.
        before, after: SHA-256 of the module and those below it; empty if there is none.
        detail: First difference, or the cycles of random inputs.
    """

    unit: str
    verdict: str
    before: str
    after: str
    detail: str = ""

    @property
    def line(self) -> str:
        """For a reader."""
        digests = f"{self.before[:12] or '-'} {self.after[:12] or '-'}"
        return f"{self.unit}: {VERDICTS[self.verdict]}{f' {self.detail}' if self.detail else ''} ({digests})"


def compare(before: Modules, after: Modules, cycles: int, limit: int, progress: Progress = QUIET) -> Iterator[Verdict]:
    """Compare all units that may have changed, those below first.

    Args:
        before: The design to compare with.
        after: The design that is compared.
        cycles: Cycles of random inputs for a unit without a proof.
        limit: CPU seconds of each question to abc.
        progress: Shows the unit.
    """
    equal: set[str] = set()
    for unit in after.bottom_up():
        if unit not in before.texts:
            yield Verdict(unit, "added", "", after.digest(unit))
            continue
        is_same = before.texts[unit] == after.texts[unit]
        if is_same and all(child in equal for child in after.children[unit]):
            equal.add(unit)
            continue
        with progress.step(f"comparing {unit}"):
            verdict, detail = _verdict(before, after, unit, cycles, limit)
        if verdict == "equal":
            equal.add(unit)
        yield Verdict(unit, verdict, before.digest(unit), after.digest(unit), detail)
    for unit in sorted(set(before.texts) - set(after.texts)):
        yield Verdict(unit, "removed", before.digest(unit), "")


def _verdict(before: Modules, after: Modules, unit: str, cycles: int, limit: int) -> tuple[str, str]:
    """Verdict and detail of a unit in both designs."""
    ports = after.ports(unit)
    if {(port.name, port.is_input, port.bits) for port in ports} != {
        (port.name, port.is_input, port.bits) for port in before.ports(unit)
    }:
        return "ports", ""
    if after.lines(unit) > LARGEST:
        return "large", ""
    sides = Bench(f"before_{unit}", unit, ports)
    with temporary_folder() as folder:
        sources = [folder / "before.sv", folder / "after.sv"]
        sources[0].write_text(before.source(unit, "before_"))
        sources[1].write_text(after.source(unit))
        (folder / "bench.sv").write_text(sides.verilog(after.has_clock(unit)))
        is_small = after.bits(unit) <= LARGEST_MEMORY
        found = is_small and bench.prove(folder, sides, sources, limit)
        if found is True:
            return "equal", ""
        if not isinstance(found, Difference):
            program = bench.build(folder, sources, verilator_command(simulator_tools()), folder / "bench.log")
            found = bench.simulate(program, sides, cycles, seed=1) or False
    if isinstance(found, Difference):
        return "different", f"at cycle {found.cycle}, port {found.port}"
    return "alike", f"in {cycles} cycles"


def report(verdicts: list[Verdict], top: str) -> dict[str, Any]:
    """The result as JSON: `proved` are the units that keep receipts and figures; `device` says whether it is one."""
    return {
        "device": top,
        "isEqual": not any(one.unit == top and one.verdict != "equal" for one in verdicts),
        "proved": [one.unit for one in verdicts if one.verdict == "equal"],
        "units": [asdict(one) for one in verdicts],
    }
