"""Registers of the environment: the projection from object space to its maps (docs/background.md)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.maps.planes import SLOPE_PIXELS, PlaneProjection
from colonnade.registers.occlusion import occlusion_registers
from colonnade.registers.shadow_window import shadow_window, whole_frame

if TYPE_CHECKING:
    from colonnade.design.manifest import Manifest
    from colonnade.environment.model import Environment
    from colonnade.maps.encoded import EncodedEnvironment
    from colonnade.maps.image import AttributeImage
    from colonnade.scene.view import View
    from colonnade.scene_image.header import ImageHeader

AXES = "xyz"
#: Fraction bits of the rotation, and extra fraction bits of a step over those of a map position.
ROTATION_FRACTION = 14
STEP_GUARD = 12


def environment_registers(
    view: View, encoded: EncodedEnvironment, header: ImageHeader, manifest: Manifest, relit: bool
) -> dict[str, int]:
    """The registers ``room.*`` of a frame.

    Args:
        view: With the room's pose, `View.view_to_mesh`.
        encoded: The room and its encoded maps.
        header: Header of the mesh's scene image.
        manifest: The design's manifest.
        relit: Render the whole room, not only the pixels whose light the object may block.
    """
    registers = projection_registers(view, encoded.environment, encoded.image, header, manifest)
    registers |= occlusion_registers(view, encoded, header, manifest)
    if relit:
        window = whole_frame(view)
    else:
        depth = encoded.image.decoded_depth(PlaneProjection.of(encoded.environment, encoded.image.depth_unit))
        window = shadow_window(view, encoded.environment, depth, header.extent)
    return registers | dict(
        zip((f"environment.window.{edge}" for edge in ("x0", "y0", "x1", "y1")), window, strict=True)
    )


def projection_registers(
    view: View, environment: Environment, image: AttributeImage, header: ImageHeader, manifest: Manifest
) -> dict[str, int]:
    """The registers ``room.*`` of a frame except the window and the occlusion.

    Args:
        view: With the room's pose, `View.view_to_mesh`.
        environment: The room, for its camera.
        image: The encoded maps.
        header: Header of the mesh's scene image.
        manifest: The design's manifest.

    Raises:
        UserError: The object is so small that the room's offset does not fit its register.
    """
    assert view.view_to_mesh is not None
    linear, origin = view.view_to_mesh[:, :3], view.view_to_mesh[:, 3]
    to_view = np.linalg.inv(linear)
    step = header.frame.scale * 2.0 ** manifest.numbers["gridFraction"]
    projection = projection_of(environment, image)
    # p = projection · to_view · (grid / step + offset - origin)
    matrix = projection @ to_view / step
    offset = projection @ to_view @ (np.array(header.frame.offset) - origin)
    registers = view_registers(matrix, offset, manifest)
    rotation = np.rint(linear / np.linalg.norm(linear, axis=0) * 2.0**ROTATION_FRACTION).astype(np.int64)
    registers |= {
        f"environment.rotation[{i}].{axis}": int(rotation[i, a]) for i in range(3) for a, axis in enumerate(AXES)
    }
    fraction = manifest.numbers["shadeBits"] + STEP_GUARD
    for name, map_pixels, frame_pixels in (
        ("X", environment.width, view.width),
        ("Y", environment.height, view.height),
    ):
        registers[f"environment.step{name}"] = round(map_pixels / frame_pixels / (2 * SLOPE_PIXELS) * 2.0**fraction)
    used = int(image.planes.bounding.any(axis=1).sum())
    return registers | {
        "environment.boundingPlanes": used,
        "environment.enabled": 1,
        "environment.isMapCamera": int(view.is_map_camera),
    }


def projection_of(environment: Environment, image: AttributeImage) -> Floats:
    """Projection from view space, metres, to p with pixel 1024 · (p0, p1) / p2 and w = 1 / p2: float64 [3, 3]."""
    camera = np.array(
        [[environment.fx, 0.0, environment.cx], [0.0, environment.fy, environment.cy], [0.0, 0.0, SLOPE_PIXELS]]
    )
    return np.asarray(camera / (SLOPE_PIXELS * image.depth_unit), dtype=np.float64)


def view_registers(matrix: Floats, offset: Floats, manifest: Manifest) -> dict[str, int]:
    """Encode a projection of grid positions as ``environment.matrix``, ``environment.offset`` and their exponents."""
    maximum = (1 << (manifest.numbers["macBits"] - 1)) - 1
    exponent = math.floor(math.log2(maximum / float(np.abs(matrix).max())))
    scaled = offset * 2.0**exponent
    shift = max(0, math.ceil(math.log2(float(np.abs(scaled).max()) / maximum + 1e-300)))
    if shift > manifest.numbers["sceneBits"]:
        raise UserError("the object is too small for the room: make it larger")
    whole = np.rint(matrix * 2.0**exponent).astype(np.int64)
    registers = {f"environment.matrix[{i}].{axis}": int(whole[i, a]) for i in range(3) for a, axis in enumerate(AXES)}
    registers |= {f"environment.offset.{axis}": int(np.rint(scaled[a] / 2.0**shift)) for a, axis in enumerate(AXES)}
    return registers | {"environment.offsetShift": shift, "environment.exponent": exponent}
