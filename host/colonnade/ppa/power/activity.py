"""Power of a netlist from the activity of its nets, by the tables of the library.

Dynamic power is ½CV² of every input pin that changes, with no wires, and the cells' internal energies by the tables,
clock pins among both; leakage is the mean over a cell's states. What a pin takes counts for the unit that has it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from colonnade.ppa.library.energies import Energies
from colonnade.ppa.netlist.mapped import Instance, Netlist
from colonnade.ppa.timing.delays import NetTiming


@dataclass(frozen=True)
class Power:
    """Of one unit, in mW.

    Attributes:
        clock: of dynamic power, what the clock pins of registers take.
        dynamic: all dynamic power, that of the clock pins included.
        leakage: of the cells.
    """

    clock: float
    dynamic: float
    leakage: float


def power_of(
    netlist: Netlist,
    energies: Energies,
    timing: NetTiming,
    changes: Sequence[int],
    cycles: int,
    megahertz: float,
) -> dict[str, Power]:
    """The power of each owner of instances.

    Args:
        netlist: the gates.
        energies: of their cells.
        timing: slews and loads of the nets.
        changes: of each net in all cycles.
        cycles: how many.
        megahertz: the clock.
    """
    clock, dynamic, leakage = (
        defaultdict[str, float](float),
        defaultdict[str, float](float),
        defaultdict[str, float](float),
    )
    half = energies.voltage**2 / 2
    for instance in netlist.instances:
        energy, owner = energies.cells[instance.cell.name], instance.owner
        leakage[owner] += energy.leakage
        clocked = _clock_pins(instance)
        for name, net in instance.nets.items():
            if changes[net] == 0:
                continue
            pin = instance.cell.pins[name]
            if pin.direction == "input":
                each = half * pin.capacitance + energy.of_transition(name, timing.slews[net], 0.0)
            else:
                each = energy.of_transition(name, _slew(instance, timing), timing.loads[net])
            dynamic[owner] += each * changes[net]
            if name in clocked:
                clock[owner] += each * changes[net]
    # pJ a cycle times MHz are µW
    scale = megahertz / cycles / 1e3
    return {owner: Power(clock[owner] * scale, dynamic[owner] * scale, leakage[owner]) for owner in leakage}


def _clock_pins(instance: Instance) -> tuple[str, ...]:
    """Those whose power is the clock's: of a flip-flop one, of a clock gate the clock's way through it."""
    state, gate = instance.cell.state, instance.cell.clock_gate
    return (gate.clock, gate.gated) if gate else (state.clock,) if state else ()


def _slew(instance: Instance, timing: NetTiming) -> float:
    """Of what may change a gate's output: the clock, or the mean of its inputs."""
    state = instance.cell.state
    if state is not None:
        return timing.slews[instance.nets[state.clock]]
    slews = [timing.slews[net] for pin, net in instance.nets.items() if instance.cell.pins[pin].direction == "input"]
    return sum(slews) / len(slews) if slews else 0.0
