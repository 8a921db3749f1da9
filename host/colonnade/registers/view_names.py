"""The registers that a target computes from poses (docs/driver.md), by name."""

from __future__ import annotations

from colonnade.scene.samples import MAX_GATHERED

AXES = "xyz"


def frame_names() -> list[str]:
    """Registers that the target computes, in the order of their addresses: ``frame``."""
    rectangle = [f"frame.objectRect.{edge}" for edge in ("x0", "y0", "x1", "y1")]
    outline = [f"frame.objectOutline[{i}].{part}" for i in range(6) for part in ("x", "y", "offset")]
    return ["frame.width", "frame.height", *rectangle, *outline, "frame.unitShift"]


def camera_names() -> list[str]:
    """As `frame_names`, for ``camera``."""
    vectors = [f"camera.{name}.{axis}" for name in ("position", "direction", "stepX", "stepY") for axis in AXES]
    return [*vectors, "camera.stepShift"]


def light_names(count: int) -> list[str]:
    """As `frame_names`, for the first lights."""
    parts = [*(f"position.{axis}" for axis in AXES), *(f"colour.{channel}" for channel in "rgb")]
    return [f"lights[{i}].{part}" for i in range(count) for part in (*parts, "reachMantissa", "reachExponent")]


def environment_names() -> list[str]:
    """As `frame_names`, for the projection to a room's maps."""
    rows = {
        name: [f"environment.{name}[{i}].{axis}" for i in range(3) for axis in AXES] for name in ("matrix", "rotation")
    }
    offset = [f"environment.offset.{axis}" for axis in AXES]
    return [*rows["matrix"], *offset, "environment.offsetShift", "environment.exponent", *rows["rotation"]]


def window_names() -> list[str]:
    """As `frame_names`, for a room's window and occlusion."""
    window = [f"environment.window.{edge}" for edge in ("x0", "y0", "x1", "y1")]
    return [*window, *(f"environment.{name}" for name in ("occlusion", "occlusionTolerance", "isMapCamera"))]


def gather_names() -> list[str]:
    """As `frame_names`, the sample points of gathered rays."""
    return [f"gather.points[{i}].{axis}" for i in range(MAX_GATHERED) for axis in "uv"]


def computed_blocks(lights: int, has_room: bool) -> list[list[str]]:
    """The registers that the target computes from poses, in blocks without a gap."""
    room = [environment_names(), window_names()] if has_room else []
    return [frame_names(), camera_names(), light_names(lights), *room]
