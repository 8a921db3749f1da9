"""Reads and checks scene files; every error names the file and the key."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from colonnade.common.errors import UserError
from colonnade.common.input_files import check_values, read_input
from colonnade.common.limits import MAX_COORDINATE, MAX_DEPTH
from colonnade.mesh.materials import KINDS
from colonnade.scene.model import (
    Background,
    Camera,
    Colour,
    FrameSize,
    Light,
    Material,
    MeshSource,
    Motion,
    Paths,
    Placement,
    Scene,
    Transform,
    Vector,
)

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

#: The largest edge of a room's maps, pixels.
MAX_EDGE = 4096
#: More would be refused by any configuration.
MAX_BOUNCES = 15


def load_scene(path: str | Path) -> Scene:
    """Reads a scene file.

    Raises:
        UserError: It is missing, not TOML, or says something that has no meaning.
    """
    file = Path(path)
    content = read_input(file, "the scene", missing=f"scene file {file} does not exist")
    try:
        data = tomllib.loads(content.decode("utf-8"))
    except RecursionError:
        raise UserError(f"scene {file} is nested too deeply: {MAX_DEPTH} levels at most") from None
    except ValueError as error:  # of TOML, UTF-8, and whole numbers with too many digits
        raise UserError(f"scene {file} is not TOML: {error}") from None
    check_values(data, f"scene {file}")
    return _Reader(file).scene(data)


class _Reader:
    """Checks and converts the tables of one file."""

    tables = "mesh transform object camera light material paths ambient background motion frame".split()
    light_keys = ("position", "offset", "colour", "falloff")

    def __init__(self, file: Path) -> None:
        self.file = file

    def fail(self, message: str) -> UserError:
        return UserError(f"scene {self.file}: {message}")

    def scene(self, data: Mapping[str, Any]) -> Scene:
        self.only(data, self.tables, "")
        lights = self.lights(data)
        background = self.background(self.table(data, "background", ("colour", "room")))
        placement = self.table(data, "object", ("stand_at", "size", "turn"))
        if background.room is not None and "camera" in data:
            raise self.fail("the camera is the room's: leave out [camera], or background.room")
        if background.room is None and "object" in data:
            raise self.fail("[object] says where the object stands in a room: it needs background.room")
        transform = self.table(data, "transform", ("rotate", "scale", "translate"))
        if "object" in data and ("scale" in transform or "translate" in transform):
            raise self.fail("[object] places the object: leave out transform.scale and transform.translate")
        motion = self.motion(data)
        if motion.light is not None and lights[0].position is None:
            raise self.fail("motion.light moves the first light from its place: give light.position")
        return Scene(
            mesh=self.mesh(self.table(data, "mesh", ("name", "path"))),
            transform=self.transform(transform),
            camera=self.camera(self.table(data, "camera", ("position", "target", "direction", "framing", "up", "fov"))),
            light=lights[0],
            more_lights=lights[1:],
            material=self.material(self.table(data, "material", ("kind", "albedo", "ior", "flat"))),
            ambient=Colour(self.colour(self.table(data, "ambient", ("colour",)), "ambient.colour", (0.1,) * 3, 15.0)),
            background=background,
            placement=self.placement(placement) if "object" in data else None,
            paths=self.paths(self.table(data, "paths", ("bounces", "shadow_transmittance"))),
            frame=self.frame(self.table(data, "frame", ("width", "height"))),
            motion=motion,
        )

    def only(self, data: Mapping[str, Any], known: Sequence[str], prefix: str) -> None:
        for key in data:
            if key not in known:
                raise self.fail(f"unknown key {prefix}{key}; known here: {', '.join(known)}")

    def table(self, data: Mapping[str, Any], name: str, known: Sequence[str]) -> Mapping[str, Any]:
        table = data.get(name, {})
        if not isinstance(table, dict):
            raise self.fail(f"{name} must be a table: [{name}]")
        self.only(table, known, f"{name}.")
        return table

    def mesh(self, table: Mapping[str, Any]) -> MeshSource:
        for key, value in table.items():
            if not isinstance(value, str) or not value:
                raise self.fail(f"mesh.{key} must be text")
        if len(table) != 1:
            raise self.fail("[mesh] needs a name or a path, one of the two")
        if "name" in table:
            return MeshSource(name=table["name"])
        return MeshSource(path=self.file.parent / table["path"])

    def transform(self, table: Mapping[str, Any]) -> Transform:
        return Transform(
            rotate=self.vector(table, "transform.rotate", (0.0, 0.0, 0.0)),
            scale=self.number(table, "transform.scale", 1.0, 1e-9, 1e9),
            translate=self.vector(table, "transform.translate", (0.0, 0.0, 0.0)),
        )

    def camera(self, table: Mapping[str, Any]) -> Camera:
        if "position" in table and ("direction" in table or "framing" in table):
            raise self.fail("[camera] is either placed (position, target) or framed (direction, framing)")
        if "target" in table and "position" not in table:
            raise self.fail("camera.target needs camera.position")
        placed = "position" in table
        camera = Camera(
            position=self.vector(table, "camera.position", (0.0, 0.0, 0.0)) if placed else None,
            target=self.vector(table, "camera.target", (0.0, 0.0, 0.0)) if "target" in table else None,
            direction=None if placed else self.vector(table, "camera.direction", (0.45, 0.35, 1.0)),
            framing=self.number(table, "camera.framing", 0.7, 0.01, 4.0),
            up=self.vector(table, "camera.up", (0.0, 1.0, 0.0)),
            fov=self.number(table, "camera.fov", 40.0, 1.0, 150.0),
        )
        for name, value in (("up", camera.up), ("direction", camera.direction)):
            if value is not None and not any(value):
                raise self.fail(f"camera.{name} must not be zero")
        return camera

    def lights(self, data: Mapping[str, Any]) -> tuple[Light, ...]:
        """One table [light], or several [[light]]; what holds for all of them stands in the first."""
        given = data.get("light", {})
        tables = given if isinstance(given, list) and given else [given]
        lights = []
        for index, table in enumerate(tables):
            known = (*self.light_keys, "shadows", "shadow_offset") if index == 0 else self.light_keys
            lights.append(self.light(self.table({"light": table}, "light", known)))
        return tuple(lights)

    def light(self, table: Mapping[str, Any]) -> Light:
        if "position" in table and "offset" in table:
            raise self.fail("[light] has a position or an offset, not both")
        default = Light()
        return Light(
            position=self.vector(table, "light.position", (0.0, 0.0, 0.0)) if "position" in table else None,
            offset=self.vector(table, "light.offset", default.offset),
            colour=self.colour(table, "light.colour", default.colour, 15.0),
            falloff=self.number(table, "light.falloff", 1.0, 1e-6, 1e6) if "falloff" in table else None,
            shadows=self.boolean(table, "light.shadows", True),
            shadow_offset=self.number(table, "light.shadow_offset", default.shadow_offset, 0.0, 0.25),
        )

    def material(self, table: Mapping[str, Any]) -> Material:
        kind = table.get("kind")
        if kind is not None and kind not in KINDS:
            raise self.fail(f"material.kind must be one of {', '.join(KINDS)}")
        if "ior" in table and kind not in (None, "glass"):
            raise self.fail(f"material.ior belongs to glass, not to a {kind} material")
        return Material(
            kind=kind,
            albedo=self.colour(table, "material.albedo", (0.0,) * 3, 1.0) if "albedo" in table else None,
            ior=self.number(table, "material.ior", 1.5, 1.0, 4.0) if "ior" in table else None,
            flat=self.boolean(table, "material.flat", False),
        )

    def background(self, table: Mapping[str, Any]) -> Background:
        environment = table.get("room")
        if environment is not None and (not isinstance(environment, str) or not environment):
            raise self.fail("background.room must be text: the folder of a room, relative to the scene file")
        colour = self.colour(table, "background.colour", (0.0,) * 3, 1.0)
        return Background(colour, self.file.parent / environment if environment is not None else None)

    def placement(self, table: Mapping[str, Any]) -> Placement:
        return Placement(
            stand_at=self.pixel(table, "object.stand_at"),
            size=self.number(table, "object.size", Placement().size, 1e-3, 1e3),
            turn=self.number(table, "object.turn", 0.0, -360.0, 360.0),
        )

    def motion(self, data: Mapping[str, Any]) -> Motion:
        if "motion" not in data:
            return Motion()
        table = self.table(data, "motion", ("turn", "stand_at", "translate", "light"))
        if not table:
            raise self.fail("[motion] moves nothing: give turn, stand_at, translate or light")
        return Motion(
            turn=self.number(table, "motion.turn", 0.0, -36000.0, 36000.0),
            stand_at=self.pixel(table, "motion.stand_at"),
            translate=self.vector(table, "motion.translate", (0.0,) * 3) if "translate" in table else None,
            light=self.vector(table, "motion.light", (0.0,) * 3) if "light" in table else None,
        )

    def paths(self, table: Mapping[str, Any]) -> Paths:
        bounces = table.get("bounces", Paths().bounces)
        if isinstance(bounces, bool) or not isinstance(bounces, int) or not 0 <= bounces <= MAX_BOUNCES:
            raise self.fail(f"paths.bounces must be a whole number from 0 to {MAX_BOUNCES}")
        transmittance = Paths().shadow_transmittance
        return Paths(bounces, self.number(table, "paths.shadow_transmittance", transmittance, 0.0, 1.0))

    def frame(self, table: Mapping[str, Any]) -> FrameSize:
        sizes = {}
        for key, default in (("width", 640), ("height", 480)):
            value = table.get(key, default)
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise self.fail(f"frame.{key} must be a whole number of pixels from 1")
            sizes[key] = value
        return FrameSize(**sizes)

    def pixel(self, table: Mapping[str, Any], key: str) -> tuple[float, float] | None:
        pixel = table.get(key.split(".")[1])
        if pixel is None:
            return None
        numbers = isinstance(pixel, list) and len(pixel) == 2
        if not numbers or any(
            isinstance(v, bool) or not isinstance(v, int | float) or not 0 <= v <= MAX_EDGE for v in pixel
        ):
            raise self.fail(f"{key} must be two numbers: a pixel of the room's maps, across and down")
        return float(pixel[0]), float(pixel[1])

    def number(self, table: Mapping[str, Any], key: str, default: float, low: float, high: float) -> float:
        value = table.get(key.split(".")[1], default)
        if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
            raise self.fail(f"{key} must be a number from {low:g} to {high:g}")
        return float(value)

    def boolean(self, table: Mapping[str, Any], key: str, default: bool) -> bool:
        value = table.get(key.split(".")[1], default)
        if not isinstance(value, bool):
            raise self.fail(f"{key} must be true or false")
        return value

    def vector(self, table: Mapping[str, Any], key: str, default: Vector) -> Vector:
        value = table.get(key.split(".")[1], default)
        if not isinstance(value, list | tuple) or len(value) != 3:
            raise self.fail(f"{key} must be three numbers")
        if any(isinstance(v, bool) or not isinstance(v, int | float) or not math.isfinite(v) for v in value):
            raise self.fail(f"{key} must be three finite numbers")
        if max(map(abs, value)) > MAX_COORDINATE:
            raise self.fail(f"{key} has a number beyond {MAX_COORDINATE:g}")
        return float(value[0]), float(value[1]), float(value[2])

    def colour(self, table: Mapping[str, Any], key: str, default: Any, maximum: float) -> Vector:
        value = self.vector(table, key, default)
        if not all(0 <= channel <= maximum for channel in value):
            raise self.fail(f"{key} must be three numbers from 0 to {maximum:g}")
        return value
