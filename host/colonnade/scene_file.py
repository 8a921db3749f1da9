"""Reads and checks scene files; every error names the file and the key."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from colonnade.errors import UserError
from colonnade.scene import Camera, Colour, FrameSize, Light, Material, MeshSource, Scene, Transform, Vector

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib


def read_scene(file: Path) -> Scene:
    """The scene in a TOML file."""
    try:
        data = tomllib.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise UserError(f"scene file {file} does not exist") from None
    except OSError as error:
        raise UserError(f"cannot read the scene {file}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UserError(f"scene {file} is not TOML: {error}") from None
    return _Reader(file).scene(data)


class _Reader:
    """Checks and converts the tables of one file."""

    tables = ("mesh", "transform", "camera", "light", "material", "ambient", "background", "frame")

    def __init__(self, file: Path) -> None:
        self.file = file

    def fail(self, message: str) -> UserError:
        return UserError(f"scene {self.file}: {message}")

    def scene(self, data: Mapping[str, Any]) -> Scene:
        self.only(data, self.tables, "")
        return Scene(
            mesh=self.mesh(self.table(data, "mesh", ("name", "path"))),
            transform=self.transform(self.table(data, "transform", ("rotate", "scale", "translate"))),
            camera=self.camera(self.table(data, "camera", ("position", "target", "direction", "framing", "up", "fov"))),
            light=self.light(self.table(data, "light", ("position", "offset", "colour", "shadows", "shadow_offset"))),
            material=self.material(self.table(data, "material", ("albedo", "flat"))),
            ambient=Colour(self.colour(self.table(data, "ambient", ("colour",)), "ambient.colour", (0.1,) * 3, 15.0)),
            background=Colour(
                self.colour(self.table(data, "background", ("colour",)), "background.colour", (0.0,) * 3, 1.0)
            ),
            frame=self.frame(self.table(data, "frame", ("width", "height"))),
        )

    def only(self, data: Mapping[str, Any], known: tuple[str, ...], prefix: str) -> None:
        for key in data:
            if key not in known:
                raise self.fail(f"unknown key {prefix}{key}; known here: {', '.join(known)}")

    def table(self, data: Mapping[str, Any], name: str, known: tuple[str, ...]) -> Mapping[str, Any]:
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

    def light(self, table: Mapping[str, Any]) -> Light:
        if "position" in table and "offset" in table:
            raise self.fail("[light] has a position or an offset, not both")
        default = Light()
        return Light(
            position=self.vector(table, "light.position", (0.0, 0.0, 0.0)) if "position" in table else None,
            offset=self.vector(table, "light.offset", default.offset),
            colour=self.colour(table, "light.colour", default.colour, 15.0),
            shadows=self.boolean(table, "light.shadows", True),
            shadow_offset=self.number(table, "light.shadow_offset", default.shadow_offset, 0.0, 0.25),
        )

    def material(self, table: Mapping[str, Any]) -> Material:
        albedo = self.colour(table, "material.albedo", Material().albedo, 1.0)
        return Material(albedo, self.boolean(table, "material.flat", False))

    def frame(self, table: Mapping[str, Any]) -> FrameSize:
        sizes = {}
        for key, default in (("width", 640), ("height", 480)):
            value = table.get(key, default)
            if isinstance(value, bool) or not isinstance(value, int) or value < 1:
                raise self.fail(f"frame.{key} must be a whole number of pixels from 1")
            sizes[key] = value
        return FrameSize(**sizes)

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
        return float(value[0]), float(value[1]), float(value[2])

    def colour(self, table: Mapping[str, Any], key: str, default: Any, most: float) -> Vector:
        value = self.vector(table, key, default)
        if not all(0 <= channel <= most for channel in value):
            raise self.fail(f"{key} must be three numbers from 0 to {most:g}")
        return value
