"""A mapped netlist as Yosys writes it in JSON, flattened for timing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from colonnade.ppa.cells import Cell, Library


@dataclass(frozen=True)
class Instance:
    """A cell and the nets at its pins."""

    cell: Cell
    nets: dict[str, int]


class Netlist:
    """A module of Yosys's JSON, flattened into cells and numbered nets."""

    def __init__(self, modules: Mapping[str, Any], top: str, library: Library) -> None:
        self.instances: list[Instance] = []
        self.names: dict[int, str] = {}
        self.driven_outside: set[int] = set()
        self.read_outside: set[int] = set()
        self._next = 0
        self._library = library
        self._modules = modules
        ports: dict[Any, int] = {}
        for name, port in modules[top]["ports"].items():
            for index, bit in enumerate(port["bits"]):
                net = ports.setdefault(bit, self._net())
                self.names[net] = f"{name}[{index}]" if len(port["bits"]) > 1 else name
                (self.driven_outside if port["direction"] == "input" else self.read_outside).add(net)
        self._joined: dict[int, int] = {}
        self._add(modules[top], ports, "")
        self._join()
        self._name_inverted()

    @property
    def size(self) -> int:
        """Numbers that nets have are below this."""
        return self._next

    def _join(self) -> None:
        """Make one of the nets that a module connects straight through."""
        root = self._root
        if self._joined:
            self.instances = [
                Instance(each.cell, {pin: root(net) for pin, net in each.nets.items()}) for each in self.instances
            ]
            self.driven_outside = {root(net) for net in self.driven_outside}
            self.read_outside = {root(net) for net in self.read_outside}
            for net, name in list(self.names.items()):
                self.names.setdefault(root(net), name)

    def _root(self, net: int) -> int:
        while net in self._joined:
            net = self._joined[net]
        return net

    def _name_inverted(self) -> None:
        """A register whose output is inverted is called after what the inverter drives."""
        for instance in self.instances:
            if len(instance.nets) == 2 and instance.cell.is_gate("inverter"):
                pins = sorted(instance.nets, key=lambda pin: instance.cell.pins[pin].direction)
                source, target = instance.nets[pins[0]], instance.nets[pins[1]]
                if target in self.names:
                    self.names.setdefault(source, self.names[target])

    def _net(self) -> int:
        self._next += 1
        return self._next - 1

    def _add(self, module: Any, nets: dict[Any, int], prefix: str) -> None:
        for name, net_name in module["netnames"].items():
            for index, bit in enumerate(net_name["bits"]):
                if isinstance(bit, int):
                    net = nets.setdefault(bit, -1)
                    if net < 0:
                        net = nets[bit] = self._net()
                    if not net_name.get("hide_name"):
                        label = f"{prefix}{name}[{index}]" if len(net_name["bits"]) > 1 else f"{prefix}{name}"
                        self.names.setdefault(net, label)
        for name, instance in module["cells"].items():
            bits = instance["connections"]
            cell = self._library.cells.get(instance["type"])
            if cell is not None:
                pins = {pin: nets[bit[0]] for pin, bit in bits.items() if bit and isinstance(bit[0], int)}
                self.instances.append(Instance(cell, pins))
            elif instance["type"] in self._modules:
                inner = self._modules[instance["type"]]
                ports: dict[Any, int] = {}
                for port, outsides in bits.items():
                    for inside, outside in zip(inner["ports"][port]["bits"], outsides, strict=True):
                        if isinstance(inside, int) and isinstance(outside, int):
                            first = self._root(ports.setdefault(inside, nets[outside]))
                            if first != self._root(nets[outside]):
                                self._joined[self._root(nets[outside])] = first
                self._add(inner, ports, f"{prefix}{name}.")
            else:
                for port, outsides in bits.items():
                    is_output = instance["port_directions"][port] == "output"
                    touched = {nets[bit] for bit in outsides if isinstance(bit, int)}
                    (self.driven_outside if is_output else self.read_outside).update(touched)
