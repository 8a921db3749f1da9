"""Objects with transforms of their own: legal frames of 2 to 16 of them, and corruption of their registers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from colonnade.common.errors import UserError
from colonnade.design.manifest import Manifest, Register, value_range
from colonnade.scene.model import Camera, Colour, Light, Material, MeshSource, Paths, Scene, SceneObject, Transform
from colonnade.scene.prepared.device_scene import DeviceScene

from colonnade_lab.evaluation.fuzz.cases import SIZE, SKY, Case
from colonnade_lab.evaluation.fuzz.registers import Registers, reachable
from colonnade_lab.evaluation.fuzz.values import random_value

#: Legal frames of a design, and scenes that are tried for them.
_FRAMES, _TRIES = 8, 40

#: Far more cycles than a legal frame takes.
_WATCHDOG_CYCLES = 3_000_000

_COUNTS, _SCALES = (2, 3, 5, 8, 16, 16), (1.0, 0.5, 0.5, 0.05, 2.0, 0.02)
_MESHES = ("cube", "sphere:1", "torus:3")

#: Parts of the register map that a corruption changes together.
_PARTS = (
    *(("instances[",), ("scene.",), ("instances[", "scene."), ("materials[", "instances["), ("bounds.",)),
    *(("camera.",), ("shading.",), ("gather.",), ("lights[",), ("frame.object",), ("instances[", "bounds.")),
)


def instance_cases(manifest: Manifest) -> tuple[Case, ...]:
    """The legal frames of instances; none if the design has none."""
    limit = int(manifest.config["frame"]["instances"])
    return tuple(_cases(limit, manifest)) if limit else ()


def _cases(limit: int, manifest: Manifest) -> Iterator[Case]:
    """Scenes by turns: of any places, at one place, overlapping; of one mesh or of several."""
    random, made = np.random.default_rng(1), 0
    for _ in range(_TRIES):
        scene = _scene(random, limit, made, manifest)
        try:
            prepared = DeviceScene.of(scene, manifest)
        except UserError:  # an object leaves its range
            continue
        if not prepared.image.header.instances:  # too small for a transform, or too many materials
            continue
        registers = prepared.registers(SIZE) | {"frame.watchdogCycles": _WATCHDOG_CYCLES}
        yield Case(f"instances {made}", prepared.image, registers)
        made += 1
        if made == _FRAMES:
            return


def _scene(random: np.random.Generator, limit: int, number: int, manifest: Manifest) -> Scene:
    bounces, gathers = int(manifest.config["frame"]["maxBounces"]), manifest.gathers
    materials = [Material(), Material(albedo=(0.8, 0.2, 0.1))]
    if bounces:
        materials += [Material(kind="mirror", albedo=(0.9, 0.8, 0.7)), Material(kind="glass", ior=1.45)]
    if gathers:
        materials += [Material(kind="mirror", roughness=0.4), Material(kind="glass", roughness=0.3)]
    same = _MESHES[number // 4 % len(_MESHES)] if number % 2 else None
    objects = tuple(
        SceneObject(
            mesh=MeshSource(name=same or _MESHES[int(random.integers(len(_MESHES)))]),
            material=materials[i % len(materials)],
            transform=_transform(random, number % 4),
        )
        for i in range(min(_COUNTS[number % len(_COUNTS)], limit))
    )
    place = random.normal(size=3)
    place *= (0.4 if number == 4 else random.uniform(2, 3)) / np.linalg.norm(place)
    paths = Paths(bounces=int(random.integers(1, 5)), gather=int(random.integers(0, 3)) if gathers else 0)
    return Scene(
        objects[0].mesh,
        objects=objects,
        background=SKY,
        camera=Camera(position=_vector(place), target=(0.0, 0.1, 0.0)),
        light=Light(falloff=2.0),
        ambient=Colour((0.4, 0.2, 0.1)),
        paths=paths if bounces else Paths(),
    )


def _transform(random: np.random.Generator, kind: int) -> Transform:
    """Any place; the same one, of any turn; within one another; all alike."""
    turn, scale = _vector(random.uniform(-180, 180, 3)), float(_SCALES[int(random.integers(len(_SCALES)))])
    spread = (0.7, 0.0, 0.1, 0.0)[kind]
    return Transform() if kind == 3 else Transform(turn, scale, _vector(random.normal(size=3) * spread))


def _vector(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z


def corrupt_instances(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """Set registers of instances, and of what they share, to any value, or copy an instance to another one."""
    registers = reachable(case, manifest)
    parts = [part for part in _PARTS if any(name.startswith(part) for name in registers)]
    part = parts[int(random.integers(len(parts)))]
    chosen = [register for name, register in registers.items() if name.startswith(part)]
    used = int(case.registers["scene.instances"])
    if random.random() < 0.8:  # of instances that are on
        chosen = [register for register in chosen if (number := _number(register)) is None or number < used] or chosen
    values = dict(case.registers)
    for _ in range(1 if random.random() < 0.3 else int(random.choice([2, 5, 20, 60]))):
        register = chosen[int(random.integers(len(chosen)))]
        values[register.name] = _value(random, register, values[register.name])
    if random.random() < 0.1:
        values |= {register.name: _value(random, register, values[register.name]) for register in chosen}
    if random.random() < 0.15:
        _copy(values, registers, *(int(number) for number in random.integers(used, size=2)))
    changed = {name: value for name, value in values.items() if value != case.registers[name]}
    change = "; ".join(f"{name} = {value}" for name, value in changed.items())
    if len(changed) > 8:
        change = f"{len(changed)} registers of {', '.join(part)}"
    return replace(case, registers=values), change or "nothing"


def _value(random: np.random.Generator, register: Register, now: int) -> int:
    lowest, highest = value_range(register.width, register.signed)
    draw = random.random()
    if draw < 0.5:
        return random_value(random, lowest, highest)
    if draw < 0.75:
        return min(max(now + int(random.integers(-3, 4)), lowest), highest)
    return (0, lowest, highest)[int(random.integers(3))]


def _copy(values: dict[str, int], registers: Registers, to: int, source: int) -> None:
    for name in registers:
        if name.startswith(f"instances[{to}]."):
            values[name] = values[name.replace(f"[{to}]", f"[{source}]", 1)]


def _number(register: Register) -> int | None:
    """The instance of a register."""
    name = register.name
    return int(name[len("instances[") : name.index("]")]) if name.startswith("instances[") else None
