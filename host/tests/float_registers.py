"""Registers of a view in floats: the oracle of what ``driver/src/colonnade_view.c`` computes in integers."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
from colonnade_lab.evaluation.environment_march import projection_of, view_registers

from colonnade.design.manifest import Manifest
from colonnade.environment.model import Environment
from colonnade.maps.image import AttributeImage
from colonnade.scene.view import View
from colonnade.scene_image.header import ImageHeader

AXES = "xyz"


class OutOfReach(Exception):
    """Camera or light is out of the hardware's range."""


def float_registers(view: View, header: ImageHeader, manifest: Manifest) -> dict[str, int]:
    """Those of camera, lights and the object's rectangle; the outline is none."""
    registers = {"frame.width": view.width, "frame.height": view.height}
    registers |= _positions(view, header, manifest) | _directions(view, manifest)
    for index, light in enumerate(view.lights):
        registers |= _light(f"lights[{index}]", light, header, manifest)
    registers |= {f"bounds.low.{axis}": header.bounds_low[a] for a, axis in enumerate(AXES)}
    registers |= {f"bounds.high.{axis}": header.bounds_high[a] for a, axis in enumerate(AXES)}
    outline = {name: 0 for name in manifest.registers if "objectOutline" in name}
    return registers | outline | _rectangle(view, registers, manifest)


def float_projection(
    view: View, environment: Environment, image: AttributeImage, header: ImageHeader, manifest: Manifest
) -> dict[str, int]:
    """Those of the projection from the object's grid to a room's maps."""
    assert view.view_to_mesh is not None
    linear, origin = view.view_to_mesh[:, :3], view.view_to_mesh[:, 3]
    to_view = np.linalg.inv(linear)
    step = header.frame.scale * 2.0 ** manifest.numbers["gridFraction"]
    projection = projection_of(environment, image)
    offset = projection @ to_view @ (np.array(header.frame.offset) - origin)
    registers = view_registers(projection @ to_view / step, offset, manifest)
    rotation = np.rint(linear / np.linalg.norm(linear, axis=0) * 2.0**14).astype(np.int64)
    names = [f"environment.rotation[{i}].{axis}" for i in range(3) for axis in AXES]
    return registers | dict(zip(names, rotation.ravel().tolist(), strict=True))


def _positions(view: View, header: ImageHeader, manifest: Manifest) -> dict[str, int]:
    numbers = manifest.numbers
    points = {"camera": view.origin} | {f"lights[{i}]": light.position for i, light in enumerate(view.lights)}
    step = header.frame.scale * 2.0 ** numbers["gridFraction"]
    steps = {name: (point - np.array(header.frame.offset)) * step for name, point in points.items()}
    largest = max(float(np.abs(value).max()) for value in steps.values())
    if not largest < (1 << (numbers["sceneBits"] - 1)) - 1:
        raise OutOfReach
    shift, limit = 0, (1 << (numbers["macBits"] - 1)) - 1
    while float(np.rint(largest / 2.0**shift)) > limit:
        shift += 1
    result = {"frame.unitShift": shift}
    for name, value in steps.items():
        result |= _vector(f"{name}.position", value / 2.0**shift)
    return result


def _directions(view: View, manifest: Manifest) -> dict[str, int]:
    bits, max_shift = manifest.numbers["macBits"], manifest.numbers["coordinateBits"]
    places = itertools.product((0, view.width - 1), (0, view.height - 1))
    corners = [view.direction + x * view.step_x + y * view.step_y for x, y in places]
    limit = float((1 << (bits - 1)) - 1) * (1 - 2.0**-50)
    step = float(np.abs([view.step_x, view.step_y]).max())
    scale = min(2.0 ** (bits - 2) / float(np.abs(corners).max()), (limit - 1) / step)
    shift = 0
    while shift < max_shift and step * scale * 2.0 ** (shift + 1) <= limit - 1:
        shift += 1
    result = {"camera.stepShift": shift} | _vector("camera.direction", view.direction * scale)
    result |= _vector("camera.stepX", view.step_x * scale * 2.0**shift)
    return result | _vector("camera.stepY", view.step_y * scale * 2.0**shift)


def _light(name: str, light: Any, header: ImageHeader, manifest: Manifest) -> dict[str, int]:
    numbers = manifest.numbers
    colour = np.rint(light.colour * (1 << numbers["lightFraction"])).astype(int)
    largest = (1 << numbers["lightBits"]) - 1
    result = {f"{name}.colour.{channel}": min(largest, int(colour[c])) for c, channel in enumerate("rgb")}
    bits = numbers["mantissaBits"]
    if light.reach is None:
        return result | {f"{name}.reachMantissa": 0, f"{name}.reachExponent": 0}
    step = header.frame.scale * 2.0 ** numbers["gridFraction"]
    mantissa, exponent = math.frexp((light.reach * step) ** 2)
    whole = round(math.ldexp(mantissa, bits))
    if whole == 1 << bits:
        whole, exponent = whole >> 1, exponent + 1
    return result | {f"{name}.reachMantissa": whole, f"{name}.reachExponent": exponent - bits}


def _rectangle(view: View, registers: dict[str, int], manifest: Manifest) -> dict[str, int]:
    """The projection of the object's padded box; the whole frame if it is partly behind the camera."""

    def vector(name: str) -> Any:
        return np.array([float(registers[f"{name}.{axis}"]) for axis in AXES])

    pad = 2.0 ** manifest.numbers["boxPadLog"] + 1
    sides = (vector("bounds.low") - pad, vector("bounds.high") + pad)
    corners = np.array([[sides[b][a] for a, b in enumerate(bits)] for bits in itertools.product((0, 1), repeat=3)])
    origin = vector("camera.position") * 2.0 ** (registers["frame.unitShift"] - manifest.numbers["gridFraction"])
    first = vector("camera.direction") * 2.0 ** registers["camera.stepShift"]
    basis = np.stack([vector("camera.stepX"), vector("camera.stepY"), first], axis=1)
    solved = np.linalg.solve(basis / np.abs(first).max(), (corners - origin).T)
    depth = solved[2] / np.abs(corners - origin).max()
    size = (view.width, view.height)
    edges = [0, 0, *size]
    if (depth < -1e-6).all():
        edges = [0, 0, 0, 0]
    elif (depth > 1e-6).all():
        pixels = (solved[:2] / solved[2]).T
        low = np.clip(np.floor(pixels.min(axis=0)) - 1, 0, size).astype(int)
        high = np.clip(np.ceil(pixels.max(axis=0)) + 2, 0, size).astype(int)
        edges = [0, 0, 0, 0] if (low >= high).any() else [*low.tolist(), *high.tolist()]
    return dict(zip((f"frame.objectRect.{name}" for name in ("x0", "y0", "x1", "y1")), edges, strict=True))


def _vector(name: str, values: Any) -> dict[str, int]:
    return {f"{name}.{axis}": int(np.rint(values[a])) for a, axis in enumerate(AXES)}
