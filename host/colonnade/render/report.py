"""The report of a frame: what ``--json`` writes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from colonnade.common.framebuffer import Frame
from colonnade.design.manifest import Manifest
from colonnade.scene_image.file import ImageHeader


def frame_report(backend: str, manifest: Manifest, header: ImageHeader, frame: Frame) -> dict[str, Any]:
    """What there is to say about a frame of the model or the RTL, but for the seconds it took."""
    height, width = frame.is_object.shape
    counters = frame.counters
    rays = {
        "primary": counters["raysPrimary"],
        "shadow": counters["raysShadow"],
        "reflection": counters["raysReflection"],
        "refraction": counters["raysRefraction"],
        "in_box": counters["raysInBox"],
    }
    cycles = counters.get("cycles")
    everything = sum(count for kind, count in rays.items() if kind != "in_box")
    return {
        "backend": backend,
        "config": manifest.config,
        "mesh": mesh_report(header),
        "size": [width, height],
        "cycles": cycles,
        "rays": rays,
        "rays_per_cycle": everything / cycles if cycles else None,
        "rays_per_cycle_in_box": rays["in_box"] / cycles if cycles else None,
        "counters": counters,
        "errors": frame.errors,
        "room": environment_report(manifest, counters),
    }


def environment_report(manifest: Manifest, counters: Mapping[str, int]) -> dict[str, float] | None:
    """What the march through a room took, of the RTL; None without a room.

    Returns:
        ``look_ups``; of each, the mean ``cycles`` and ``steps``; ``busy``, the share of the cycles in which a render
        unit's march works.
    """
    look_ups, busy = counters.get("raysRoom", 0), counters.get("busyRoom")
    if look_ups == 0 or busy is None:
        return None
    array = manifest.config["array"]
    unit_cycles = int(array["rows"]) * int(array["columns"]) * counters["cycles"]
    steps = counters["marchSteps"] / look_ups
    return {"look_ups": look_ups, "cycles": busy / look_ups, "steps": steps, "busy": busy / unit_cycles}


def mesh_report(header: ImageHeader) -> dict[str, Any]:
    """What a report says about the mesh."""
    return {"name": header.mesh, "triangles": header.triangles, "source_triangles": header.source_triangles}
