"""Computes all frame registers of a scene, as defined in docs/numbers.md.

Camera, lights, outline and the projection to a room's maps are by ``driver/src/colonnade_view.c``
(docs/driver.md): on the object's grid, so that the object itself never moves.
"""

from __future__ import annotations

import numpy as np

from colonnade.common.errors import UserError
from colonnade.design.frame_limits import check_size
from colonnade.design.manifest import Manifest
from colonnade.maps.encoded import EncodedEnvironment
from colonnade.registers.environment import environment_registers
from colonnade.registers.instances import instance_registers
from colonnade.registers.shading import check_surfaces, surface_registers
from colonnade.registers.target_view import TargetView
from colonnade.registers.view_file import still_file
from colonnade.registers.watchdog import watchdog_cycles
from colonnade.scene.model import Scene
from colonnade.scene.object_pose import Placed
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
    """The registers of a scene that nothing else is computed of; arguments are as in `placed_registers`."""
    room = None if environment is None else environment.environment
    placed = Placed(scene, header.extent, room)
    return placed_registers(placed, header, manifest, width, height, environment, relit)


def placed_registers(
    placed: Placed,
    header: ImageHeader,
    manifest: Manifest,
    width: int,
    height: int,
    environment: EncodedEnvironment | None = None,
    relit: bool = True,
) -> dict[str, int]:
    """Compute all rw registers of a frame by name; signed registers have signed values.

    Args:
        placed: The scene in its room.
        header: Header of the mesh's scene image.
        manifest: The design's manifest.
        width: Width of the frame, pixels.
        height: Height of the frame, pixels.
        environment: The room and its encoded maps.
        relit: Render the whole room, not only the pixels whose light the object may block.

    Raises:
        UserError: The frame or a distance is out of the hardware's range, or the design lacks a feature.
    """
    check_size((width, height), manifest)
    view = make_view(placed, width, height, header.materials)
    registers = registers_of(view, header, manifest, environment, relit)
    if placed.scene.sample.layer != "surface":  # The object alone
        registers |= dict.fromkeys((name for name in registers if name.startswith("environment.window.")), 0)
    if manifest.config["columnBvhMemory"]["cache"]:
        registers["dram.page"] = 0
    return registers | {"frame.watchdogCycles": watchdog_cycles(registers, header, manifest)}


def registers_of(
    view: View,
    header: ImageHeader,
    manifest: Manifest,
    environment: EncodedEnvironment | None = None,
    relit: bool = True,
) -> dict[str, int]:
    """Compute the registers of a view; the watchdog's is 0. Arguments are as in `placed_registers`.

    Raises:
        UserError: A distance is out of the hardware's range, or the design lacks a feature.
    """
    check_surfaces(view, manifest)
    _check_reach(view, header, manifest)
    registers = dict.fromkeys((name for name, register in manifest.registers.items() if register.access == "rw"), 0)
    registers |= _scene(header, manifest)
    registers |= surface_registers(view, header, manifest)
    if header.instances:
        placed = instance_registers(header.instances, header.frame, manifest)
        offset = placed["shading.offset"] if view.shadow_offset is None else registers["shading.offset"]
        registers |= placed | {"shading.offset": offset}
    if environment is not None:
        registers |= environment_registers(view, environment, header, manifest, relit)
    try:
        return TargetView(still_file(view, registers, header, manifest, environment), manifest).registers()
    except ValueError as error:
        if environment is None or str(error) != "tooFar":
            raise
        raise UserError("the object is too small for the room: make it larger") from None


def _check_reach(view: View, header: ImageHeader, manifest: Manifest) -> None:
    """Refuse a camera or a light that is out of the hardware's range."""
    numbers = manifest.numbers
    reach, step = 1 << (numbers["sceneBits"] - 1), header.frame.scale * 2.0 ** numbers["gridFraction"]
    lights = [(f"light {index + 1}", light.position) for index, light in enumerate(view.lights)]
    for name, point in (("the camera", view.origin), *lights):
        distance = float(np.abs((point - np.array(header.frame.offset)) * step).max())
        if not distance < reach - 1:
            edge = header.extent.edge * step
            in_environment = name == "the camera" and view.view_to_mesh is not None
            advice = "make the object larger" if in_environment else "move it nearer"
            raise UserError(
                f"{name} is {distance / edge:,.0f} object-cube edges away, the hardware's range is"
                f" {reach / edge:,.0f}: {advice}"
            )


def _scene(header: ImageHeader, manifest: Manifest) -> dict[str, int]:
    colours = {"scene.hasColours": int(header.has_colours)} if manifest.corner_colours else {}
    return {
        **{f"bounds.low.{axis}": header.bounds_low[a] for a, axis in enumerate(AXES)},
        **{f"bounds.high.{axis}": header.bounds_high[a] for a, axis in enumerate(AXES)},
        "scene.recordCount": header.record_count,
        "scene.root": 0,
        **colours,
    }
