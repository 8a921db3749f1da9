"""The module hierarchy of a generated design, and the units that are synthesised separately."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

#: Units of each level in the order of the data flow. The remaining logic of the level's module is one more unit.
PATHS = (
    *("RayGenerator", "SequentialRaySetup", "RaySetupPipeline", "SequentialShader", "ShadingPipeline"),
    *("BounceUnit", "BouncePipeline", "ShadowRays", "ColourUnit"),
    *("BounceScheduler", "EnvironmentRays", "RtController"),
    *("InstanceWalk", "WorldFaces"),
)
TRACE = ("BoxUnit", "TraversalStack", "RecordFetch", "HitTable")

#: The triangle units of a group of rows.
TRIANGLES = "TriangleGroup"

COLUMN = (
    "PathUnit",
    "PathHits",
    "RayBus",
    "ResultBus",
    TRIANGLES,
    "TriangleUnit",
    "ColumnBvhController",
    "ColumnEnvironment",
    "EnvironmentMarches",
    "MarchSlot",
    "DirectView",
    "TileWalker",
    "EnvironmentWalker",
    "BackgroundWalker",
    "PixelCollector",
)
DEVICE = ("FrameController", "RegisterFile", "CounterFile", "SceneMemory")

#: Modules of a device for rays of applications.
QUERIES = ("RayQueries", "RunReader", "RayRing", "RayConverter", "HitConverter", "HitWriter")
BATCHES = ("BatchReader", "RayPort", *DEVICE)

#: Dividers and square roots: parts of units that are synthesised separately and counted in their unit.
PARTS = re.compile(r"(Divider|PipelinedDivider|SquareRoot|RootDivider)(_\d+)?")

_INSTANCE = re.compile(r"^  (\w+)\s+(\w+) \(", re.MULTILINE)
_TABLE = re.compile(r"^  reg\s+(?:\[(\d+):0\]\s+)?Memory\[0:(\d+)\];", re.MULTILINE)
_MODULE = re.compile(r"^module (\w+)", re.MULTILINE)


@dataclass(frozen=True)
class Level:
    """A level of the hierarchy: traversal unit, column or array.

    Attributes:
        name: Name in reports.
        top: Module of the level.
        units: Modules that are synthesised separately.
        rest: Name of the remaining logic of `top`.
    """

    name: str
    top: str
    units: tuple[str, ...]
    rest: str


#: The levels, the lowest first.
LEVELS = (
    Level("traversal_unit", "TraversalUnit", TRACE, "contexts"),
    Level("column", "Column", (*PATHS, *COLUMN), "rest of Column"),
    Level("array", "Colonnade", DEVICE, "rest of Colonnade"),
)
#: The same of a device for rays of applications.
RAY_LEVELS = (
    LEVELS[0],
    Level("column", "RayColumn", (*QUERIES, *PATHS, *COLUMN), "rest of RayColumn"),
    Level("array", "ColonnadeRays", BATCHES, "rest of ColonnadeRays"),
)
LEVEL_NAMES = tuple(level.name for level in LEVELS)

#: Modules that the synthesis of another module treats as black boxes.
BOUNDARIES = frozenset({*PATHS, *TRACE, *COLUMN, *QUERIES, *BATCHES, "TraversalUnit", "Column", "RayColumn"})


@dataclass(frozen=True)
class Storage:
    """A memory module: its level and unit, the number of instances in the unit, and depth × width."""

    name: str
    level: str
    unit: str
    count: int
    depth: int
    width: int


@dataclass(frozen=True)
class Memory(Storage):
    """A memory that is a black box."""

    ports: str

    @property
    def bits(self) -> int:
        """Bits of one instance."""
        return self.depth * self.width


@dataclass(frozen=True)
class FlopTable(Storage):
    """A memory with combinational reads, which is synthesised as flip-flops and multiplexers."""

    @property
    def bits(self) -> int:
        """Bits of all instances in the unit."""
        return self.count * self.depth * self.width


class Hierarchy:
    """The modules of a generated design and their instances, without memories.

    Attributes:
        files: The file of each module.
        levels: The design's levels.
    """

    def __init__(self, folder: Path) -> None:
        self.files: dict[str, Path] = {}
        self._instances: dict[str, Counter[str]] = {}
        self._tables: dict[str, tuple[int, int]] = {}
        self._shapes = {shape["name"]: shape for shape in json.loads((folder / "memories.json").read_text())}
        for file in sorted(folder.glob("*.sv")):
            text = file.read_text()
            for module in _MODULE.findall(text):
                self.files[module] = file
                self._instances[module] = Counter(kind for kind, _ in _INSTANCE.findall(text))
            table = _TABLE.search(text)
            if table:
                self._tables[file.stem] = (int(table[2]) + 1, int(table[1] or 0) + 1)
        known = {*self.files, *self._shapes}
        for counts in self._instances.values():
            for kind in set(counts) - known:
                del counts[kind]
        self.levels = RAY_LEVELS if RAY_LEVELS[-1].top in self.files else LEVELS

    def units(self, level: Level) -> list[str]:
        """The units of a level that this design has."""
        return [unit for unit in level.units if unit in self.files and self.instances(unit, level)]

    def instances(self, unit: str, level: Level) -> int:
        """Number of instances of a unit in a level, without those in the levels below."""
        below = {other.top for other in self.levels} - {level.top}
        return 1 if unit == level.top else self.count(unit, level.top, below)

    def closure(self, top: str) -> tuple[list[str], list[str]]:
        """The modules that belong to `top`, and its black boxes: other units, parts and memories."""
        own, boxes, pending = [top], [], [top]
        while pending:
            for module in self._instances[pending.pop()]:
                if module in self._shapes or module in own or module in boxes:
                    continue
                if module in BOUNDARIES or PARTS.fullmatch(module) or self._is_memory(module):
                    boxes.append(module)
                else:
                    own.append(module)
                    pending.append(module)
        return sorted(own), sorted(boxes)

    def header(self, module: str) -> str:
        """The Verilog of a module with its ports and an empty body."""
        text = self.files[module].read_text()
        match = re.search(rf"^module {module}\(.*?^\);\n", text, re.MULTILINE | re.DOTALL)
        if match is None:
            raise RuntimeError(f"{self.files[module]} has no module {module}")
        return f"{match.group()}endmodule\n"

    def count(self, module: str, inside: str, stop: Iterable[str] = ()) -> int:
        """Number of instances of `module` within `inside`, at any depth, but not within modules of `stop`."""
        if inside in stop:
            return 0
        return sum(
            number * (1 if kind == module else self.count(module, kind, stop) if kind in self.files else 0)
            for kind, number in self._instances[inside].items()
        )

    def shape(self, module: str) -> tuple[int, int]:
        """Depth and width of the memory in `module`."""
        (name,) = set(self._instances[module]) & set(self._shapes)
        return int(self._shapes[name]["depth"]), int(self._shapes[name]["width"])

    def parts(self, unit: str) -> dict[str, int]:
        """The parts of a unit and their number of instances."""
        known = sorted(module for module in self.files if PARTS.fullmatch(module))
        counts = {module: self.count(module, unit, BOUNDARIES - {unit}) for module in known}
        return {module: number for module, number in counts.items() if number}

    def memories(self) -> list[Memory]:
        """The memories of all units, counted per instance of the level."""
        found = []
        for name, level, unit, number in self._inside_units(self._shapes):
            shape = self._shapes[name]
            facts = int(shape["depth"]), int(shape["width"]), ",".join(shape["ports"])
            found.append(Memory(name.removesuffix("_ext"), level, unit, number, *facts))
        return found

    def tables(self) -> list[FlopTable]:
        """The flip-flop tables of all units, counted per instance of the level, largest first."""
        found = [
            FlopTable(name, level, unit, number, *self._tables[name])
            for name, level, unit, number in self._inside_units(self._tables)
        ]
        return sorted(found, key=lambda table: (-table.bits, table.name))

    def _inside_units(self, modules: Iterable[str]) -> Iterator[tuple[str, str, str, int]]:
        """Module, level, unit and number of instances for each unit that contains a module of `modules`."""
        for level in self.levels:
            for unit in (*self.units(level), level.top):
                for module in modules:
                    number = self.count(module, unit, BOUNDARIES - {unit}) * self.instances(unit, level)
                    if number:
                        yield module, level.name, level.rest if unit == level.top else unit, number

    def _is_memory(self, module: str) -> bool:
        return bool(set(self._instances[module]) & set(self._shapes))
