"""The device's march through a rebuilt room, as a `Rebuild`: bit for bit what the hardware's numbers make of a ray."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from colonnade.attributes.plane_numbers import SLOPE_PIXELS
from colonnade.manifest import Manifest
from colonnade.rebuild import HIDDEN, HIT, LEFT, LOST, Rebuilt

if TYPE_CHECKING:
    from colonnade.attributes import AttributeImage
    from colonnade.room import Room

Floats = NDArray[np.float64]

#: Grid steps a metre, log2, where no object says how large the grid is.
GRID_LOG = 20
#: Kinds of points as `RoomModel` numbers them.
_MAP, _SHELL = 1, 2


class DeviceMarch:
    """The march of `cpp/model/background.hpp` through an attribute image."""

    def __init__(self, room: Room, image: AttributeImage, manifest: Manifest) -> None:
        """For hardware with a physical-attribute memory of the image's layout."""
        from colonnade import _core

        attributes = manifest.attributes
        if attributes is None:
            raise ValueError("the hardware has no physical-attribute memory")
        numbers = {name: manifest.numbers.get(name, 0) for name in manifest.numbers}
        numbers |= dict.fromkeys(("arity", "trianglesPerRecord", "stackDepth", "bvh"), 0)
        layouts = {
            name: {field.name: (field.offset, field.width, field.signed) for field in layout.fields.values()}
            for name, layout in attributes.layouts.items()
        }
        self._model: Any = _core.RoomModel(numbers, dict(attributes.sizes), layouts)
        for map_name, words in image.memories().items():
            for name, values in words.items():
                memory = f"{map_name}.{'table' if (map_name, name) == ('planes', 'planes') else name}"
                rows = np.ascontiguousarray(values).reshape(len(values), -1)
                self._model.load(memory, rows.view(np.uint8).reshape(len(rows), -1))
        self._room = room
        self._component = 1 << (manifest.numbers["shadeBits"] - 1)
        self._registers = _view_registers(room, image, manifest)

    def __call__(self, origins: Floats, directions: Floats) -> Rebuilt:
        """Where rays of view space, float64 [n, 3] each, metres, meet the room."""
        room, grid = self._room, 2.0**GRID_LOG
        starts = np.rint(origins * grid).astype(np.int64)
        ways = directions / np.abs(directions).max(axis=1, keepdims=True)
        ways = np.rint(ways * self._component).astype(np.int64)
        met = self._model.march(self._registers, np.ascontiguousarray(starts), np.ascontiguousarray(ways))
        points = (starts + met["travel"][:, None] * ways) / grid
        kind = np.where(met["kind"] == _MAP, np.where(met["is_hidden"], HIDDEN, HIT), LOST)
        kind = np.where(met["kind"] == _SHELL, LEFT, kind)
        z = points[:, 2]
        u, v = met["x"] + 0.5, met["y"] + 0.5
        seen = (kind == HIT) & (z > 0)
        depth = np.where(seen, z, 1.0)
        u = np.where(seen, points[:, 0] / depth * room.fx + room.cx, u)
        v = np.where(seen, points[:, 1] / depth * room.fy + room.cy, v)
        return Rebuilt(u, v, z, kind.astype(np.int64), met["steps"])


def _view_registers(room: Room, image: AttributeImage, manifest: Manifest) -> dict[str, int]:
    """Registers of the room's view for positions in view space, `GRID_LOG` grid steps a metre."""
    projection = np.array([[room.fx, 0.0, room.cx], [0.0, room.fy, room.cy], [0.0, 0.0, SLOPE_PIXELS]]) / SLOPE_PIXELS
    projection /= image.depth_unit * 2.0**GRID_LOG
    most = (1 << (manifest.numbers["macBits"] - 1)) - 1
    exponent = math.floor(math.log2(most / float(np.abs(projection).max())))
    matrix = np.rint(projection * 2.0**exponent).astype(np.int64)
    registers = {f"matrix[{row}].{axis}": int(matrix[row, a]) for row in range(3) for a, axis in enumerate("xyz")}
    registers |= {f"offset.{axis}": 0 for axis in "xyz"}
    used = int(image.planes.shell.any(axis=1).sum())
    return registers | {"offsetShift": 0, "exponent": exponent, "shellPlanes": used}
