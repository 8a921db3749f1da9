"""Static timing analysis of a mapped netlist by the tables of the library.

A path starts at a register's clock or at an input, and ends at a register's set-up or at an output. The clock is ideal;
wires have no resistance and no capacitance; the worst slew at a pin propagates. Ports of black boxes, such as memories,
count as inputs and outputs of the netlist.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from colonnade_lab.ppa.library.cells import Arc, Cell, Library, Pin
from colonnade_lab.ppa.netlist.mapped import Instance, Netlist

#: Arrival times of a net's rise and fall (ns, negative: never), and their slews (ns).
Edges = list[float]

_NEVER = -1.0


@dataclass(frozen=True)
class TimingPath:
    """The slowest path of a kind.

    Attributes:
        ns: Delay with clock-to-output and set-up times, where it starts or ends at a register.
        begin: The net where it starts.
        end: The register or the output where it ends.
        cells: The gates on it, in order.
    """

    ns: float
    begin: str
    end: str
    cells: tuple[str, ...]


@dataclass(frozen=True)
class Timing:
    """The slowest path of each kind; None without such a path."""

    register_to_register: TimingPath | None
    input_to_register: TimingPath | None
    register_to_output: TimingPath | None
    input_to_output: TimingPath | None


class Analysis:
    """Propagates arrival times through a netlist.

    Attributes:
        slew: Slew of inputs and of the clock, ns.
        output_load: Load of outputs, pF.
        loads: Load of each net, pF.
        order: Combinational cells in topological order.
        registers: Register cells.
    """

    def __init__(self, netlist: Netlist, library: Library) -> None:
        self._netlist = netlist
        self.slew, self.output_load = self.edges(library)
        self.loads = self._sum_loads()
        self.registers = [instance for instance in netlist.instances if instance.cell.is_register]
        self.order = self._sorted()
        self._arcs: dict[str, list[tuple[Pin, list[Arc]]]] = {}

    @staticmethod
    def edges(library: Library) -> tuple[float, float]:
        """Slew of inputs and clock (ns) and load of outputs (pF): as of an inverter in an FO4 chain."""
        inverter = library.inverter
        load = 4 * next(pin.capacitance for pin in inverter.pins.values() if pin.direction == "input")
        output = next(pin for pin in inverter.pins.values() if pin.direction == "output")
        return output.arcs[0].tables["rise_transition"].at(library.fo4, load), load

    def timing(self) -> Timing:
        """The slowest paths."""
        clocked: dict[int, Edges] = {}
        for register in self.registers:
            for pin, arcs in self.outputs(register.cell):
                net = register.nets.get(pin.name)
                if net is not None and arcs:
                    clocked[net] = self._clocked(arcs, self.loads[net])
        begins = {net: [0.0, 0.0, self.slew, self.slew] for net in self._netlist.driven_outside}
        register_to_register, register_to_output = self._slowest(clocked)
        input_to_register, input_to_output = self._slowest(begins)
        return Timing(register_to_register, input_to_register, register_to_output, input_to_output)

    def _clocked(self, arcs: list[Arc], load: float) -> Edges:
        tables = [arc.tables for arc in arcs]

        def worst(name: str) -> float:
            return max((table[name].at(self.slew, load) for table in tables if name in table), default=_NEVER)

        return [worst("cell_rise"), worst("cell_fall"), worst("rise_transition"), worst("fall_transition")]

    def _slowest(self, begins: dict[int, Edges]) -> tuple[TimingPath | None, TimingPath | None]:
        edges = {net: list(values) for net, values in begins.items()}
        before: dict[int, tuple[Instance, int]] = {}
        for instance in self.order:
            for pin, arcs in self.outputs(instance.cell):
                net = instance.nets.get(pin.name)
                if net is None:
                    continue
                found = self._through(instance, arcs, edges, self.loads[net])
                if found is not None:
                    edges[net], from_net = found
                    before[net] = (instance, from_net)
        to_register = max(
            ((self._at_register(register, edges), register) for register in self.registers),
            key=lambda end: end[0],
            default=None,
        )
        outputs = [(max(edges[net][:2]), net) for net in self._netlist.read_outside if net in edges]
        to_output = max(outputs, default=None)
        first = second = None
        if to_register is not None and to_register[0] > 0:
            register = to_register[1]
            data = max(self._data(register), key=lambda pin: self._setup(register, pin, edges))
            first = self._path(to_register[0], register.nets[data.name], self._register_name(register), before)
        if to_output is not None and to_output[0] > 0:
            second = self._path(to_output[0], to_output[1], self._name(to_output[1]), before)
        return first, second

    def _through(
        self, instance: Instance, arcs: list[Arc], edges: dict[int, Edges], load: float
    ) -> tuple[Edges, int] | None:
        rise = fall = latest = _NEVER
        rise_slew = fall_slew = 0.0
        from_net = -1
        for arc in arcs:
            net = instance.nets.get(arc.related, -1)
            at = edges.get(net)
            if at is None:
                continue
            tables = arc.tables
            for edge in (0, 1):
                arrival, slew = at[edge], at[edge + 2]
                if arrival < 0:
                    continue
                if arc.sense != ("positive_unate" if edge else "negative_unate"):
                    rise = max(rise, arrival + tables["cell_rise"].at(slew, load))
                    rise_slew = max(rise_slew, tables["rise_transition"].at(slew, load))
                if arc.sense != ("negative_unate" if edge else "positive_unate"):
                    fall = max(fall, arrival + tables["cell_fall"].at(slew, load))
                    fall_slew = max(fall_slew, tables["fall_transition"].at(slew, load))
            if max(rise, fall) > latest:
                latest, from_net = max(rise, fall), net
        return None if from_net < 0 else ([rise, fall, rise_slew, fall_slew], from_net)

    def _data(self, register: Instance) -> list[Pin]:
        return [pin for pin in register.cell.pins.values() if any("setup" in arc.kind for arc in pin.arcs)]

    def _at_register(self, register: Instance, edges: dict[int, Edges]) -> float:
        return max((self._setup(register, pin, edges) for pin in self._data(register)), default=_NEVER)

    def _setup(self, register: Instance, pin: Pin, edges: dict[int, Edges]) -> float:
        at = edges.get(register.nets.get(pin.name, -1))
        if at is None:
            return _NEVER
        latest = _NEVER
        for arc in pin.arcs:
            if arc.kind.startswith("setup"):
                for edge, name in enumerate(("rise_constraint", "fall_constraint")):
                    if at[edge] >= 0 and name in arc.tables:
                        latest = max(latest, at[edge] + arc.tables[name].at(at[edge + 2], self.slew))
        return latest

    def _path(self, ns: float, net: int, end: str, before: Mapping[int, tuple[Instance, int]]) -> TimingPath:
        cells: list[str] = []
        while net in before:
            instance, net = before[net]
            cells.append(instance.cell.name)
        return TimingPath(ns, self._name(net), end, tuple(reversed(cells)))

    def _name(self, net: int) -> str:
        return self._netlist.names.get(net, "an unnamed net")

    def _register_name(self, register: Instance) -> str:
        gate = register.cell.clock_gate
        if gate is not None:
            gated = [each for each in self.registers if register.nets[gate.gated] in each.nets.values()]
            return f"clock of {next((self._register_name(each) for each in gated if each is not register), 'nothing')}"
        nets = [register.nets[pin.name] for pin, _ in self.outputs(register.cell) if pin.name in register.nets]
        named = [self._netlist.names[net] for net in nets if net in self._netlist.names]
        return register.name or (named[0] if named else self._name(nets[0]) if nets else "a register")

    def outputs(self, cell: Cell) -> list[tuple[Pin, list[Arc]]]:
        """The outputs of a cell and their arcs; for a register only the arcs from its clock."""
        found = self._arcs.get(cell.name)
        if found is None:
            wanted = ("rising_edge", "falling_edge") if cell.is_register else ("combinational",)
            found = [
                (pin, [arc for arc in pin.arcs if arc.kind.startswith(wanted) and "cell_rise" in arc.tables])
                for pin in cell.pins.values()
                if pin.direction == "output"
            ]
            self._arcs[cell.name] = found
        return found

    def _sum_loads(self) -> list[float]:
        loads = [0.0] * self._netlist.size
        for instance in self._netlist.instances:
            for name, net in instance.nets.items():
                pin = instance.cell.pins.get(name)
                if pin is not None and pin.direction == "input":
                    loads[net] += pin.capacitance
        for net in self._netlist.read_outside:
            loads[net] += self.output_load
        return loads

    def _sorted(self) -> list[Instance]:
        """The combinational cells in topological order."""
        gates = [instance for instance in self._netlist.instances if not instance.cell.is_register]
        driver: dict[int, int] = {}
        for index, gate in enumerate(gates):
            for name, net in gate.nets.items():
                if gate.cell.pins[name].direction == "output":
                    driver[net] = index
        waits = [0] * len(gates)
        readers: list[list[int]] = [[] for _ in gates]
        for index, gate in enumerate(gates):
            for source in {driver[net] for name, net in gate.nets.items() if _is_read(gate, name) and net in driver}:
                readers[source].append(index)
                waits[index] += 1
        order = [index for index, count in enumerate(waits) if count == 0]
        for index in order:
            for reader in readers[index]:
                waits[reader] -= 1
                if waits[reader] == 0:
                    order.append(reader)
        if len(order) < len(gates):
            raise RuntimeError(f"{len(gates) - len(order)} gates lie in or after a combinational loop")
        return [gates[index] for index in order]


def _is_read(gate: Instance, pin: str) -> bool:
    return gate.cell.pins[pin].direction == "input"


def gates_by_name(cells: Iterable[str]) -> str:
    """The number of each gate on a path, by names without the library's prefix or suffix."""
    counts: dict[str, int] = {}
    for cell in cells:
        name = re.sub(r"_ASAP7.*|^sky130_fd_sc_\w+?__", "", cell)
        counts[name] = counts.get(name, 0) + 1
    return ", ".join(f"{count} {name}" for name, count in sorted(counts.items(), key=lambda item: -item[1]))
