"""Registers of a room that ``colonnade_view.c`` does not compute in stills (docs/driver.md, docs/background.md)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from colonnade.maps.planes import SLOPE_PIXELS
from colonnade.registers.occlusion import occlusion_registers
from colonnade.registers.shadow_window import shadow_window, whole_frame

if TYPE_CHECKING:
    from colonnade.design.manifest import Manifest
    from colonnade.maps.encoded import EncodedEnvironment
    from colonnade.scene.view import View
    from colonnade.scene_image.header import ImageHeader

#: Extra fraction bits of a step over a map position's.
STEP_GUARD = 12


def environment_registers(
    view: View, encoded: EncodedEnvironment, header: ImageHeader, manifest: Manifest, relit: bool
) -> dict[str, int]:
    """The registers ``environment.*`` of a frame but the projection to the maps.

    Args:
        view: With the room's pose, `View.view_to_mesh`.
        encoded: The room and its encoded maps.
        header: Header of the mesh's scene image.
        manifest: The design's manifest.
        relit: Render the whole room, not only the pixels whose light the object may block.
    """
    environment, image = encoded.environment, encoded.image
    registers = occlusion_registers(view, encoded, header, manifest)
    window = whole_frame(view) if relit else shadow_window(view, environment, encoded.depth, header.extent)
    edges = (f"environment.window.{edge}" for edge in ("x0", "y0", "x1", "y1"))
    registers |= dict(zip(edges, window, strict=True))
    fraction = manifest.numbers["shadeBits"] + STEP_GUARD
    for name, map_pixels, frame_pixels in (
        ("X", environment.width, view.width),
        ("Y", environment.height, view.height),
    ):
        registers[f"environment.step{name}"] = round(map_pixels / frame_pixels / (2 * SLOPE_PIXELS) * 2.0**fraction)
    return registers | {
        "environment.boundingPlanes": 0 if view.gather else int(image.planes.bounding.any(axis=1).sum()),
        "environment.enabled": 1,
        "environment.isMapCamera": int(view.is_map_camera),
    }
