"""Sources of a simulator: Verilator models of unit, column and device, and their coupling.

Verilator generates C++ for each instance of a module, about 170 MB for 80 traversal units. So unit and column are
separate models, and each instance is an object. A module is *opened*: its inner instances are removed, and variables
replace their ports. `PathTracer`, a part of the column, is opened for the units, and the device for the columns.

One evaluation of each unit and a few of columns and device simulate a cycle exactly, by three properties of the RTL:

1. A unit's outputs depend combinationally only on inputs that a register drives.
2. These are all inputs except the *direct* ones (`DIRECT`).
3. A column's outputs to the device depend combinationally on the device's outputs only through the pixel stream.

In each cycle all models settle first: device, columns, device. Then the clock edge of the device, the columns and the
units follows. Between the last two, all inputs of a unit except the direct ones are copied into registers around the
unit (`UNIT_MODEL`). So the unit sees them in the same cycle as the column's registers. The harness checks the coupling
at run time (``Array::check``). All models clock on both edges (`both_edges`): a cycle takes one evaluation of a unit,
not two.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

#: A column has a unit in each row, in its path tracer.
UNIT, TRACER, COLUMN, DEVICE = "TraversalUnit", "PathTracer", "Column", "Colonnade"

#: The modules that have the units and the columns, and their names in the models of column and device.
PARENTS = ((TRACER, f"{COLUMN}__DOT__tracer"), (DEVICE, DEVICE))

#: Of a device for rays, whose modules get the names of a device's.
RAY_PARENTS = ((COLUMN, COLUMN), ("RayArray", f"{DEVICE}__DOT__RayArray"))
RENAMED = {"RayColumn": COLUMN, "ColonnadeRays": DEVICE}

#: The wrapper with registers at the unit's inputs.
UNIT_MODEL = "UnitModel"

#: Inputs of a unit that depend combinationally on its outputs or on the device's inputs.
DIRECT = re.compile(r"reset|io_start|io_\w*_ready(Next)?")

#: Prefix of the inputs that change only while no frame runs.
FRAME_REGISTERS = "io_registers_"

_PORT = re.compile(r"(?:(input|output)\s*)?(?:\[(\d+):0\])?\s*(\w+)")
_CONNECTION = re.compile(r"\.(\w+)\s*\(((?:[^()]|\([^()]*\))*)\)")
_INSTANCE = re.compile(r"^  (\w+) \w+ \(", re.MULTILINE)
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


def unit_model(unit: str, ports: Iterable[Port]) -> str:
    """Verilog of `UNIT_MODEL`: the module `unit` with a register at each input that is not direct."""
    declarations, registers, connections = ["  input clock"], [], ["    .clock(clock)"]
    for port in ports:
        declarations.append(f"  {'input' if port.is_input else 'output'} {port.range}{port.name}")
        source = port.name
        if port.kind in ("REGISTERS", "INPUTS"):
            source = f"held_{port.name}"
            registers.append(f"  reg {port.range}{source};\n  always @(edge clock) {source} <= {port.name};\n")
        connections.append(f"    .{port.name}({source})")
    header = f"module {UNIT_MODEL}(\n" + ",\n".join(declarations) + "\n);\n"
    return header + "".join(registers) + f"  {unit} unit (\n" + ",\n".join(connections) + "\n  );\nendmodule\n"


@dataclass(frozen=True)
class Opened:
    """An outer module whose inner instances are removed; variables replace their ports.

    Attributes:
        verilog: Verilog of the outer module.
        module: Name of the outer module.
        ports: Connected ports of an instance.
        count: Number of instances.
        shared: Inputs with the same connection at all instances; they share one variable.
    """

    verilog: str
    module: str
    ports: tuple[Port, ...]
    count: int
    shared: frozenset[str]

    def variable(self, instance: int, port: Port) -> str:
        """The Verilog variable that replaces a port of an instance."""
        return _variable(self.shared, instance, port)


def _variable(shared: frozenset[str], instance: int, port: Port) -> str:
    return f"shared_{port.name}" if port.name in shared else f"instance{instance}_{port.name}"


def open_module(verilog: str, module: str, inner: str, ports: Sequence[Port]) -> Opened:
    """Remove the instances of `inner`, which has these ports, from a module's Verilog."""
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
            name, expression = _variable(shared, number, port), connections[number][port.name]
            if name in declared:
                continue
            declared.add(name)
            if port.is_input:
                text += f"  wire {port.range}{name} /*verilator public_flat_rd*/ = {expression};\n"
            else:
                text += f"  reg {port.range}{name} /*verilator public_flat_rw*/;\n  assign {expression} = {name};\n"
    return Opened(text + verilog[end:], module, wired, len(instances), shared)


def coupling(opened: Opened, inner: str, model: str, path: str) -> str:
    """C++ code that gives the harness access to the variables of an opened module, at a path in a model.

    ``INNER_OUTPUTS(DO)``, ``_DIRECT``, ``_INPUTS`` and ``_REGISTERS`` expand ``DO(port)`` for each port of the kind.
    ``INNERVariables`` has a pointer for each port, and ``bindINNER(root)`` returns one per instance.
    """
    lines = [
        f"#define {inner}_{kind}(DO) " + " ".join(f"DO({port.name})" for port in opened.ports if port.kind == kind)
        for kind in ("OUTPUTS", "DIRECT", "INPUTS", "REGISTERS")
    ]
    lines += [f"struct {inner}Variables {{", *(f"    {port.cpp_type}* {port.name};" for port in opened.ports), "};"]
    lines.append(f"inline std::vector<{inner}Variables> bind{inner}(V{model}___024root& root) {{\n    return {{")
    for number in range(opened.count):
        variables = (f"&root.{path}__DOT__{opened.variable(number, port)}" for port in opened.ports)
        lines.append("        {" + ", ".join(variables) + "},")
    return "\n".join([*lines, "    };", "}"]) + "\n"


def record_banks(verilog: str | None) -> str:
    """C++ macro ``RECORD_BANKS(DO)``, which expands ``DO(memory)`` for each bank of a column's memory, in order.

    Args:
        verilog: The module ColumnBvhMemory; None: the columns have caches.
    """
    found = [] if verilog is None else _RECORDS.findall(verilog)
    banks = [f"DO({COLUMN}__DOT__memory__DOT__{bank}__DOT__Memory)" for bank in found]
    return f"constexpr unsigned banksOfColumn = {len(banks) or 1};\n#define RECORD_BANKS(DO) {' '.join(banks)}\n"


def write_sources(sources: Iterable[Path], folder: Path) -> dict[str, list[Path]]:
    """Write the Verilog of the models and their ``coupling.hpp`` into a folder.

    Returns:
        The files of each model by top module: `UNIT_MODEL`, `COLUMN`, `DEVICE`.
    """
    verilog = {path.stem: both_edges(path.read_text()) for path in sources}
    (of_units, units_path), (of_columns, columns_path) = RAY_PARENTS if RENAMED.keys() <= verilog.keys() else PARENTS
    verilog = {RENAMED.get(module, module): renamed(text) for module, text in verilog.items()}
    ports = {module: module_ports(verilog[module], module) for module in (UNIT, COLUMN)}
    opened = [
        (open_module(verilog[of_units], of_units, UNIT, ports[UNIT]), "Unit", COLUMN, units_path),
        (open_module(verilog[of_columns], of_columns, COLUMN, ports[COLUMN]), COLUMN, DEVICE, columns_path),
    ]
    header = "#pragma once\n" + record_banks(verilog.get("ColumnBvhMemory"))
    (folder / "coupling.hpp").write_text(header + "".join(coupling(*each) for each in opened))
    for module in verilog:
        if module.startswith("records_"):
            verilog[module] = _RECORDS_ARRAY.sub(r"\1 /*verilator public_flat_rw*/;", verilog[module])
    verilog |= {UNIT_MODEL: unit_model(UNIT, ports[UNIT]), **{each.module: each.verilog for each, *_ in opened}}
    return {top: list(_written(verilog, top, folder / top)) for top in (UNIT_MODEL, COLUMN, DEVICE)}


def _written(verilog: dict[str, str], top: str, folder: Path) -> Iterator[Path]:
    """Write the files of a module and of all modules below it."""
    folder.mkdir()
    found, pending = set[str](), [top]
    while pending:
        module = pending.pop()
        if module in found or module not in verilog:
            continue
        found.add(module)
        pending += _INSTANCE.findall(verilog[module])
    # Bound modules must come before the module they are bound to: see ppa.power.recording
    binders = {name for name, text in verilog.items() if {module for module, _ in _BIND.findall(text)} & found}
    for module in sorted(binders | found, key=lambda name: (name not in binders, name)):
        (folder / f"{module}.sv").write_text(verilog[module])
        yield folder / f"{module}.sv"
