"""Registers of a room: how the maps are seen from object space; docs/background.md."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from colonnade.attributes.plane_numbers import SLOPE_PIXELS, Picture
from colonnade.errors import UserError
from colonnade.shadow_window import shadow_window, whole_frame

if TYPE_CHECKING:
    from colonnade.attributes import AttributeImage, AttributeLayout
    from colonnade.image import ImageHeader
    from colonnade.manifest import Manifest
    from colonnade.room import Room
    from colonnade.viewpoint import FloatPlacement

Floats = npt.NDArray[np.float64]
AXES = "xyz"
#: Fraction bits of the maps' rotation, and those of a step beyond those of a place in the map.
ROTATION_FRACTION = 14
STEP_GUARD = 12


@dataclass(frozen=True)
class HeldRoom:
    """A room, and its maps as the physical-attribute memory holds them."""

    room: Room
    image: AttributeImage

    @staticmethod
    def load(folder: Path, manifest: Manifest) -> HeldRoom:
        """A room's folder, for the hardware of a manifest.

        Raises:
            UserError: The folder is no room, the hardware holds none, or maps of another size.
        """
        from colonnade.attributes import encoded_room
        from colonnade.room import load_room

        layout, room = layout_of(manifest), load_room(folder)
        if (room.width, room.height) != (layout.width, layout.height):
            raise UserError(
                f"the maps of {folder} are {room.width}x{room.height}, physicalAttributeMemory holds"
                f" {layout.width}x{layout.height}: set its width and height"
            )
        return HeldRoom(room, encoded_room(room, layout))

    def registers(self, view: FloatPlacement, header: ImageHeader, manifest: Manifest, relit: bool) -> dict[str, int]:
        """Registers ``room.*``; see `room_registers`. Without ``relit`` the room is rendered only where the object may
        take its light.
        """
        registers = room_registers(view, self.room, self.image, header, manifest)
        if relit:
            window = whole_frame(view)
        else:
            depth = self.image.decoded_depth(Picture.of(self.room, self.image.depth_unit))
            window = shadow_window(view, self.room, depth, header.extent)
        return registers | dict(zip((f"room.window.{edge}" for edge in ("x0", "y0", "x1", "y1")), window, strict=True))


def layout_of(manifest: Manifest) -> AttributeLayout:
    """What the hardware's physical-attribute memory holds.

    Raises:
        UserError: It has none.
    """
    from colonnade.attributes import AttributeLayout

    sizes = manifest.config["physicalAttributeMemory"]
    if sizes is None:
        raise UserError("the hardware has no memory for a room: set physicalAttributeMemory, as in the preset small")
    return AttributeLayout.from_config(sizes)


def room_registers(
    view: FloatPlacement, room: Room, image: AttributeImage, header: ImageHeader, manifest: Manifest
) -> dict[str, int]:
    """Registers ``room.*`` of a frame, but for the window.

    Args:
        view: With the room's pose, `FloatPlacement.view_to_mesh`.
        room: The maps' camera.
        image: The maps as they are held.
        header: How the mesh lies in the object's cube.
        manifest: Of the hardware.

    Raises:
        UserError: The object is so far from the camera that the room's offset does not fit.
    """
    assert view.view_to_mesh is not None
    turn, origin = view.view_to_mesh[:, :3], view.view_to_mesh[:, 3]
    to_view = np.linalg.inv(turn)
    step = header.frame.scale * 2.0 ** manifest.numbers["gridFraction"]
    projection = projection_of(room, image)
    # p = projection · to_view · (grid / step + offset - origin)
    matrix = projection @ to_view / step
    offset = projection @ to_view @ (np.array(header.frame.offset) - origin)
    registers = view_registers(matrix, offset, manifest)
    rotation = np.rint(turn / np.linalg.norm(turn, axis=0) * 2.0**ROTATION_FRACTION).astype(np.int64)
    registers |= {f"room.rotation[{i}].{axis}": int(rotation[i, a]) for i in range(3) for a, axis in enumerate(AXES)}
    fraction = manifest.numbers["shadeBits"] + STEP_GUARD
    for name, map_pixels, frame_pixels in (("X", room.width, view.width), ("Y", room.height, view.height)):
        registers[f"room.step{name}"] = round(map_pixels / frame_pixels / (2 * SLOPE_PIXELS) * 2.0**fraction)
    used = int(image.planes.shell.any(axis=1).sum())
    return registers | {"room.shellPlanes": used, "room.isThere": 1}


def projection_of(room: Room, image: AttributeImage) -> Floats:
    """From view space, metres, to what is seen at pixel 1024 · (p0, p1) / p2 with w = 1 / p2: float64 [3, 3]."""
    camera = np.array([[room.fx, 0.0, room.cx], [0.0, room.fy, room.cy], [0.0, 0.0, SLOPE_PIXELS]])
    return np.asarray(camera / (SLOPE_PIXELS * image.depth_unit), dtype=np.float64)


def view_registers(matrix: Floats, offset: Floats, manifest: Manifest) -> dict[str, int]:
    """A projection of grid positions as ``room.matrix``, ``room.offset`` and their exponents."""
    most = (1 << (manifest.numbers["macBits"] - 1)) - 1
    exponent = math.floor(math.log2(most / float(np.abs(matrix).max())))
    scaled = offset * 2.0**exponent
    shift = max(0, math.ceil(math.log2(float(np.abs(scaled).max()) / most + 1e-300)))
    if shift > manifest.numbers["sceneBits"]:
        raise UserError("the object is too small for the room: make it larger")
    whole = np.rint(matrix * 2.0**exponent).astype(np.int64)
    registers = {f"room.matrix[{i}].{axis}": int(whole[i, a]) for i in range(3) for a, axis in enumerate(AXES)}
    registers |= {f"room.offset.{axis}": int(np.rint(scaled[a] / 2.0**shift)) for a, axis in enumerate(AXES)}
    return registers | {"room.offsetShift": shift, "room.exponent": exponent}
