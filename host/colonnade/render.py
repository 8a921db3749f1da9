"""One frame of a scene through a backend, and the report of what it took."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from colonnade.errors import UserError
from colonnade.frame import Frame
from colonnade.generator import design_for, manifest_for
from colonnade.image import ImageHeader, SceneImage
from colonnade.manifest import Manifest
from colonnade.meshes import load_mesh
from colonnade.pack import pack
from colonnade.pictures import decode_srgb
from colonnade.placement import FloatPlacement, float_placement, placement
from colonnade.progress import QUIET, Progress
from colonnade.room_registers import HeldRoom
from colonnade.scene import Scene, load_scene
from colonnade.sizes import check_size
from colonnade.viewpoint import made_of

if TYPE_CHECKING:
    from colonnade.room import Room

BACKENDS = ("rtl", "model", "reference")


@dataclass(frozen=True)
class RenderResult:
    """A rendered frame.

    Attributes:
        image: float64 [height, width, 3], linear, 0 to 1.
        object_mask: bool [height, width].
        hit_triangles: int64 [height, width]; face index in the mesh's file, -1 where the ray missed.
        t: float64 [height, width]; depth in mesh units (lengths of the pixel's direction), not a number for a miss.
        report: What ``--json`` writes.
    """

    image: npt.NDArray[np.float64]
    object_mask: npt.NDArray[np.bool_]
    hit_triangles: npt.NDArray[np.int64]
    t: npt.NDArray[np.float64]
    report: dict[str, Any]


def render(
    scene_path: Path,
    config: str,
    overrides: Sequence[str],
    backend: str,
    size: tuple[int, int] | None,
    mesh: str | None = None,
    background: Path | None = None,
    hits: bool = False,
    progress: Progress = QUIET,
    relit: bool = False,
) -> RenderResult:
    """Renders one frame of a scene file.

    Args:
        scene_path: TOML.
        config: Preset, path, or precision such as ``32b32s64d``; changed by ``overrides`` (``key=value``).
        backend: One of `BACKENDS`.
        size: (width, height); the scene's unless given.
        mesh: Replaces the scene's mesh: a name or a file.
        background: A room's folder, in place of the scene's background.
        hits: The hit triangles are wanted: the hardware must be configured to deliver them.
        progress: Shows the steps.
        relit: Show the room in the scene's lights even if there is a photo of it.

    Raises:
        UserError: Something about the input is wrong, or the hardware flagged an error.
    """
    scene = load_scene(scene_path)
    if background is not None:
        scene = scene.with_room(background)
    if mesh is not None:
        scene = scene.with_mesh(mesh)
    width, height = size or (scene.frame.width, scene.frame.height)
    manifest = manifest_for(config, overrides, progress).manifest
    check_size((width, height), manifest)
    if backend == "reference":
        return _render_reference(scene, manifest, (width, height), progress)
    folder = scene.background.room
    if folder is not None and backend == "rtl":
        raise UserError("--backend rtl renders the object alone, without a room: use --backend model or reference")
    if hits and backend == "rtl":
        from colonnade.simulate import require_hits

        require_hits(manifest)

    begun = time.perf_counter()
    with progress.step("packing the scene"):
        room = None if folder is None else HeldRoom.load(folder, manifest)
        image = pack_scene(scene, manifest, room)
        registers = placement(scene, image.header, manifest, width, height, room)
    packed = time.perf_counter()
    seconds: dict[str, float | None] = {"pack": packed - begun, "build": None}
    report: dict[str, Any] = {}
    if backend == "rtl":
        from colonnade.simulate import build_simulator, render_rtl

        design = design_for(config, overrides, progress)
        build_simulator(design, progress)
        built = time.perf_counter()
        simulated = render_rtl(design, image, [registers], progress=progress)
        frame = simulated.frames[0]
        seconds |= {"build": built - packed, "run": time.perf_counter() - built}
        report["simulated_cycles_per_second"] = simulated.cycles_per_second
    else:
        from colonnade.model import render_model

        with progress.step("rendering in the model") as share:
            held = None if room is None else room.image
            frame = render_model(manifest, image, registers, lambda done, total: share(done / total), held)
        seconds["run"] = time.perf_counter() - packed
    require_no_errors(frame)
    report = frame_report(backend, manifest, image.header, frame) | {"seconds": seconds} | report
    seen = None if room is None else room.room
    view = float_placement(scene, image.header.extent, width, height, image.header.materials, seen)
    result = _result(frame, image, view, manifest, report)
    if room is None:
        return result
    report["bytes"] = room.image.byte_counts()
    return result if relit else replace(result, image=composited(result.image, frame, room.room))


def composited(image: npt.NDArray[np.float64], frame: Frame, room: Room) -> npt.NDArray[np.float64]:
    """The object in the room's photo, darkened where the object takes its light (differential rendering after Debevec,
    1998); the frame as it is if there is no photo. Linear, float64 [height, width, 3].
    """
    if room.photo is None or frame.ratio is None:
        return image
    height, width = frame.is_object.shape
    photo = room.photo
    if photo.shape[:2] != (height, width):
        from PIL import Image

        photo = np.asarray(Image.fromarray(photo).resize((width, height), Image.Resampling.BOX))
    behind = decode_srgb(photo) * (frame.ratio / 4096.0)
    return np.where(frame.is_object[..., None], image, behind)


def pack_scene(scene: Scene, manifest: Manifest, room: HeldRoom | None = None) -> SceneImage:
    """The scene image of a scene's mesh, made of what the scene says, and of its room."""
    mesh = load_mesh(scene.mesh_source)
    image = pack(mesh, manifest, made_of(mesh.materials, scene.material))
    if room is None:
        return image
    from colonnade.room_image import with_room

    return with_room(image, room, manifest)


def require_no_errors(frame: Frame) -> None:
    """A frame with an error bit is never shown as a good one."""
    advice = {
        "stackOverflow": "the traversal stack overflowed: raise columnBvhMemory.stackDepth",
        "illegalRecord": "a record beyond the scene was asked for: pack the scene again",
        "watchdog": "no pixel came for too long: the scene image may be corrupt, pack it again",
    }
    if frame.errors:
        raise UserError("the frame failed: " + "; ".join(advice.get(error, error) for error in frame.errors))


def _result(
    frame: Frame, image: SceneImage, view: FloatPlacement, manifest: Manifest, report: dict[str, Any]
) -> RenderResult:
    white = (1 << manifest.numbers["colourBits"]) - 1
    source = np.append(image.source_faces.astype(np.int64), -1)
    x, y = np.arange(view.width)[None, :, None], np.arange(view.height)[:, None, None]
    longest = np.abs(view.direction + x * view.step_x + y * view.step_y).max(axis=2)
    depth = frame.distance / (image.header.frame.scale * longest)
    return RenderResult(
        image=frame.colour.astype(np.float64) / white,
        object_mask=frame.is_object,
        hit_triangles=source[np.where(frame.is_object, frame.triangle, -1)],
        t=np.where(frame.is_object, depth, np.nan),
        report=report,
    )


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
    }


def mesh_report(header: ImageHeader) -> dict[str, Any]:
    """What a report says about the mesh."""
    return {"name": header.mesh, "triangles": header.triangles, "source_triangles": header.source_triangles}


def _render_reference(scene: Scene, manifest: Manifest, size: tuple[int, int], progress: Progress) -> RenderResult:
    from colonnade.reference import render_reference

    begun = time.perf_counter()
    mesh = load_mesh(scene.mesh_source)
    room = backdrop = None
    if scene.background.room is not None:
        from colonnade.depth_mesh import full_backdrop
        from colonnade.room import load_room

        room = load_room(scene.background.room)
        backdrop = full_backdrop(room)
    view = float_placement(scene, mesh.extent, *size, mesh.materials, room)
    loaded = time.perf_counter()
    reference = render_reference(mesh, view, progress, backdrop)
    report = {
        "backend": "reference",
        "config": manifest.config,
        "mesh": {"name": mesh.name, "triangles": len(mesh.faces), "source_triangles": mesh.source_count},
        "size": list(size),
        "cycles": None,
        "rays": reference.rays,
        "rays_per_cycle": None,
        "rays_per_cycle_in_box": None,
        "counters": {},
        "errors": [],
        "seconds": {"pack": loaded - begun, "build": None, "run": time.perf_counter() - loaded},
    }
    return RenderResult(reference.image, reference.object_mask, reference.hit_triangles, reference.t, report)
