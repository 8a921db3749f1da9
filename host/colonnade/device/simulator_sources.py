"""Sources of a simulator: Verilator models of unit, column, some parts of it, and device, and their coupling.

Verilator generates C++ for each instance of a module, about 170 MB for 80 traversal units. So unit and column are
separate models, and each instance is an object. A module is *opened*: its inner instances are removed, and variables
replace their ports. `PathTracer`, a part of the column, is opened for the units, and the device for the columns.

One evaluation of each unit and a few of columns and device simulate a cycle exactly, by three properties of the RTL:

1. A unit's outputs depend combinationally only on inputs that a register drives.
2. These are all inputs except the *direct* ones (`DIRECT`).
3. A column's outputs to the device depend combinationally on the device's outputs only through the pixel stream.

In each cycle all models settle first: device, columns, device, columns. Then the clock edge of the device, the columns
and the units follows. Between the last two, all inputs of a unit except the direct ones are copied into registers
around the unit. So the unit sees them in the same cycle as the column's registers. The harness checks the coupling at
run time (``Array::check``). All models clock on both edges (`both_edges`): a cycle takes one evaluation of a unit, not
two.

A large *part* of a column (`PARTS`) is also a model. Its outputs may depend combinationally on its inputs: it
and its column are evaluated until both settle.

Verilator evaluates all that depends on an input in each evaluation. So inputs go into registers that an *event* clocks,
a variable which the harness flips if one of them has changed: around column and part (`held_model`), and for the
variables of an opened module. Units and parts that stand still are not evaluated at all (``still.hpp``).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

#: A column has a unit in each row, in its path tracer.
UNIT, TRACER, COLUMN, DEVICE = "TraversalUnit", "PathTracer", "Column", "Colonnade"

#: The wrappers with registers at the inputs of unit and column. The module is the instance ``inner``.
UNIT_MODEL, COLUMN_MODEL = "UnitModel", "ColumnModel"

#: The modules that have the units and the columns, and their names in the models of column and device.
IN_COLUMN = f"{COLUMN_MODEL}__DOT__inner"
PARENTS = ((TRACER, f"{IN_COLUMN}__DOT__tracer"), (DEVICE, DEVICE))

#: Of a device for rays, whose modules get the names of a device's.
RAY_PARENTS = ((COLUMN, IN_COLUMN), ("RayArray", f"{DEVICE}__DOT__RayArray"))
RENAMED = {"RayColumn": COLUMN, "ColonnadeRays": DEVICE}

#: Inputs of a unit that depend combinationally on its outputs or on the device's inputs.
DIRECT = re.compile(r"reset|io_start|io_\w*_ready(Next)?")

#: Parts of a column that take much of a frame's time and often stand still, if all instances together have so many
#: characters of Verilog. A unit's inputs must not come from a part: it would see them a cycle late.
PARTS = ("RtController", "EnvironmentMarches", "BounceUnit")
PART_SIZE = 150_000

#: Prefix of the inputs that change only while no frame runs.
FRAME_REGISTERS = "io_registers_"

_PORT = re.compile(r"(?:(input|output)\s*)?(?:\[(\d+):0\])?\s*(\w+)")
_CONNECTION = re.compile(r"\.(\w+)\s*\(((?:[^()]|\([^()]*\))*)\)")
_INSTANCE = re.compile(r"^  (\w+) (\w+) \(", re.MULTILINE)
_BIND = re.compile(r"^bind (\w+) (\w+) ", re.MULTILINE)
_RECORDS = re.compile(r"^  records_\w+ (records_(?:\d+_)?ext) \(", re.MULTILINE)
_RECORDS_ARRAY = re.compile(r"(reg \[\d+:0\] Memory\[0:\d+\]);")


@dataclass(frozen=True)
class Port:
    """A port of a module.

    Attributes:
        name: Name in Verilog.
        is_input: Input, not output.
        bits: Width.
    """

    name: str
    is_input: bool
    bits: int

    @property
    def range(self) -> str:
        """The range in a Verilog declaration."""
        return f"[{self.bits - 1}:0] " if self.bits > 1 else ""

    @property
    def cpp_type(self) -> str:
        """The type that Verilator gives a variable of this width."""
        for maximum, name in ((8, "CData"), (16, "SData"), (32, "IData"), (64, "QData")):
            if self.bits <= maximum:
                return name
        return f"VlWide<{(self.bits + 31) // 32}>"

    @property
    def kind(self) -> str:
        """The port list of the coupling that the port belongs to."""
        if not self.is_input:
            return "OUTPUTS"
        if self.name.startswith(FRAME_REGISTERS):
            return "REGISTERS"
        return "DIRECT" if DIRECT.fullmatch(self.name) else "INPUTS"


def both_edges(verilog: str) -> str:
    """The same modules with registers clocked on both edges: each change of the clock is a cycle."""
    return re.sub(r"@\(posedge (\w+)\)", r"@(edge \1)", verilog)


def renamed(verilog: str) -> str:
    """Modules of a device for rays by the names of a device's."""
    return re.sub(rf"\b({'|'.join(RENAMED)})\b", lambda match: RENAMED[match[0]], verilog)


def module_ports(verilog: str, module: str) -> list[Port]:
    """The ports of a module as firtool writes them, without the clock."""
    header = re.search(rf"^module {module}\((.*?)\n\);", verilog, re.DOTALL | re.MULTILINE)
    if header is None:
        raise ValueError(f"the Verilog has no module {module} with ports")
    ports: list[Port] = []
    is_input, bits = True, 1
    for text in header.group(1).split(","):
        match = _PORT.fullmatch(text.strip())
        if match is None:
            raise ValueError(f"cannot parse a port of {module}: {text.strip()}")
        direction, top_bit, name = match.groups()
        is_input = is_input if direction is None else direction == "input"
        if direction is not None or top_bit is not None:
            bits = int(top_bit or 0) + 1
        ports.append(Port(name, is_input, bits))
    return [port for port in ports if port.name != "clock"]


def held_model(model: str, inner: str, ports: Iterable[Port], events: Mapping[str, str]) -> str:
    """Verilog of the module `model`: the module `inner` with a register at each input of some kinds.

    Args:
        model: Its name.
        inner: The module.
        ports: Its ports.
        events: What clocks the registers, by kind: ``clock``, or an input of the model.
    """
    declarations, registers, connections = ["  input clock"], [], ["    .clock(clock)"]
    declarations += [f"  input {event}" for event in sorted(set(events.values()) - {"clock"})]
    for port in ports:
        declarations.append(f"  {'input' if port.is_input else 'output'} {port.range}{port.name}")
        source = port.name
        if port.kind in events:
            source = f"held_{port.name}"
            registers.append(_held(port, source, events[port.kind], port.name))
        connections.append(f"    .{port.name}({source})")
    header = f"module {model}(\n" + ",\n".join(declarations) + "\n);\n"
    return header + "".join(registers) + f"  {inner} inner (\n" + ",\n".join(connections) + "\n  );\nendmodule\n"


def _held(port: Port, name: str, event: str, source: str) -> str:
    return f"  reg {port.range}{name};\n  always @(edge {event}) {name} <= {source};\n"


@dataclass(frozen=True)
class Opened:
    """An outer module whose inner instances are removed; variables replace their ports.

    Attributes:
        verilog: Verilog of the outer module.
        module: Name of the outer module.
        ports: Connected ports of an instance.
        count: Number of instances.
        shared: Inputs with the same connection at all instances; they share one variable.
        inner: The module of the instances.
        has_one_event: Whether one variable flips if outputs of any instance have changed, not one for each instance.
    """

    verilog: str
    module: str
    ports: tuple[Port, ...]
    count: int
    shared: frozenset[str]
    inner: str
    has_one_event: bool

    def variable(self, instance: int, port: Port) -> str:
        """The Verilog variable that replaces a port of an instance."""
        return _variable(self.inner, self.shared, instance, port)

    def event(self, instance: int) -> str:
        """The Verilog variable that flips if an output of an instance has changed."""
        return _event(self.inner, instance, self.has_one_event)


def _variable(inner: str, shared: frozenset[str], instance: int, port: Port) -> str:
    return f"{inner}_{'shared' if port.name in shared else instance}_{port.name}"


def _event(inner: str, instance: int, has_one_event: bool) -> str:
    return f"{inner}_event" if has_one_event else f"{inner}_{instance}_event"


def open_module(verilog: str, module: str, inner: str, ports: Sequence[Port], has_one_event: bool) -> Opened:
    """Remove the instances of `inner`, which has these ports, from a module's Verilog (`Opened`)."""
    instances = list(re.finditer(rf"^  {inner} \w+ \((.*?)\n  \);\n", verilog, re.DOTALL | re.MULTILINE))
    if not instances:
        raise ValueError(f"module {module} has no instance of {inner}")
    connections = [{n: e.strip() for n, e in _CONNECTION.findall(instance.group(1))} for instance in instances]
    wired = tuple(port for port in ports if not connections[0][port.name].startswith("/*"))
    shared = frozenset(
        port.name for port in wired if port.is_input and len({each[port.name] for each in connections}) == 1
    )
    text, end, declared = "", 0, set[str]()
    for number, instance in enumerate(instances):
        text += verilog[end : instance.start()]
        end = instance.end()
        for port in wired:
            name, expression = _variable(inner, shared, number, port), connections[number][port.name]
            if name in declared:
                continue
            declared.add(name)
            if port.is_input:
                text += f"  wire {port.range}{name} /*verilator public_flat_rd*/ = {expression};\n"
            else:
                text += f"  reg {port.range}{name} /*verilator public_flat_rw*/;\n"
                text += _held(port, f"held_{name}", _event(inner, number, has_one_event), name)
                text += f"  assign {expression} = held_{name};\n"
    events = dict.fromkeys(_event(inner, number, has_one_event) for number in range(len(instances)))
    declared_events = "".join(f"  reg {event} /*verilator public_flat_rw*/;\n" for event in events)
    text = text.replace("\n);\n", f"\n);\n{declared_events}", 1)
    return Opened(text + verilog[end:], module, wired, len(instances), shared, inner, has_one_event)


def coupling(opened: Opened, inner: str, model: str, path: str) -> str:
    """C++ code that gives the harness access to the variables of an opened module, at a path in a model.

    ``INNER_OUTPUTS(DO)``, ``_DIRECT``, ``_INPUTS`` and ``_REGISTERS`` expand ``DO(port)`` for each port of the kind.
    ``INNERVariables`` has a pointer for each port, and ``event``; ``bindINNER(root)`` returns one per instance.
    """
    lines = [
        f"#define {inner}_{kind}(DO) " + " ".join(f"DO({port.name})" for port in opened.ports if port.kind == kind)
        for kind in ("OUTPUTS", "DIRECT", "INPUTS", "REGISTERS")
    ]
    members = (f"    {port.cpp_type}* {port.name};" for port in opened.ports)
    lines += [f"struct {inner}Variables {{", *members, "    CData* event;", "};"]
    lines.append(f"inline std::vector<{inner}Variables> bind{inner}(V{model}___024root& root) {{\n    return {{")
    for number in range(opened.count):
        variables = (f"&root.{path}__DOT__{opened.variable(number, port)}" for port in opened.ports)
        lines.append("        {" + ", ".join([*variables, f"&root.{path}__DOT__{opened.event(number)}"]) + "},")
    return "\n".join([*lines, "    };", "}"]) + "\n"


def record_banks(verilog: str | None) -> str:
    """C++ macro ``RECORD_BANKS(DO)``, which expands ``DO(memory)`` for each bank of a column's memory, in order.

    Args:
        verilog: The module ColumnBvhMemory; None: the columns have caches.
    """
    found = [] if verilog is None else _RECORDS.findall(verilog)
    banks = [f"DO({IN_COLUMN}__DOT__memory__DOT__{bank}__DOT__Memory)" for bank in found]
    return f"constexpr unsigned banksOfColumn = {len(banks) or 1};\n#define RECORD_BANKS(DO) {' '.join(banks)}\n"


def write_sources(sources: Iterable[Path], folder: Path, parts: Sequence[str] = ()) -> dict[str, list[Path]]:
    """Write the Verilog of the models and their ``coupling.hpp`` into a folder.

    Args:
        sources: The design's files, named after their modules.
        folder: Gets a folder for each model.
        parts: Modules, of which those in a column become models: of `PARTS`.

    Returns:
        The files of each model by top module: `UNIT_MODEL`, the parts, `COLUMN_MODEL`, `DEVICE`.
    """
    verilog = {path.stem: both_edges(path.read_text()) for path in sources}
    (of_units, units_path), (of_columns, columns_path) = RAY_PARENTS if RENAMED.keys() <= verilog.keys() else PARENTS
    verilog = {RENAMED.get(module, module): renamed(text) for module, text in verilog.items()}
    places = {part: place for part in parts if (place := _place(verilog, part)) is not None}
    ports = {module: module_ports(verilog[module], module) for module in (UNIT, COLUMN, *places)}
    coupled = [(of_units, UNIT, "Unit", COLUMN_MODEL, units_path), (of_columns, COLUMN, COLUMN, DEVICE, columns_path)]
    coupled += [(parent, part, part, COLUMN_MODEL, path) for part, (parent, path) in places.items()]
    header = "#pragma once\n" + record_banks(verilog.get("ColumnBvhMemory"))
    header += "".join(f'#include "V{part}Model.h"\n#include "V{part}Model___024root.h"\n' for part in places)
    header += f"#define EACH_PART(DO) {' '.join(f'DO({part})' for part in places)}\n"
    for parent, inner, name, model, path in coupled:
        opened = open_module(verilog[parent], parent, inner, ports[inner], inner not in places)
        verilog[parent] = opened.verilog
        header += coupling(opened, name, model, path)
    (folder / "coupling.hpp").write_text(header)
    for module in verilog:
        if module.startswith("records_"):
            verilog[module] = _RECORDS_ARRAY.sub(r"\1 /*verilator public_flat_rw*/;", verilog[module])
    clocked = {"REGISTERS": "clock", "INPUTS": "clock"}
    taken = {"REGISTERS": "takeRegisters", "INPUTS": "take", "DIRECT": "take"}
    models = {UNIT_MODEL: held_model(UNIT_MODEL, UNIT, ports[UNIT], clocked)}
    for part in places:
        models[f"{part}Model"] = held_model(f"{part}Model", part, ports[part], dict.fromkeys(taken, "take"))
    models[COLUMN_MODEL] = held_model(COLUMN_MODEL, COLUMN, ports[COLUMN], taken)
    verilog |= models
    return {top: list(_written(verilog, top, folder / top)) for top in (*models, DEVICE)}


def large_parts(sources: Iterable[Path]) -> list[str]:
    """The `PARTS` that are large enough to be worth the compilation of a model."""
    verilog = {path.stem: path.read_text() for path in sources}
    instances = Counter(inner for text in verilog.values() for inner, _ in _INSTANCE.findall(text))
    sizes = {part: sum(len(verilog[module]) for module in _below(verilog, part)) for part in PARTS}
    return [part for part in PARTS if instances[part] * sizes[part] >= PART_SIZE]


def _place(verilog: Mapping[str, str], part: str) -> tuple[str, str] | None:
    """The module that has the instances of a part, and its path in the column's model; None: not in one place of it."""
    places, pending = list[tuple[str, str]](), [(COLUMN, IN_COLUMN)]
    while pending:
        module, path = pending.pop()
        instances = _INSTANCE.findall(verilog.get(module, ""))
        if any(inner == part for inner, _ in instances):
            places.append((module, path))
        pending += [(inner, f"{path}__DOT__{name}") for inner, name in instances]
    return places[0] if len(places) == 1 else None


def _below(verilog: Mapping[str, str], top: str) -> set[str]:
    """A module and all below it that have Verilog."""
    found, pending = set[str](), [top]
    while pending:
        module = pending.pop()
        if module in found or module not in verilog:
            continue
        found.add(module)
        pending += [inner for inner, _ in _INSTANCE.findall(verilog[module])]
    return found


def _written(verilog: dict[str, str], top: str, folder: Path) -> Iterator[Path]:
    """Write the files of a module and of all modules below it."""
    folder.mkdir()
    found = _below(verilog, top)
    # Bound modules must come before the module they are bound to: see ppa.power.recording
    binders = {name for name, text in verilog.items() if {module for module, _ in _BIND.findall(text)} & found}
    for module in sorted(binders | found, key=lambda name: (name not in binders, name)):
        (folder / f"{module}.sv").write_text(verilog[module])
        yield folder / f"{module}.sv"
