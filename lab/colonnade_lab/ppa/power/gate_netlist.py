"""The netlist file of ``gates.cpp``: gates as truth tables with delays, registers and memories."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from colonnade.common.errors import UserError

from colonnade_lab.ppa.library.functions import truth_table
from colonnade_lab.ppa.netlist.hierarchy import Hierarchy
from colonnade_lab.ppa.netlist.mapped import Bit, Box, Instance, Netlist
from colonnade_lab.ppa.power.recording import CLOCK, Port

#: Extra inputs of a register behind a clock gate: the gate's enable, and the register itself.
_ENABLE, _HELD = "clock_gate_enables", "register_holds"


def lines(
    netlist: Netlist, hierarchy: Hierarchy, delays: Sequence[int], inputs: Sequence[Port], outputs: Sequence[Port]
) -> Iterator[str]:
    """The lines of the netlist file.

    Args:
        netlist: The gates.
        hierarchy: The hierarchy of the design, for the shapes of memories.
        delays: Delay of each net's driver, ps.
        inputs: The netlist's inputs without the clock, most significant first.
        outputs: The netlist's outputs, most significant first.

    Raises:
        UserError: The library has a register that is not a plain flip-flop.
        RuntimeError: A net has no driver, or a register has another clock.
    """
    require_all_driven(netlist)
    yield f"nets {netlist.size}"
    for port in reversed(inputs):
        yield from ("input -" if isinstance(bit, bool) else f"input {bit}" for bit in netlist.inputs[port.name])
    for port in reversed(outputs):
        yield from (f"output {_text(bit)}" for bit in netlist.outputs[port.name])
    yield from (f"tie {net} {value:d}" for net, value in netlist.ties.items())
    tables: dict[tuple[str, ...], str] = {}
    gates = dict(netlist.clock_gates())
    for net, instance, pin in netlist.drivers():
        if instance.cell.clock_gate:
            _require_clock(instance, instance.cell.clock_gate.clock, netlist)
            continue
        if instance.cell.is_register:
            yield _register(net, instance, pin, delays[net], netlist, gates, tables)
        else:
            table, nets = _function(instance, instance.cell.pins[pin].function, tables)
            yield f"gate {net} {delays[net]} {table} {nets}"
    for box in netlist.boxes:
        depth, width = hierarchy.shape(box.kind)
        yield f"memory {depth} {width}"
        yield from _ports(box)


def require_all_driven(netlist: Netlist) -> None:
    """Raise a `RuntimeError` if a net is read but not driven: then the parts of the netlist do not match."""
    driven = {net for net, _, _ in netlist.drivers()} | netlist.driven_outside | set(netlist.ties)
    read = set(netlist.read_outside)
    for instance in netlist.instances:
        read.update(net for pin, net in instance.nets.items() if instance.cell.pins[pin].direction == "input")
    missing = sorted(netlist.names.get(net, f"net {net}") for net in read - driven)
    if missing:
        raise RuntimeError(f"{len(missing)} nets of the gate netlist have no driver, such as {missing[0]}")


def _register(
    net: int,
    instance: Instance,
    pin: str,
    delay: int,
    netlist: Netlist,
    gates: Mapping[int, Bit],
    tables: dict[tuple[str, ...], str],
) -> str:
    """One output of a flip-flop. Its state starts at zero, as in the simulated RTL.

    Behind a clock gate, one of `gates`, it keeps its value unless the gate is enabled.
    """
    cell, state = instance.cell, instance.cell.flip_flop
    if state is None or re.search(rf"\b({state.name}|{state.inverse})\b", state.next_state):
        raise UserError(f"{cell.name} of the liberty is not a plain flip-flop, which power estimation needs")
    clock = instance.nets.get(state.clock, -1)
    if clock not in gates:
        _require_clock(instance, state.clock, netlist)
    function = re.sub(rf"\b{state.inverse}\b", f"(!{state.name})", cell.pins[pin].function)
    following = re.sub(rf"\b{state.name}\b", f"({state.next_state})", function)
    first = _function(instance, following, tables)[0][0]
    if clock in gates:
        enable = gates[clock]
        wires = {_HELD: net} | ({} if isinstance(enable, bool) else {_ENABLE: enable})
        ties = {_ENABLE: enable} if isinstance(enable, bool) else {}
        instance = replace(instance, nets=instance.nets | wires, ties=instance.ties | ties)
        following = f"({_ENABLE} & ({following})) | (!{_ENABLE} & {_HELD})"
    table, nets = _function(instance, following, tables)
    return f"register {net} {delay} {first} {table} {nets}"


def _require_clock(instance: Instance, pin: str, netlist: Netlist) -> None:
    if [instance.nets.get(pin)] != netlist.inputs[CLOCK]:
        raise RuntimeError(f"the register {instance.name or instance.cell.name} is not driven by the port {CLOCK}")


def _function(instance: Instance, function: str, tables: dict[tuple[str, ...], str]) -> tuple[str, str]:
    """The truth table of a function over the nets of an instance, and these nets."""
    pins = [pin for pin in sorted(set(re.findall(r"[A-Za-z_]\w*", function))) if pin in instance.nets]
    ties = tuple(f"{pin}={value:d}" for pin, value in sorted(instance.ties.items()))
    key = (function, *pins, *ties)
    if key not in tables:
        for pin, value in instance.ties.items():
            function = re.sub(rf"\b{pin}\b", f"{value:d}", function)
        tables[key] = truth_table(function, pins)
    return tables[key], " ".join(str(instance.nets[pin]) for pin in pins)


def _ports(box: Box) -> Iterator[str]:
    """The port lines of a firtool memory."""
    kinds = sorted({port.split("_")[0] for port in box.ports})
    if any("mask" in port for port in box.ports) or not all(re.fullmatch(r"(RW|R|W)\d+", kind) for kind in kinds):
        raise RuntimeError(f"memory {box.kind} has ports that the replay does not support: {', '.join(box.ports)}")
    for kind in kinds:
        address = _joined(box.ports[f"{kind}_addr"])
        # A port that is always enabled has none
        enable = _joined(box.ports.get(f"{kind}_en", [True]))
        if kind.startswith("RW"):
            writes, into, out = (_joined(box.ports[f"{kind}_{role}"]) for role in ("wmode", "wdata", "rdata"))
        elif kind.startswith("R"):
            writes, into, out = "0", "-", _joined(box.ports[f"{kind}_data"])
        else:
            writes, into, out = "1", _joined(box.ports[f"{kind}_data"]), "-"
        yield f"port {address} {enable} {writes} {into} {out}"


def _joined(bits: Sequence[Bit]) -> str:
    return ",".join(_text(bit) for bit in bits) or "-"


def _text(bit: Bit) -> str:
    return f"{bit:d}" if isinstance(bit, bool) else f"n{bit}"
