"""Frames of a scene through a backend, and the reports of what they took."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from colonnade.compositing import composited
from colonnade.errors import UserError
from colonnade.frame import Frame
from colonnade.generator import GeneratedDesign, design_for, manifest_for
from colonnade.image import ImageHeader, SceneImage
from colonnade.manifest import Manifest
from colonnade.meshes import load_mesh
from colonnade.pack import pack
from colonnade.placement import FloatPlacement, float_placement, placement
from colonnade.progress import QUIET, Progress
from colonnade.room_registers import HeldRoom
from colonnade.scene import Scene, load_scene
from colonnade.sizes import check_size
from colonnade.viewpoint import made_of

if TYPE_CHECKING:
    pass

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
        ratio: uint16 [height, width, 3], see `Frame`; None without a room.
    """

    image: npt.NDArray[np.float64]
    object_mask: npt.NDArray[np.bool_]
    hit_triangles: npt.NDArray[np.int64]
    t: npt.NDArray[np.float64]
    report: dict[str, Any]
    ratio: npt.NDArray[np.uint16] | None = None


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
    """Renders one frame of a scene file: the first of `render_frames`."""
    (result,) = render_frames(scene_path, config, overrides, backend, size, 1, mesh, background, hits, progress, relit)
    return result


def render_frames(
    scene_path: Path,
    config: str,
    overrides: Sequence[str],
    backend: str,
    size: tuple[int, int] | None,
    frames: int,
    mesh: str | None = None,
    background: Path | None = None,
    hits: bool = False,
    progress: Progress = QUIET,
    relit: bool = False,
) -> Iterator[RenderResult]:
    """Renders the frames of a scene file's motion; mesh and room are loaded once.

    Args:
        scene_path: TOML.
        config: Preset, path, or precision such as ``32b32s64d``; changed by ``overrides`` (``key=value``).
        backend: One of `BACKENDS`.
        size: (width, height); the scene's unless given.
        frames: How many, from 1: the first is the scene as it stands.
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
    places = [scene.at(share) for share in scene.motion.shares(frames)]
    if backend == "reference":
        from colonnade.reference_frames import reference_frames

        yield from reference_frames(places, manifest, (width, height), progress)
        return
    folder = scene.background.room
    if hits and backend == "rtl":
        from colonnade.simulate import require_hits

        require_hits(manifest)

    begun = time.perf_counter()
    with progress.step("packing the scene"):
        room = None if folder is None else HeldRoom.load(folder, manifest)
        image = pack_scene(scene, manifest, room)
        shows_room = relit or room is None or room.room.photo is None
        registers = [placement(place, image.header, manifest, width, height, room, shows_room) for place in places]
    packed = time.perf_counter() - begun
    seen = None if room is None else room.room
    if backend == "rtl":
        rendered = _rtl_frames(design_for(config, overrides, progress), image, registers, progress)
    else:
        rendered = _model_frames(manifest, image, registers, progress)
    for place, (frame, more) in zip(places, rendered, strict=True):
        require_no_errors(frame)
        report = frame_report(backend, manifest, image.header, frame) | {"share": place.share} | more
        report["seconds"] = {"pack": packed, "build": None} | report["seconds"]
        view = float_placement(place, image.header.extent, width, height, image.header.materials, seen)
        result = _result(frame, image, view, manifest, report)
        if room is not None:
            report["bytes"] = room.image.byte_counts()
            if not relit:
                result = replace(result, image=composited(result.image, frame, room.room))
        yield result


#: A frame, and what its report says beyond `frame_report`.
Rendered = tuple[Frame, dict[str, Any]]


def _rtl_frames(
    design: GeneratedDesign, image: SceneImage, registers: list[dict[str, int]], progress: Progress
) -> Iterator[Rendered]:
    """All frames of one run; each has its part of the seconds."""
    from colonnade.simulate import render_rtl
    from colonnade.simulator_build import build_simulator

    begun = time.perf_counter()
    build_simulator(design, progress)
    built = time.perf_counter()
    simulated = render_rtl(design, image, list(registers), progress=progress)
    run = (time.perf_counter() - built) / len(registers)
    for frame in simulated.frames:
        seconds = {"build": built - begun, "run": run}
        yield frame, {"seconds": seconds, "simulated_cycles_per_second": simulated.cycles_per_second}


def _model_frames(
    manifest: Manifest, image: SceneImage, registers: list[dict[str, int]], progress: Progress
) -> Iterator[Rendered]:
    """Frame by frame of a model that is loaded once."""
    from colonnade.model import loaded_model, model_frame

    model = loaded_model(manifest, image)

    def one(values: dict[str, int]) -> Rendered:
        begun = time.perf_counter()
        with progress.step("rendering in the model") as share:
            frame = model_frame(model, values, lambda done, total: share(done / total))
        return frame, {"seconds": {"run": time.perf_counter() - begun}}

    yield from map(one, registers)


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
        "illegalRecord": "a record was illegal, or pointed outside its section: pack the scene again",
        "watchdog": "no pixel came for longer than any legal frame takes: the image may be corrupt, pack it again",
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
        ratio=frame.ratio,
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
        "room": room_report(manifest, counters),
    }


def room_report(manifest: Manifest, counters: Mapping[str, int]) -> dict[str, float] | None:
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
