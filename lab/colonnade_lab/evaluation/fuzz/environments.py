"""Legal frames in a room, and corruption of its maps and registers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from colonnade.common.types import Bytes
from colonnade.design.manifest import Field, Manifest, value_range
from colonnade.design.toolchain import project_root
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.mesh import Mesh
from colonnade.scene.model import Background, Light, Material, MeshSource, Paths, Placement, Scene, SceneObject
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene.prepared.gathered_light import MEMORY as LIGHT_CUBE
from colonnade.scene_image.file import LoadSection

from colonnade_lab.evaluation.fuzz.cases import GATHERED, Case, patchwork
from colonnade_lab.evaluation.fuzz.records import write_field
from colonnade_lab.evaluation.fuzz.values import random_value

#: About a hundred times the cycles of a legal frame, since corrupt rays may take all of their march steps.
WATCHDOG_CYCLES = 8_000_000

#: Where two cubes stand on the table of the room, beside each other.
_PLACES = ((322.0, 306.0), (334.0, 306.0))

#: Width and height of the project's rooms, and of a legal frame in one, pixels.
_ROOM_SIZE, _SIZE = (640, 480), (16, 12)


def environment_cases(manifest: Manifest) -> tuple[Case, ...]:
    """The legal frames in a room; none if the design has no attribute memory of the room's size."""
    memory = manifest.config["physicalAttributeMemory"]
    if memory is None or (memory["width"], memory["height"]) != _ROOM_SIZE:
        return ()
    folder = project_root() / "scenes" / "rooms" / "living"
    mesh, place = load_mesh("teapot:4"), Placement((322.0, 306.0), 0.58, 25.0)
    scene = Scene(
        MeshSource(name="teapot:4"),
        placement=place,
        light=Light((0.1, 2.2, 1.2), falloff=1.6),
        background=Background(room=folder, colours="albedo"),
    )
    materials = [Material(kind="diffuse")]
    if int(manifest.config["frame"]["maxBounces"]) > 0:
        materials += [Material(kind="mirror", albedo=(0.9, 0.8, 0.7)), Material(kind="glass")]
    paths = Paths(bounces=2)
    scenes: list[tuple[str, Scene, Mesh | None]]
    scenes = [(str(material.kind), replace(scene, material=material, paths=paths), mesh) for material in materials]
    if manifest.gathers:
        # Larger, since its surfaces also gather light
        large = replace(scene, placement=replace(place, size=1.4), paths=replace(paths, gather=2))
        scenes.append((GATHERED, large, patchwork(mesh, manifest)))
    if int(manifest.config["frame"]["instances"]):
        cubes = tuple(_cube(*placed) for placed in zip(_PLACES, materials * 2, strict=False))
        scenes.append(("instances", replace(scene, objects=cubes, paths=paths), None))
    cases, shared = [], dict[tuple[str, bytes], LoadSection]()
    for name, lit, surfaces in scenes:
        prepared = DeviceScene.of(lit, manifest, surfaces)
        # Cases share equal arrays, so that the simulator loads them once
        held = prepared.image.attributes
        sections = tuple(shared.setdefault((section.memory, section.words.tobytes()), section) for section in held)
        registers = prepared.registers(_SIZE) | {"frame.watchdogCycles": WATCHDOG_CYCLES}
        cases.append(Case(f"{name} in a room", replace(prepared.image, attributes=sections), registers))
    return tuple(cases)


def _cube(stand_at: tuple[float, float], material: Material) -> SceneObject:
    return SceneObject(stand_at=stand_at, size=0.5, turn=20.0, mesh=MeshSource(name="cube"), material=material)


def corrupt_maps(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """Corrupt words, pointers or heaps of a room's maps or of textures, the room's registers, or both."""
    changes = []
    if random.random() < 0.75:
        for _ in range(int(random.integers(1, 4))):
            case, change = _MUTATIONS[int(random.integers(len(_MUTATIONS)))](random, case, manifest)
            changes.append(change)
    if not changes or random.random() < 0.3:
        case, change = _registers(random, case, manifest)
        changes.append(change)
    return case, "; ".join(changes)


def _pointers(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """Set tile pointers of one map to any address, or near the end of its heap."""
    section, index = _section(random, case, "descriptors")
    descriptor = _layout(manifest, section.memory)["pointer"]
    heap = manifest.memories.get(section.memory.replace("descriptors", "heap"))
    depth = 0 if heap is None else int(heap["depth"])
    words, addresses = section.words.copy(), _some(random, len(section.words))
    minimum, maximum = descriptor.range
    near = random.random() < 0.5
    for address in addresses:
        value = depth + int(random.integers(-40, 4)) if near else int(random.integers(minimum, maximum + 1))
        write_field(words[address], descriptor, min(max(value, minimum), maximum))
    target = "near the end of the heap" if near else "to any address"
    return _with(case, index, words), f"{section.memory}: {len(addresses)} pointers {target}"


def corrupt_words(random: np.random.Generator, case: Case, manifest: Manifest, memory: str = "") -> tuple[Case, str]:
    """Overwrite words of a memory, or of any, with random bits, zeros or ones."""
    section, index = _section(random, case, memory)
    words, addresses = section.words.copy(), _some(random, len(section.words))
    fill = int(random.integers(3))
    shape = (len(addresses), words.shape[1])
    words[addresses] = (random.integers(0, 256, shape, dtype=np.uint8), np.uint8(0), np.uint8(255))[fill]
    return _with(case, index, words), f"{section.memory}: {len(addresses)} words {('random', 'zeros', 'ones')[fill]}"


def _fields(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """Set one field of some words to corner-case values."""
    section, index = _section(random, case)
    layout = _layout(manifest, section.memory)
    if not layout:
        return corrupt_words(random, case, manifest)
    field = list(layout.values())[int(random.integers(len(layout)))]
    words, addresses = section.words.copy(), _some(random, len(section.words))
    for address in addresses:
        write_field(words[address], field, random_value(random, *field.range))
    return _with(case, index, words), f"{section.memory}: {len(addresses)} of {field.name}"


_MUTATIONS = (_pointers, _pointers, corrupt_words, _fields)


def _registers(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """Set one to three registers of the room, or without one of the materials, to any value that fits."""
    part = "environment." if case.image.header.room is not None else "materials["
    all_of_room = [r for r in manifest.registers.values() if r.access == "rw" and r.name.startswith(part)]
    scalars = [r for r in all_of_room if "[" not in r.name] or all_of_room
    values, changes = dict(case.registers), []
    for _ in range(int(random.integers(1, 4))):
        candidates = scalars if random.random() < 0.7 else all_of_room
        register = candidates[int(random.integers(len(candidates)))]
        values[register.name] = random_value(random, *value_range(register.width, register.signed))
        changes.append(f"{register.name} = {values[register.name]}")
    return replace(case, registers=values), "; ".join(changes)


def _section(random: np.random.Generator, case: Case, part: str = "") -> tuple[LoadSection, int]:
    """A random memory whose name ends with `part`, and its index in the image."""
    sections = enumerate(case.image.attributes)
    candidates = [(index, section) for index, section in sections if section.memory.endswith(part)]
    index, section = candidates[int(random.integers(len(candidates)))]
    return section, index


def _some(random: np.random.Generator, count: int) -> npt.NDArray[np.int64]:
    """Random addresses below `count`: about 2 %, 20 % or all of them."""
    share = (0.02, 0.2, 1.0)[int(random.integers(3))]
    selected: npt.NDArray[np.int64] = np.flatnonzero(random.random(count) < share)
    return selected if selected.size else random.integers(0, count, 1)


def _with(case: Case, index: int, words: Bytes) -> Case:
    """The case with other words in one memory."""
    sections = list(case.image.attributes)
    sections[index] = LoadSection(sections[index].memory, words)
    return replace(case, image=replace(case.image, attributes=tuple(sections)))


def _layout(manifest: Manifest, memory: str) -> Mapping[str, Field]:
    """The fields of a memory's words; empty for a heap and for the light cube."""
    if memory == LIGHT_CUBE:
        return {}
    formats = manifest.texture if memory.startswith("texture.") else manifest.attributes
    assert formats is not None
    part, _, name = memory.partition(".")
    entries = {"albedo": "albedo", "normals": "normal", "texture": "albedo"}.get(part, "plane")
    kinds = {"descriptors": "planeDescriptor" if part == "planes" else "mapDescriptor", "planes": "plane"}
    kinds |= {"bounding": "boundingPlaneEntry", "palette": entries, "seeds": entries}
    return formats.layouts[kinds[name]].fields if name in kinds else {}
