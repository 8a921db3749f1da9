"""Reads standard cells from liberty files.

Files are first pruned to what is used here, which also saves Yosys most of its reading: current-source models, power
and noise go, and so do cells that ordinary logic should not be mapped to.
"""

from __future__ import annotations

import contextlib
import gzip
import io
import math
import re
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path

from colonnade.common.errors import UserError, reason_of
from colonnade.common.input_files import is_folder, read_input, require_regular
from colonnade.common.limits import MAX_LIBERTY_BYTES
from colonnade.ppa.library.cells import Arc, Cell, ClockGate, Library, LookupTable, Pin, State

#: Cells for scan, power domains and probing; delay cells.
AVOIDED = (
    *("*lpflow*", "*probe*", "*sdlclk*", "*sparecell*", "*dlygate*", "*dlymetal*", "*clkdly*"),
    *("*__sdf*", "*__sedf*", "*__edf*", "*__dfbb*", "SDF*"),
)

_DROPPED = re.compile(
    r"(?P<comment>/\*.*?\*/)|(?P<string>\"[^\"]*\")|"
    r"(?P<group>\b(?P<name>\w+)\s*\((?P<argument>[^(){}]*)\)\s*\{)|(?P<open>\{)|(?P<close>\})",
    re.DOTALL,
)
_ALWAYS_DROPPED = (
    r"output_current_\w+|receiver_capacitance\w*|ccs\w*|test_cell|normalized_driver_waveform|wire_load\w*|"
    r"hyperbolic_noise\w*|dc_current|min_pulse_width"
)
#: Groups that go from a liberty, by what it is read for.
FOR_TIMING = re.compile(rf"{_ALWAYS_DROPPED}|internal_power|leakage_power|pg_pin")
FOR_POWER = re.compile(rf"{_ALWAYS_DROPPED}|timing")
_TOKEN = re.compile(r"/\*.*?\*/|//[^\n]*|\\\n|\s+|(\"[^\"]*\"|[{}();:,]|[^\s{}();:,\"]+)", re.DOTALL)


def find_liberties(names: Sequence[str]) -> tuple[Path, ...]:
    """The files that ``--liberty`` names: files, or folders of them."""
    found: list[Path] = []
    for name in names:
        path = Path(name)
        if is_folder(path):
            try:
                inside = sorted(p for p in path.iterdir() if re.search(r"\.lib(\.gz)?$", p.name))
            except OSError as error:
                raise UserError(f"cannot search {path}: {reason_of(error)}") from None
            if not inside:
                raise UserError(f"{name} holds no .lib and no .lib.gz file: name another folder for --liberty")
            found += inside
        else:
            require_regular(path, "the liberty", f"no liberty {name}: name a .lib or .lib.gz file, or a folder of them")
            found.append(path)
    return tuple(found)


def _text(path: Path) -> str:
    """The text of a file, unpacked if it is compressed."""
    data = read_input(path, "the liberty", MAX_LIBERTY_BYTES)
    if path.suffix == ".gz":
        try:
            with gzip.open(io.BytesIO(data)) as stream:
                data = stream.read(MAX_LIBERTY_BYTES + 1)
        except (OSError, EOFError, zlib.error) as error:
            raise UserError(f"{path} cannot be unpacked: {error}") from None
        if len(data) > MAX_LIBERTY_BYTES:
            raise UserError(f"{path} is too large: unpacked it may have {MAX_LIBERTY_BYTES:,} bytes")
    return data.decode("latin-1")


def pruned(path: Path, dropped: re.Pattern[str] = FOR_TIMING) -> str:
    """The text of a liberty without the groups and the cells that are of no use here."""
    text = _text(path)
    if not re.search(r"\blibrary\s*\(", text):
        raise UserError(f"{path} is no liberty: it holds no library group")
    if text.rfind("/*") > text.rfind("*/"):
        raise UserError(f"{path} is cut off or no liberty: a comment does not end")
    kept: list[str] = []
    begin = depth = dropped_from = 0
    for token in _DROPPED.finditer(text):
        if token["group"] or token["open"]:
            depth += 1
            if token["group"] and not dropped_from and _is_dropped(token["name"], token["argument"], dropped):
                kept.append(text[begin : token.start()])
                dropped_from = depth
        elif token["close"]:
            if dropped_from == depth:
                begin, dropped_from = token.end(), 0
            depth -= 1
        elif token["comment"] and not dropped_from:
            kept.append(text[begin : token.start()])
            begin = token.end()
    kept.append(text[begin:])
    if depth != 0:
        raise UserError(f"{path} is cut off or no liberty: its braces do not match")
    # Wire load models are among the groups that went
    text = re.sub(r"default_wire_load\w*\s*:[^;]*;", "", "".join(kept))
    return re.sub(r"\n\s*\n+", "\n", text)


def _is_dropped(group: str, argument: str, dropped: re.Pattern[str]) -> bool:
    name = argument.strip().strip('"')
    is_avoided = group == "cell" and any(fnmatch(name, pattern) for pattern in AVOIDED)
    return is_avoided or dropped.fullmatch(group) is not None


def load(paths: Sequence[Path]) -> Library:
    """Read pruned files."""
    cells: dict[str, Cell] = {}
    for path in paths:
        with understood(path):
            top = next(groups(tokens(path.read_text("latin-1"))))
            cells.update(Reader(top).cells())
    return Library(tuple(paths), cells)


@contextlib.contextmanager
def understood(path: Path) -> Iterator[None]:
    """One line for values that are missing, or no numbers, in a file that looks like a liberty."""
    try:
        yield
    except (ValueError, KeyError, IndexError, TypeError, StopIteration, ZeroDivisionError, RuntimeError) as error:
        reason = f"{type(error).__name__}: {error}".rstrip(": ")
        raise UserError(f"{path.name} is no liberty that can be used: {reason}") from None


@dataclass
class Group:
    """A group: its name and arguments, its attributes by name, simple and complex, and the groups in it."""

    name: str
    arguments: list[str]
    values: dict[str, list[str]] = field(default_factory=dict)
    groups: list[Group] = field(default_factory=list)

    def of(self, *names: str) -> Iterator[Group]:
        """The groups in it that have one of these names."""
        return (group for group in self.groups if group.name in names)

    def text(self, name: str, default: str = "") -> str:
        """A simple attribute."""
        return self.values.get(name, [default])[0].strip('"').strip()


def tokens(text: str) -> Iterator[str]:
    """The words of a liberty, without comments."""
    return (token[1] for token in _TOKEN.finditer(text) if token[1] is not None)


def groups(tokens: Iterator[str]) -> Iterator[Group]:
    """Groups at the top; attributes, simple and complex, become values of their group."""
    stack = [Group("", [])]
    words: list[str] = []
    for token in tokens:
        if token == "{":
            stack.append(Group(words[0], [word for word in words[1:] if word not in "(),"]))
            stack[-2].groups.append(stack[-1])
            words = []
        elif token in ";}":
            if len(words) > 1:
                stack[-1].values[words[0]] = [word for word in words[1:] if word not in "(),:"]
            words = []
            if token == "}":
                closed = stack.pop()
                if len(stack) == 1:
                    yield closed
        elif token == ":" or token == "(" or not words or words[-1] in ("(", ",", ":") or token in "),":
            words.append(token)
        elif len(words) > 2 and words[-1] == ")":
            # A complex attribute without its semicolon
            stack[-1].values[words[0]] = [word for word in words[1:] if word not in "(),"]
            words = [token]
        elif len(words) > 2 and words[1] == ":":
            # A simple one
            if _is_operator(words[-1]) or _is_operator(token):
                words.append(token)
            else:
                stack[-1].values[words[0]] = words[2:]
                words = [token]
        else:
            words.append(token)


def _is_operator(word: str) -> bool:
    return word in "+-*/"


class Reader:
    """Turns the groups of one library into cells, in ns and pF."""

    def __init__(self, library: Group) -> None:
        self._library = library
        self.time = unit(library, "time_unit", "1ns", {"ps": 1e-3, "ns": 1.0})
        amount, farads = (*library.values.get("capacitive_load_unit", []), "1", "pf")[:2]
        self.load = _finite(amount) * {"ff": 1e-3, "pf": 1.0}[farads.strip('"').lower()]
        kinds = ("lu_table_template", "power_lut_template")
        self._templates = {template.arguments[0]: template for template in library.of(*kinds)}

    def cells(self) -> Iterator[tuple[str, Cell]]:
        """All cells that may be used, with their names."""
        for group in self._library.of("cell"):
            name = group.arguments[0].strip('"')
            if group.text("dont_use") == "true":
                continue
            pins = {pin.name: pin for part in group.of("pin") for pin in [self._pin(part)]}
            is_register = any(True for _ in group.of("ff", "latch", "statetable"))
            area = _finite(group.text("area", "0"))
            yield name, Cell(name, area, is_register, pins, _state(group), _clock_gate(group))

    def _pin(self, group: Group) -> Pin:
        arcs = tuple(self._arc(timing) for timing in group.of("timing"))
        capacitance = _finite(group.text("capacitance", "0")) * self.load
        return Pin(group.arguments[0].strip('"'), group.text("direction"), capacitance, group.text("function"), arcs)

    def _arc(self, group: Group) -> Arc:
        tables = {table.name: self.table(table, self.time) for table in group.groups if table.values.get("values")}
        sense = group.text("timing_sense", "non_unate")
        return Arc(group.text("related_pin"), group.text("timing_type", "combinational"), sense, tables)

    def table(self, group: Group, scale: float) -> LookupTable:
        """A table with its values times `scale`.

        Slew, or a constrained pin's slew, becomes `slews`; load, or the clock's slew, becomes `loads`.
        """
        template = self._templates.get(group.arguments[0]) if group.arguments else None
        axes: dict[str, tuple[float, ...]] = {}
        for number in ("1", "2"):
            variable = template.text(f"variable_{number}") if template else ""
            words = group.values.get(f"index_{number}") or (template and template.values.get(f"index_{number}"))
            if variable and words:
                unit_of_axis = self.load if "capacitance" in variable else self.time
                name = "loads" if "capacitance" in variable or "related" in variable else "slews"
                axes[name] = tuple(unit_of_axis * value for value in _numbers(words))
        slews, loads = axes.get("slews", (0.0,)), axes.get("loads", (0.0,))
        flat = [scale * value for value in _numbers(group.values["values"])]
        if len(flat) != len(slews) * len(loads):
            raise ValueError(f"a table has {len(flat)} values for {len(slews)} by {len(loads)} points")
        if next(iter(axes), "slews") == "slews":
            values = tuple(tuple(flat[i * len(loads) : (i + 1) * len(loads)]) for i in range(len(slews)))
        else:
            values = tuple(tuple(flat[i :: len(slews)]) for i in range(len(slews)))
        return LookupTable(slews, loads, values)


def _state(cell: Group) -> State | None:
    """Of a flip-flop without set and reset; None for all other cells."""
    for group in cell.of("ff"):
        if "clear" not in group.values and "preset" not in group.values:
            names = [word.strip('"') for word in group.arguments]
            return State(names[0], names[1], group.text("clocked_on"), group.text("next_state"))
    return None


def _clock_gate(cell: Group) -> ClockGate | None:
    """Of an integrated clock gate for rising edges, with a latch; None for all other cells."""
    if not cell.text("clock_gating_integrated_cell").startswith("latch_posedge"):
        return None
    roles = ("clock", "enable", "out")
    found = [pin.arguments[0].strip('"') for role in roles for pin in cell.of("pin") if _is_gate_pin(pin, role)]
    return ClockGate(*found) if len(found) == len(roles) else None


def _is_gate_pin(pin: Group, role: str) -> bool:
    return pin.text(f"clock_gate_{role}_pin") == "true"


def _numbers(words: Sequence[str]) -> list[float]:
    return [_finite(number) for word in words for number in re.split(r"[\s,\\]+", word.strip('"').strip()) if number]


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text} is no finite number")
    return number


def unit(library: Group, name: str, default: str, units: dict[str, float]) -> float:
    """A unit of the library as a multiple of ours; `units` are those that are understood, in lower case."""
    text = library.text(name, default)
    match = re.fullmatch(r"([\d.]+)\s*(\w+)", text)
    if match is None or match[2].lower() not in units:
        raise UserError(f"a liberty has {text} as its {name}: only {' and '.join(units)} are understood")
    return float(match[1]) * units[match[2].lower()]
