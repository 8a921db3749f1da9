"""Legal frames in a room, and ways to corrupt its maps and registers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from colonnade.common.types import Bytes
from colonnade.design.manifest import Field, Manifest, value_range
from colonnade.design.toolchain import project_root
from colonnade.environment.encoded import EncodedEnvironment
from colonnade.evaluation.fuzz.cases import SIZE, Case
from colonnade.evaluation.fuzz.records import write_field
from colonnade.evaluation.fuzz.values import random_value
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.scene.model import Background, Light, Material, MeshSource, Paths, Placement, Scene
from colonnade.scene.view import with_overrides
from colonnade.scene_image.environment import with_environment
from colonnade.scene_image.file import LoadSection
from colonnade.scene_image.packer import pack

#: The room's legal frames take a hundredth of it; rays that take all of their steps take up to a hundred times as long.
WATCHDOG_CYCLES = 8_000_000

#: Pixels of the rooms that the project has.
_ROOM_SIZE = (640, 480)


def environment_cases(manifest: Manifest) -> tuple[Case, ...]:
    """The legal frames of a room that a design can render; none if it holds no room, or maps of another size."""
    memory = manifest.config["physicalAttributeMemory"]
    if memory is None or (memory["width"], memory["height"]) != _ROOM_SIZE:
        return ()
    environment = project_root() / "scenes" / "rooms" / "living"
    held, mesh = EncodedEnvironment.load(environment, manifest), load_mesh("teapot:4")
    scene = Scene(
        MeshSource(name="teapot:4"),
        placement=Placement((322.0, 306.0), 0.58, 25.0),
        light=Light((0.1, 2.2, 1.2), falloff=1.6),
        background=Background(room=environment),
    )
    materials = [Material(kind="diffuse")]
    if int(manifest.config["frame"]["maxBounces"]) > 0:
        materials += [Material(kind="mirror", albedo=(0.9, 0.8, 0.7)), Material(kind="glass")]
    cases, maps = [], tuple[LoadSection, ...]()
    for material in materials:
        image = with_environment(pack(mesh, manifest, with_overrides(mesh.materials, material)), held, manifest)
        # The same arrays in all cases: what is loaded already is not loaded again
        maps = maps or image.attributes
        view = replace(scene, material=material, paths=Paths(bounces=2))
        registers = frame_registers(view, image.header, manifest, *SIZE, held) | {
            "frame.watchdogCycles": WATCHDOG_CYCLES
        }
        cases.append(Case(f"{material.kind} in a room", replace(image, attributes=maps), registers))
    return tuple(cases)


def corrupt_maps(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """Corrupt words, pointers or heaps of a room's maps, its registers, or both."""
    changes = []
    if random.random() < 0.75:
        for _ in range(int(random.integers(1, 4))):
            case, change = _WAYS[int(random.integers(len(_WAYS)))](random, case, manifest)
            changes.append(change)
    if not changes or random.random() < 0.3:
        case, change = _registers(random, case, manifest)
        changes.append(change)
    return case, "; ".join(changes)


def _pointers(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """Point tiles of one map anywhere, or next to its heap's end."""
    section, place = _section(random, case, "descriptors")
    descriptor = _layout(manifest, section.memory)["pointer"]
    heap = manifest.memories.get(section.memory.replace("descriptors", "heap"))
    depth = 0 if heap is None else int(heap["depth"])
    words, addresses = section.words.copy(), _some(random, len(section.words))
    minimum, greatest = descriptor.range
    near = random.random() < 0.5
    for address in addresses:
        value = depth + int(random.integers(-40, 4)) if near else int(random.integers(minimum, greatest + 1))
        write_field(words[address], descriptor, min(max(value, minimum), greatest))
    where = "next to the heap's end" if near else "anywhere"
    return _with(case, place, words), f"{section.memory}: {len(addresses)} pointers {where}"


def _words(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """Random words, zeros or ones in one memory."""
    section, place = _section(random, case)
    words, addresses = section.words.copy(), _some(random, len(section.words))
    fill = int(random.integers(3))
    shape = (len(addresses), words.shape[1])
    words[addresses] = (random.integers(0, 256, shape, dtype=np.uint8), np.uint8(0), np.uint8(255))[fill]
    return _with(case, place, words), f"{section.memory}: {len(addresses)} words {('random', 'zeros', 'ones')[fill]}"


def _fields(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """One field of some words, set to numbers that look for trouble."""
    section, place = _section(random, case)
    layout = _layout(manifest, section.memory)
    if not layout:
        return _words(random, case, manifest)
    field = list(layout.values())[int(random.integers(len(layout)))]
    words, addresses = section.words.copy(), _some(random, len(section.words))
    for address in addresses:
        write_field(words[address], field, random_value(random, *field.range))
    return _with(case, place, words), f"{section.memory}: {len(addresses)} of {field.name}"


_WAYS = (_pointers, _pointers, _words, _fields)


def _registers(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """One to three of the room's registers, set to any value that fits."""
    environment = [r for r in manifest.registers.values() if r.access == "rw" and r.name.startswith("room.")]
    single = [r for r in environment if "[" not in r.name]
    values, changes = dict(case.registers), []
    for _ in range(int(random.integers(1, 4))):
        choice = single if random.random() < 0.7 else environment
        register = choice[int(random.integers(len(choice)))]
        values[register.name] = random_value(random, *value_range(register.width, register.signed))
        changes.append(f"{register.name} = {values[register.name]}")
    return replace(case, registers=values), "; ".join(changes)


def _section(random: np.random.Generator, case: Case, part: str = "") -> tuple[LoadSection, int]:
    """A memory whose name ends so, or any if none does; and its place in the image."""
    sections = list(enumerate(case.image.attributes))
    named = [(place, section) for place, section in sections if section.memory.endswith(part)] or sections
    place, section = named[int(random.integers(len(named)))]
    return section, place


def _some(random: np.random.Generator, count: int) -> npt.NDArray[np.int64]:
    """Addresses: a few, many or all."""
    share = (0.02, 0.2, 1.0)[int(random.integers(3))]
    chosen: npt.NDArray[np.int64] = np.flatnonzero(random.random(count) < share)
    return chosen if chosen.size else random.integers(0, count, 1)


def _with(case: Case, place: int, words: Bytes) -> Case:
    sections = list(case.image.attributes)
    sections[place] = LoadSection(sections[place].memory, words)
    return replace(case, image=replace(case.image, attributes=tuple(sections)))


def _layout(manifest: Manifest, memory: str) -> Mapping[str, Field]:
    """Fields of a memory's words; none of a heap's."""
    assert manifest.attributes is not None
    part, _, name = memory.partition(".")
    entries = {"albedo": "albedo", "normals": "normal"}.get(part, "plane")
    kinds = {"descriptors": "planeDescriptor" if part == "planes" else "mapDescriptor", "planes": "plane"}
    kinds |= {"shell": "shellEntry", "palette": entries, "seeds": entries}
    return manifest.attributes.layouts[kinds[name]].fields if name in kinds else {}
