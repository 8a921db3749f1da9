"""Power of a netlist from the activity of its nets and the tables of the library.

Dynamic power is ½CV² of each transition at an input pin, without wires, plus the internal energy of the cell. Both
include clock pins. Leakage is the mean over a cell's states. The power of a pin belongs to the unit of its cell.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from colonnade_lab.ppa.library.energies import Energies
from colonnade_lab.ppa.netlist.mapped import Instance, Netlist
from colonnade_lab.ppa.timing.delays import NetTiming


@dataclass(frozen=True)
class Power:
    """Power of one unit, mW.

    Attributes:
        clock: Dynamic power of the clock pins of registers.
        dynamic: All dynamic power, including clock pins.
        leakage: Leakage power.
    """

    clock: float
    dynamic: float
    leakage: float

    def __add__(self, other: Power) -> Power:
        return Power(self.clock + other.clock, self.dynamic + other.dynamic, self.leakage + other.leakage)

    def __mul__(self, factor: float) -> Power:
        return Power(self.clock * factor, self.dynamic * factor, self.leakage * factor)


#: No power.
NO_POWER = Power(0.0, 0.0, 0.0)


def power_of(
    netlist: Netlist,
    energies: Energies,
    timing: NetTiming,
    changes: Sequence[int],
    cycles: int,
    megahertz: float,
) -> dict[str, Power]:
    """The power of each module that contains instances, by `Instance.owner`.

    Args:
        netlist: The gates.
        energies: Energies of the cells.
        timing: Slews and loads of the nets.
        changes: Transitions of each net over all cycles.
        cycles: Number of cycles.
        megahertz: Clock frequency, MHz.
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
    # pJ per cycle × MHz = µW
    scale = megahertz / cycles / 1e3
    return {owner: Power(clock[owner] * scale, dynamic[owner] * scale, leakage[owner]) for owner in leakage}


def _clock_pins(instance: Instance) -> tuple[str, ...]:
    """The clock pins of a cell: the clock of a flip-flop, or the clock input and output of a clock gate."""
    state, gate = instance.cell.flip_flop, instance.cell.clock_gate
    return (gate.clock, gate.gated) if gate else (state.clock,) if state else ()


def _slew(instance: Instance, timing: NetTiming) -> float:
    """The slew that drives an output: the clock's, or the mean over the inputs, ns."""
    state = instance.cell.flip_flop
    if state is not None:
        return timing.slews[instance.nets[state.clock]]
    slews = [timing.slews[net] for pin, net in instance.nets.items() if instance.cell.pins[pin].direction == "input"]
    return sum(slews) / len(slews) if slews else 0.0
