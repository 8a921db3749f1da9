"""A mapped netlist from Yosys's JSON, flattened for timing, replay and power."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from colonnade_lab.ppa.library.cells import Cell, Library

#: A net's number, or a constant.
Bit = int | bool

#: Suffix of a register's name, which the synthesis appends to the name of its output.
REGISTER = "_register"


@dataclass(frozen=True)
class Instance:
    """A cell instance and the nets at its pins.

    Attributes:
        cell: The library cell.
        nets: Nets by pin.
        name: Name of the RTL register, for registers.
        owner: Path of the module that contains it, such as ``RaySetup/Divider``.
        ties: Constants by pin.
    """

    cell: Cell
    nets: dict[str, int]
    name: str = ""
    owner: str = ""
    ties: dict[str, bool] = field(default_factory=dict)


@dataclass(frozen=True)
class Box:
    """A black box such as a memory: its module, the path of the module that contains it, and the bits of its ports."""

    kind: str
    owner: str
    ports: dict[str, list[Bit]]


class Netlist:
    """A module of Yosys's JSON, flattened into cells and numbered nets."""

    def __init__(self, modules: Mapping[str, Any], top: str, library: Library) -> None:
        self.instances: list[Instance] = []
        self.boxes: list[Box] = []
        self.names: dict[int, str] = {}
        self.driven_outside: set[int] = set()
        self.read_outside: set[int] = set()
        self.ties: dict[int, bool] = {}
        self._next = 0
        self._library = library
        self._modules = modules
        ports: dict[Any, int] = {}
        self.inputs: dict[str, list[Bit]] = {}
        self.outputs: dict[str, list[Bit]] = {}
        for name, port in modules[top]["ports"].items():
            is_input = port["direction"] == "input"
            for index, bit in enumerate(port["bits"]):
                if isinstance(bit, int):
                    net = ports[bit] if bit in ports else ports.setdefault(bit, self._net())
                    self.names[net] = f"{name}[{index}]" if len(port["bits"]) > 1 else name
                    (self.driven_outside if is_input else self.read_outside).add(net)
            (self.inputs if is_input else self.outputs)[name] = _bits(port["bits"], ports)
        self._joined: dict[int, int] = {}
        self._add(modules[top], ports, "", "")
        self._join()
        self._name_inverted()

    @property
    def size(self) -> int:
        """Upper bound of net numbers."""
        return self._next

    def _join(self) -> None:
        """Merge nets that a module connects directly to each other."""
        root = self._root
        if not self._joined:
            return

        def rooted(ports: Mapping[str, list[Bit]]) -> dict[str, list[Bit]]:
            return {port: [bit if isinstance(bit, bool) else root(bit) for bit in bits] for port, bits in ports.items()}

        self.instances = [
            replace(each, nets={pin: root(net) for pin, net in each.nets.items()}) for each in self.instances
        ]
        self.boxes = [replace(box, ports=rooted(box.ports)) for box in self.boxes]
        self.inputs, self.outputs = rooted(self.inputs), rooted(self.outputs)
        self.driven_outside = {root(net) for net in self.driven_outside}
        self.read_outside = {root(net) for net in self.read_outside}
        self.ties = {root(net): value for net, value in self.ties.items()}
        for net, name in list(self.names.items()):
            self.names.setdefault(root(net), name)

    def _root(self, net: int) -> int:
        while net in self._joined:
            net = self._joined[net]
        return net

    def _name_inverted(self) -> None:
        """Name the outputs of registers after the register, or after the output of a following inverter."""
        for instance in self.instances:
            if instance.name:
                for pin, net in instance.nets.items():
                    if instance.cell.pins[pin].direction == "output":
                        self.names.setdefault(net, instance.name)
            if len(instance.nets) == 2 and instance.cell.is_gate("inverter"):
                pins = sorted(instance.nets, key=lambda pin: instance.cell.pins[pin].direction)
                source, target = instance.nets[pins[0]], instance.nets[pins[1]]
                if target in self.names:
                    self.names.setdefault(source, self.names[target])

    def _net(self) -> int:
        self._next += 1
        return self._next - 1

    def _add(self, module: Any, nets: dict[Any, int], prefix: str, owner: str) -> None:
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
            kind, pins = instance["type"], instance["connections"]
            cell = self._library.cells.get(kind)
            if cell is not None:
                label = f"{prefix}{name.removesuffix(REGISTER)}" if name.endswith(REGISTER) else ""
                bits = {pin: _bits(wires, nets)[0] for pin, wires in pins.items() if wires}
                wired = {pin: bit for pin, bit in bits.items() if not isinstance(bit, bool)}
                ties = {pin: bit for pin, bit in bits.items() if isinstance(bit, bool)}
                self.instances.append(Instance(cell, wired, label, owner, ties))
            elif kind in self._modules:
                below = f"{owner}/{kind}" if owner else kind
                self._add(self._modules[kind], self._inner(instance, nets), f"{prefix}{name}.", below)
            elif pins:
                self.boxes.append(Box(kind, owner, {port: _bits(wires, nets) for port, wires in pins.items()}))
                for port, outsides in pins.items():
                    is_output = instance["port_directions"][port] == "output"
                    touched = {nets[bit] for bit in outsides if isinstance(bit, int)}
                    (self.driven_outside if is_output else self.read_outside).update(touched)

    def _inner(self, instance: Any, nets: Mapping[Any, int]) -> dict[Any, int]:
        """The nets at the ports of an inner module, by its own net numbers."""
        inner, ports = self._modules[instance["type"]], dict[Any, int]()
        for port, outsides in instance["connections"].items():
            is_output = inner["ports"][port]["direction"] == "output"
            for inside, outside in zip(inner["ports"][port]["bits"], outsides, strict=True):
                if isinstance(inside, int) and isinstance(outside, int):
                    first = self._root(ports.setdefault(inside, nets[outside]))
                    if first != self._root(nets[outside]):
                        self._joined[self._root(nets[outside])] = first
                elif isinstance(inside, int) and not is_output:
                    net = ports[inside] if inside in ports else ports.setdefault(inside, self._net())
                    self.ties[net] = outside == "1"
                elif isinstance(outside, int) and is_output:
                    self.ties[nets[outside]] = inside == "1"
        return ports

    def clock_gates(self) -> Iterator[tuple[int, Bit]]:
        """Each gated clock and its enable."""
        for instance in self.instances:
            gate = instance.cell.clock_gate
            if gate is not None:
                wires: dict[str, Bit] = {**instance.nets, **instance.ties}
                yield instance.nets[gate.gated], wires[gate.enable]

    def drivers(self) -> Iterator[tuple[int, Instance, str]]:
        """Each driven net with its driving cell and pin."""
        for instance in self.instances:
            for pin, net in instance.nets.items():
                if instance.cell.pins[pin].direction == "output":
                    yield net, instance, pin


def _bits(bits: list[Any], nets: Mapping[Any, int]) -> list[Bit]:
    return [nets[bit] if isinstance(bit, int) else bit == "1" for bit in bits]
