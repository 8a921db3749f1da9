"""What is measured: one data file of ``docs/data`` for each entry, and the commands that print its figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from colonnade.design.toolchain import project_root

from colonnade_lab.evaluation.bench import MESHES
from colonnade_lab.evaluation.light.user_rooms import REPORT as USERS_ROOMS
from colonnade_lab.explore.cycle_errors import PARTS
from colonnade_lab.explore.points import points_of
from colonnade_lab.explore.study_file import load_study

#: Stands for the file that a command writes its report to.
REPORT = "REPORT"

#: When entries are measured: after each change of hardware; for a release; after a change of sources of the host.
CHANGE, RELEASE, SOURCES = CLASSES = ("change", "release", "sources")

#: Entries of the first class: the headline of README and the rows of its presets.
_CHANGED = (
    *("bench-edge", "rooms", "equality-small", "area-edge-asap7"),
    *("bench-lean", "area-lean-asap7", "bench-small", "area-small-asap7", "bench-tiny", "area-tiny-asap7"),
    *("area-traversal-asap7", "bench-fpga", "area-fpga-asap7"),
)

#: Stand for the liberty files of a library in a command, and name the variables that hold their paths.
LIBRARIES = ("ASAP7", "SKY130")


@dataclass(frozen=True)
class Design:
    """A configuration, and changes to it, ``key.path=value``."""

    config: str
    overrides: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Its name in data files."""
        return " ".join((self.config, *self.overrides))


@dataclass(frozen=True)
class Entry:
    """A data file.

    Attributes:
        name: Its name without ``.json``.
        config: The preset, before `overrides`, that it is of.
        commands: The command of each part of the result; the part "" is the whole result, and one that begins with a
            hyphen only prepares the next ones.
        overrides: Changes to the configuration, ``key.path=value``.
        report: The file that the commands write, below the root, where they take no name of one.
        libraries: The ones of `LIBRARIES` that the commands need.
        designs: Those whose Verilog decides the figures; None: the configuration. None at all for figures of the model,
            whose pictures and counts no timing changes.
        sources: Names of the host's sources that also decide them (`digests.SOURCES`).
    """

    name: str
    config: str
    commands: Mapping[str, tuple[str, ...]]
    overrides: tuple[str, ...] = ()
    report: str | None = None
    libraries: tuple[str, ...] = ()
    designs: tuple[Design, ...] | None = None
    sources: tuple[str, ...] = ("tree",)

    @property
    def occasion(self) -> str:
        """When it is measured: one of `CLASSES`."""
        return SOURCES if not self.hardware else CHANGE if self.name in _CHANGED else RELEASE

    @property
    def hardware(self) -> tuple[Design, ...]:
        """The designs whose Verilog decides the figures."""
        return (Design(self.config, self.overrides),) if self.designs is None else self.designs

    @property
    def scenes(self) -> list[str]:
        """The scenes and studies that the commands name, below the root."""
        named = {part for command in self.commands.values() for part in command}
        return sorted(part for part in named if part.startswith("scenes/") and part.endswith(".toml"))


def _alone(*sources: str) -> dict[str, Any]:
    """What decides figures without hardware."""
    return {"designs": (), "sources": sources}


#: What decides figures of the bit-exact model.
_MODEL = _alone("model", "tree")


def _colonnade(*arguments: str) -> dict[str, tuple[str, ...]]:
    return {"": ("colonnade", *arguments, "--json", REPORT)}


def _bench(config: str, *options: str) -> Entry:
    return Entry(f"bench-{config}", config, _colonnade("bench", "--config", config, "--reuse", *options))


def _area(config: str, library: str, *options: str) -> Entry:
    command = _colonnade("ppa", "--config", config, *options, "--liberty", library)
    return Entry(f"area-{config}-{library.lower()}", config, command, libraries=(library,))


def _verify(name: str, config: str, *options: str, **decided: Any) -> Entry:
    return Entry(f"{name}-{config}", config, _colonnade("verify", "--config", config, *options), **decided)


def _study(name: str, *libraries: str, **decided: Any) -> Entry:
    path = Path("scenes") / "studies" / f"{name}.toml"
    file = load_study(project_root() / path)
    design = file.study.design
    decided = decided or {"designs": tuple(Design(design.config, point.overrides) for point in points_of(file))}
    report = f"out/{name}/study.json"
    options = (option for library in libraries for option in ("--library", f"{library.lower()}={library}"))
    # Figures are of the RTL, with which the cycle model is compared
    backend = ("--backend", "rtl") if file.study.cycles else ()
    command = ("colonnade", "explore", str(path), *backend, *options, "--output", f"out/{name}")
    return Entry(name, design.config, {"": command}, design.set, report, libraries, **decided)


#: Meshes for small arrays, whose frames take millions of cycles.
_TWO = ("--mesh", "bunny", "--mesh", "armadillo")

_ROOMS = ("scenes/rooms/living", "scenes/rooms/office")
_ATTIC = "scenes/rooms/attic"

#: A generated room on which no encoder is tuned.
_SEEDS = "100"
#: Generated rooms in which a camera moves: one of each kind.
_MOVED = "100-103"


#: Samples a pixel of the table of samples.
SAMPLES = (1, 4, 16, 64)


def _samples() -> Entry:
    """Pictures of the model at several samples a pixel, against the reference at the most."""

    def picture(backend: str, number: int) -> tuple[str, ...]:
        options = ("--backend", backend, "--size", "320x240", "--samples", str(number))
        output = ("--output", f"out/{backend}-{number}.png")
        return ("colonnade", "render", "scenes/soft-shadow.toml", *options, *output, "--json", REPORT)

    reference = f"out/reference-{SAMPLES[-1]}.png"
    commands = {"-reference": picture("reference", SAMPLES[-1])}
    for number in SAMPLES:
        commands[f"-{number}"] = picture("model", number)
        commands[str(number)] = ("colonnade", "compare", "--no-dists", reference, f"out/model-{number}.png")
        commands[str(number)] += ("--json", REPORT)
    return Entry("samples", "small", commands, **_MODEL)


def _large() -> Entry:
    """Meshes of a million triangles, which no cache holds, on DRAM of one latency and on DRAM with rows."""
    meshes = ("--mesh", "bunny:2", "--mesh", "rock:1000000", "--no-mirror")
    command = ("colonnade", "bench", "--config", "edge", "--reuse", *meshes)
    banks = ("--dram-banks", "8", "--json", REPORT)
    return Entry("bench-large", "edge", {"latency": (*command, "--json", REPORT), "banks": (*command, *banks)})


#: Presets with a figure of two meshes alone, whose cycles of the others the cycle model is compared with.
_OF_TWO = ("small", "tiny")


def _others() -> Entry:
    """The other meshes on the presets that have figures of two."""
    meshes = [part for mesh in MESHES if mesh not in _TWO for part in ("--mesh", mesh)]
    commands = {
        config: ("colonnade", "bench", "--config", config, "--reuse", *meshes, "--no-mirror", "--json", REPORT)
        for config in _OF_TWO
    }
    return Entry("bench-others", "small", commands, designs=tuple(map(Design, _OF_TWO)))


def _paper_unit() -> Entry:
    """The paper's unit, which traces and shades by itself: the formats of `edge`, the functions of the paper's."""
    alone = ("triangleRows=1", "triangleLanes=1", "marches=1", "pathContexts=16", "rayInterval=32", "shadeInterval=128")
    lacks = ("geometry.textureBytes=0", "geometry.cornerColours=false", "frame.gather=false", "frame.emission=false")
    overrides = ("array.rows=1", "array.columns=1", *(f"units.{each}" for each in alone), *lacks)
    hardware = ("--config", "edge", *(part for override in overrides for part in ("--set", override)))
    commands = {
        "bench": ("colonnade", "bench", *hardware, "--reuse", *_TWO, "--no-mirror", "--json", REPORT),
        "area": ("colonnade", "ppa", *hardware, "--no-power", "--liberty", "ASAP7", "--json", REPORT),
    }
    return Entry("paper-unit", "edge", commands, overrides, libraries=("ASAP7",))


#: The frames in which encodings of maps are compared, with the options of `colonnade render`.
MAP_FRAMES = {"photo": (), "relit": ("--relit",)}
#: What the encodings of maps are called in configurations.
ENCODINGS = ("slic", "twoLevel")


def _paper_maps() -> Entry:
    """SLIC maps: their loss, gates, and frames of the model with either encoding against the float reference."""

    def hardware(encoding: str) -> tuple[str, ...]:
        return ("--config", "small", "--set", f"physicalAttributeMemory.encoding={encoding}")

    def picture(name: str, frame: str, *options: str) -> tuple[str, ...]:
        output = ("--output", f"out/maps-{name}-{frame}.png", "--json", REPORT)
        return ("colonnade", "render", "scenes/room.toml", *options, *MAP_FRAMES[frame], *output)

    commands: dict[str, tuple[str, ...]] = {
        Path(room).name: ("colonnade", "inspect", "--background", room, "--encoding", "slic", "--json", REPORT)
        for room in (*_ROOMS, _ATTIC)
    }
    commands["area"] = ("colonnade", "ppa", *hardware("slic"), "--no-power", "--liberty", "ASAP7", "--json", REPORT)
    for frame in MAP_FRAMES:
        commands[f"-reference, {frame}"] = picture("reference", frame, "--backend", "reference")
        for encoding in ENCODINGS:
            commands[f"-{encoding}, {frame}"] = picture(encoding, frame, *hardware(encoding), "--backend", "model")
            pair = (f"out/maps-{name}-{frame}.png" for name in ("reference", encoding))
            commands[f"{encoding}, {frame}"] = ("colonnade", "compare", *pair, "--json", REPORT)
    encoding = hardware("slic")[-1]
    return Entry("paper-maps", "small", commands, (encoding,), libraries=("ASAP7",), sources=("maps", "tree"))


#: Marches of a column, by which frames of a camera that moves are compared.
MARCHES = (2, 4, 8)


def _marches() -> Entry:
    """A frame of a camera that is not the maps', whose pixels all march, and the area, by the marches of a column."""
    commands: dict[str, tuple[str, ...]] = {}
    for count in MARCHES:
        hardware = ("--config", "edge", "--set", f"units.marches={count}")
        options = ("--backend", "rtl", "--size", "192x144", "--samples", "1")
        commands[str(count)] = ("colonnade", "render", "scenes/live.toml", *hardware, *options, "--json", REPORT)
        area = ("colonnade", "ppa", *hardware, "--no-power", "--liberty", "ASAP7", "--json", REPORT)
        commands[f"{count}, area"] = area
    designs = tuple(Design("edge", (f"units.marches={count}",)) for count in MARCHES)
    return Entry("marches", "edge", commands, libraries=("ASAP7",), designs=designs)


def _cycles() -> Entry:
    """The cycle model beside the recorded cycles of the RTL."""
    commands = {part: ("tools/cycle-errors", part, f"--json={REPORT}") for part in PARTS}
    return Entry("cycles", "edge", commands, **_alone("model", "cycles", "tree"))


def _gather() -> Entry:
    """Gathered light on `edge`: a pass of the RTL, and pictures of the model against the reference."""

    def render(backend: str, *options: str) -> tuple[str, ...]:
        hardware = ("--config", "edge", "--backend", backend)
        return ("colonnade", "render", "scenes/gathered.toml", *hardware, *options, "--json", REPORT)

    pictures = {backend: f"out/gathered-{backend}.png" for backend in ("reference", "model")}
    small = ("--size", "320x240", "--samples", "16", "--output")
    commands = {
        "pass": render("rtl", "--samples", "1"),
        "whole": render("rtl", "--samples", "1", "--relit"),
        **{f"-{backend}": render(backend, *small, picture) for backend, picture in pictures.items()},
        "compare": ("colonnade", "compare", "--no-dists", *pictures.values(), "--json", REPORT),
    }
    return Entry("gather", "edge", commands)


def _light() -> Entry:
    """Frames in known rooms against a path tracer, and a pass of the RTL over one of them, with gathered light."""
    scenes = [f"out/light/panorama-{rays}/attic-rough.toml" for rays in (1, 2)]
    design = Design("edge")
    hardware = ("--config", design.config, "--backend", "rtl")
    options = ("--samples", "1", "--size", "640x480", "--json", REPORT)
    commands = {
        "frames": ("tools/light", "frames", "--json", REPORT),
        "pass": ("colonnade", "render", scenes[0], *hardware, *options),
        "two": ("colonnade", "render", scenes[1], *hardware, *options),
    }
    return Entry("light", "small", commands, designs=(design,))


def catalog() -> dict[str, Entry]:
    """All entries by name, the pages' most needed ones first."""
    entries = (
        _bench("edge"),
        _large(),
        _area("edge", "ASAP7"),
        Entry("rooms", "edge", {"": ("tools/room-frames", "edge", "640x480", "--compare", f"--json={REPORT}")}),
        _bench("lean", "--no-mirror"),
        _area("lean", "ASAP7"),
        _verify("quality", "edge", "--no-rtl", **_MODEL),
        _verify("quality", "lean", "--no-rtl", **_MODEL),
        Entry(
            "environments",
            "edge",
            {
                "accuracy": ("colonnade", "study", "rays", *_ROOMS, "--json", REPORT),
                **{
                    Path(room).name: ("colonnade", "inspect", "--background", room, "--json", REPORT)
                    for room in (*_ROOMS, _ATTIC)
                },
            },
            **_alone("maps"),
        ),
        Entry("room-lights", "small", _colonnade("study", "light", *_ROOMS, _ATTIC), **_alone("roomLight")),
        Entry(
            "live-rooms",
            "small",
            {
                "rooms": ("colonnade", "study", "live", *_ROOMS, _ATTIC, "--json", REPORT),
                "generated": ("colonnade", "study", "live", "--rooms", _SEEDS, "--json", REPORT),
            },
            **_alone("live"),
        ),
        Entry("live-paths", "small", _colonnade("study", "live-paths", _MOVED), **_alone("live")),
        Entry(
            "moved-rooms",
            "edge",
            {"": ("tools/room-frames", "edge", "160x120", "--moved", "--compare", f"--json={REPORT}")},
        ),
        _marches(),
        Entry("moving-frames", "small", _colonnade("study", "moved-frames", _MOVED), **_alone("live", "model", "tree")),
        Entry("captures", "small", _colonnade("study", "captures", *_ROOMS, _ATTIC), **_alone("maps")),
        _samples(),
        _gather(),
        _light(),
        Entry("light-users", "small", {"frames": ("tools/light", "frames", *USERS_ROOMS, "--json", REPORT)}, **_MODEL),
        Entry("light-defaults", "small", {"": ("tools/light", "defaults", "--json", REPORT)}, **_MODEL),
        Entry("assets", "small", {"": ("tools/light", "samples", "--json", REPORT)}, **_MODEL),
        _bench("small", *_TWO, "--no-mirror"),
        _area("small", "ASAP7"),
        _bench("tiny", *_TWO),
        _area("tiny", "ASAP7"),
        _others(),
        _area("traversal", "ASAP7", "--mesh", "armadillo"),
        _area("edge", "SKY130"),
        _bench("fpga", *_TWO, "--dram-latency", "15", "--dram-interval", "2"),
        _area("fpga", "ASAP7"),
        _verify("equality", "small", "--no-reference", "--size", "320x240"),
        Entry("fpga", "fpga", {"": ("tools/soc-fpga",)}, report="out/fpga/report.json"),
        Entry("simulators", "small", {"": ("tools/simulators", f"--json={REPORT}")}),
        Entry("ray-suites", "edge", {"": ("tools/ray-suites", "--json", REPORT)}, **_alone("rays")),
        Entry(
            "ray-suites-device",
            "traversal",
            {"": ("tools/ray-suites", "--backend", "rtl", "--json", REPORT)},
            sources=("rays",),
        ),
        Entry(
            "ray-rates",
            "edge",
            _colonnade("rays", "--config", "edge", "--mesh", "armadillo"),
            **_alone("model", "rays", "tree"),
        ),
        Entry("ray-device", "traversal", _colonnade("bench", "--config", "traversal", "--rays", "262144")),
        Entry("view", "small", {"": ("tools/view-frames", f"--json={REPORT}")}, **_MODEL),
        _cycles(),
        _paper_unit(),
        _paper_maps(),
        _study("ablation"),
        _study("features", "ASAP7"),
        _study("scaling"),
        _study("instances"),
        _study("bvh-tests", **_MODEL),
        _study("bvh-costs", "ASAP7"),
        _study("bvh-cycles"),
        _study("bvh-power", "ASAP7"),
        Entry(
            "room-mesh",
            "traversal",
            _colonnade("study", "room-mesh", _ROOMS[0], "--rtl"),
            sources=("maps", "rays", "tree"),
        ),
        Entry("cpu-baseline", "edge", _colonnade("study", "cpu", "bunny"), **_alone()),
        _study("mixed-precision", "ASAP7"),
        _study("energy-area", "ASAP7"),
        _study("vertices-contexts", "ASAP7"),
    )
    return {entry.name: entry for entry in entries}


def selected(parts: tuple[str, ...]) -> list[Entry]:
    """The entries of parts; none: all.

    A part is the name of an entry, one of `CLASSES`, else what names begin with before a hyphen.

    Raises:
        KeyError: A part that names no entry.
    """
    entries = catalog()
    found: dict[str, Entry] = {}
    for part in parts or tuple(entries):
        if part in CLASSES:
            of_part = [name for name, entry in entries.items() if entry.occasion == part]
        else:
            of_part = [part] if part in entries else [name for name in entries if name.startswith(f"{part}-")]
        if not of_part:
            raise KeyError(part)
        found |= {name: entries[name] for name in of_part}
    return list(found.values())
