"""Computes all frame registers of a scene, as defined in docs/numbers.md.

Camera and lights are transformed to the object's grid, so that the object itself never moves.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.design.frame_limits import check_size
from colonnade.design.manifest import Manifest
from colonnade.maps.encoded import EncodedEnvironment
from colonnade.registers.environment import environment_registers
from colonnade.registers.shading import check_surfaces, surface_registers
from colonnade.registers.watchdog import watchdog_cycles
from colonnade.scene.model import Scene
from colonnade.scene.view import View, make_view
from colonnade.scene_image.header import ImageHeader

AXES = "xyz"


def frame_registers(
    scene: Scene,
    header: ImageHeader,
    manifest: Manifest,
    width: int,
    height: int,
    environment: EncodedEnvironment | None = None,
    relit: bool = True,
) -> dict[str, int]:
    """Compute all rw registers of a frame by name; signed registers have signed values.

    Args:
        scene: The scene.
        header: Header of the mesh's scene image.
        manifest: The design's manifest.
        width: Width of the frame, pixels.
        height: Height of the frame, pixels.
        environment: The scene's room and its encoded maps.
        relit: Render the whole room, not only the pixels whose light the object may block.

    Raises:
        UserError: The frame or a distance is out of the hardware's range, or the design lacks a feature.
    """
    check_size((width, height), manifest)
    view = make_view(
        scene, header.extent, width, height, header.materials, None if environment is None else environment.environment
    )
    registers = registers_of(view, header, manifest)
    if environment is not None:
        registers |= environment_registers(view, environment, header, manifest, relit)
    if manifest.config["columnBvhMemory"]["cache"]:
        registers["dram.page"] = 0
    return registers | {"frame.watchdogCycles": watchdog_cycles(registers, header, manifest)}


def registers_of(view: View, header: ImageHeader, manifest: Manifest) -> dict[str, int]:
    """Compute the registers of a view; those of an environment and of the watchdog are 0.

    Raises:
        UserError: A distance is out of the hardware's range, or the design lacks a feature.
    """
    check_surfaces(view, manifest)
    registers = dict.fromkeys((name for name, register in manifest.registers.items() if register.access == "rw"), 0)
    registers |= {"frame.width": view.width, "frame.height": view.height}
    registers |= _positions(view, header, manifest)
    registers |= _directions(view, manifest)
    registers |= _bounds(header)
    registers |= object_screen_bounds(view, registers, manifest)
    registers |= surface_registers(view, header, manifest)
    return registers


def _positions(view: View, header: ImageHeader, manifest: Manifest) -> dict[str, int]:
    """Positions of camera and lights in grid steps, shifted right by the smallest `unitShift` that fits."""
    numbers = manifest.numbers
    reach = 1 << (numbers["sceneBits"] - 1)
    offset = np.array(header.frame.offset)
    steps: dict[str, Floats] = {}
    lights = [(f"lights[{index}]", light.position) for index, light in enumerate(view.lights)]
    for name, point in (("camera", view.origin), *lights):
        steps[name] = (point - offset) * header.frame.scale * 2.0 ** numbers["gridFraction"]
        if not np.abs(steps[name]).max() < reach - 1:
            edge = header.extent.edge * header.frame.scale * 2.0 ** numbers["gridFraction"]
            in_environment = name == "camera" and view.view_to_mesh is not None
            advice = "make the object larger" if in_environment else "move it nearer"
            raise UserError(
                f"{_format_name(name)} is {np.abs(steps[name]).max() / edge:,.0f} object-cube edges away, the"
                f" hardware's range is {reach / edge:,.0f}: {advice}"
            )
    shift, limit = 0, (1 << (numbers["macBits"] - 1)) - 1
    while max(float(np.abs(np.rint(value / 2.0**shift)).max()) for value in steps.values()) > limit:
        shift += 1
    result = {"frame.unitShift": shift}
    for name, value in steps.items():
        result |= _vector(f"{name}.position", value / 2.0**shift)
    return result


def _directions(view: View, manifest: Manifest) -> dict[str, int]:
    """Ray direction and steps, scaled so that the largest component over the frame is 2^(macBits − 2)."""
    numbers = manifest.numbers
    width_bits, max_shift = numbers["macBits"], numbers["coordinateBits"]
    corners = [
        view.direction + x * view.step_x + y * view.step_y
        for x, y in itertools.product((0, view.width - 1), (0, view.height - 1))
    ]
    limit = float((1 << (width_bits - 1)) - 1) * (1 - 2.0**-50)
    step = float(np.abs([view.step_x, view.step_y]).max())
    scale = min(2.0 ** (width_bits - 2) / float(np.abs(corners).max()), (limit - 1) / step)
    shift = 0
    while shift < max_shift and step * scale * 2.0 ** (shift + 1) <= limit - 1:
        shift += 1
    result = {"camera.stepShift": shift} | _vector("camera.direction", view.direction * scale)
    result |= _vector("camera.stepX", view.step_x * scale * 2.0**shift)
    result |= _vector("camera.stepY", view.step_y * scale * 2.0**shift)
    return result


def _bounds(header: ImageHeader) -> dict[str, int]:
    return {
        **{f"bounds.low.{axis}": header.bounds_low[a] for a, axis in enumerate(AXES)},
        **{f"bounds.high.{axis}": header.bounds_high[a] for a, axis in enumerate(AXES)},
        "scene.recordCount": header.record_count,
        "scene.triangleBase": header.triangle_base,
        "scene.triangleRecords": header.triangle_records,
        "scene.attributeBase": header.attribute_base,
    }


def object_screen_bounds(view: View, registers: dict[str, int], manifest: Manifest) -> dict[str, int]:
    """Registers of the pixels whose rays may hit the object: the projection of its padded box.

    A box partly behind the camera gives the whole frame, a box entirely behind it gives an empty rectangle.
    """
    pixels, depth = _projected_corners(registers, manifest)
    if (depth > 1e-6).all():
        rectangle, outline = _rectangle(pixels, view.width, view.height), _outline(pixels, manifest)
    else:
        rectangle, outline = [0, 0, view.width, view.height], []
        if (depth < -1e-6).all():
            rectangle = [0, 0, 0, 0]
    names = ("x0", "y0", "x1", "y1")
    result = {f"frame.objectRect.{name}": value for name, value in zip(names, rectangle, strict=True)}
    edges = sum(name.startswith("frame.objectOutline[") and name.endswith("].x") for name in manifest.registers)
    for index in range(edges):
        x, y, offset = outline[index] if index < len(outline) else (0, 0, 0)
        result |= {f"frame.objectOutline[{index}].{name}": v for name, v in (("x", x), ("y", y), ("offset", offset))}
    return result


def _projected_corners(registers: dict[str, int], manifest: Manifest) -> tuple[Floats, Floats]:
    """Project the corners of the object's padded box to the frame.

    Returns:
        Pixel coordinates of the corners, float64 [8, 2], and their relative depths, float64 [8]. Depths are negative
        behind the camera; coordinates are valid only for positive depths.
    """

    def vector(name: str) -> Floats:
        return np.array([float(registers[f"{name}.{axis}"]) for axis in AXES])

    pad = 2.0 ** manifest.numbers["boxPadLog"] + 1
    low, high = vector("bounds.low") - pad, vector("bounds.high") + pad
    corners = np.array(
        [[(low, high)[bit][axis] for axis, bit in enumerate(bits)] for bits in itertools.product((0, 1), repeat=3)]
    )
    origin = vector("camera.position") * 2.0 ** (registers["frame.unitShift"] - manifest.numbers["gridFraction"])
    first = vector("camera.direction") * 2.0 ** registers["camera.stepShift"]
    # A corner is origin + depth · (first + x · stepX + y · stepY)
    basis = np.stack([vector("camera.stepX"), vector("camera.stepY"), first], axis=1)
    solved = np.linalg.solve(basis / np.abs(first).max(), (corners - origin).T)
    with np.errstate(divide="ignore", invalid="ignore"):
        return (solved[:2] / solved[2]).T, solved[2] / np.abs(corners - origin).max()


def _rectangle(pixels: Floats, width: int, height: int) -> list[int]:
    """Bounding rectangle x0, y0, x1, y1 (exclusive) of points in the frame, a pixel wider; zeros if empty."""
    limits = (width, height)
    minimum = np.clip(np.floor(pixels.min(axis=0)) - 1, 0, limits)
    maximum = np.clip(np.ceil(pixels.max(axis=0)) + 2, 0, limits)
    if (minimum >= maximum).any():
        return [0, 0, 0, 0]
    return [int(value) for value in (*minimum, *maximum)]


def _outline(pixels: Floats, manifest: Manifest) -> list[tuple[int, int, int]]:
    """Half-planes x, y, offset of the points' convex hull, a pixel wider, the longest edges first.

    Only the edges' directions are rounded. Each offset is the smallest that includes all points, so the outline is
    conservative. Collinear points give no half-planes.
    """
    try:
        hull = ConvexHull(pixels)
    except QhullError:
        return []
    max_normal = (1 << (manifest.registers["frame.objectOutline[0].x"].width - 1)) - 1
    max_offset = (1 << (manifest.registers["frame.objectOutline[0].offset"].width - 1)) - 1
    longest = np.argsort(-np.linalg.norm(np.diff(pixels[hull.simplices], axis=1)[:, 0], axis=1), kind="stable")
    edges = []
    for normal in np.rint(-hull.equations[longest, :2] * max_normal):
        offset = np.ceil(max_normal - (pixels @ normal).min())
        edges.append((int(normal[0]), int(normal[1]), int(np.clip(offset, -max_offset, max_offset))))
    return edges


def _vector(name: str, values: Floats) -> dict[str, int]:
    return {f"{name}.{axis}": int(np.rint(values[a])) for a, axis in enumerate(AXES)}


def _format_name(name: str) -> str:
    """Format a register group's name for a message."""
    return f"light {int(name[7:-1]) + 1}" if name.startswith("lights[") else f"the {name}"
