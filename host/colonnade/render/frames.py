"""Frames of a scene through a backend, and the reports of what they took."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from colonnade.common.errors import UserError
from colonnade.common.framebuffer import Frame
from colonnade.common.progress import QUIET, Progress
from colonnade.design.frame_limits import check_size
from colonnade.design.generator import GeneratedDesign, design_for, manifest_for
from colonnade.design.manifest import Manifest
from colonnade.environment.encoded import EncodedEnvironment
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.render.composite import composited
from colonnade.render.report import frame_report
from colonnade.render.result import RenderResult
from colonnade.scene.model import Scene
from colonnade.scene.parser import load_scene
from colonnade.scene.view import View, make_view, with_overrides
from colonnade.scene_image.file import SceneImage
from colonnade.scene_image.packer import pack

BACKENDS = ("rtl", "model", "reference")


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
        scene = scene.with_environment(background)
    if mesh is not None:
        scene = scene.with_mesh(mesh)
    width, height = size or (scene.frame.width, scene.frame.height)
    manifest = manifest_for(config, overrides, progress).manifest
    check_size((width, height), manifest)
    places = [scene.at(share) for share in scene.motion.shares(frames)]
    if backend == "reference":
        from colonnade.render.reference_frames import reference_frames

        yield from reference_frames(places, manifest, (width, height), progress)
        return
    folder = scene.background.room
    if hits and backend == "rtl":
        from colonnade.device.verilator import require_hits

        require_hits(manifest)

    begun = time.perf_counter()
    with progress.step("packing the scene"):
        environment = None if folder is None else EncodedEnvironment.load(folder, manifest)
        image = pack_scene(scene, manifest, environment)
        shows_environment = relit or environment is None or environment.environment.photo is None
        registers = [
            frame_registers(place, image.header, manifest, width, height, environment, shows_environment)
            for place in places
        ]
    packed = time.perf_counter() - begun
    seen = None if environment is None else environment.environment
    if backend == "rtl":
        rendered = _rtl_frames(design_for(config, overrides, progress), image, registers, progress)
    else:
        rendered = _model_frames(manifest, image, registers, progress)
    for place, (frame, more) in zip(places, rendered, strict=True):
        require_no_errors(frame)
        report = frame_report(backend, manifest, image.header, frame) | {"share": place.share} | more
        report["seconds"] = {"pack": packed, "build": None} | report["seconds"]
        view = make_view(place, image.header.extent, width, height, image.header.materials, seen)
        result = _result(frame, image, view, manifest, report)
        if environment is not None:
            report["bytes"] = environment.image.byte_counts()
            if not relit:
                result = replace(result, image=composited(result.image, frame, environment.environment))
        yield result


#: A frame, and what its report says beyond `frame_report`.
Rendered = tuple[Frame, dict[str, Any]]


def _rtl_frames(
    design: GeneratedDesign, image: SceneImage, registers: list[dict[str, int]], progress: Progress
) -> Iterator[Rendered]:
    """All frames of one run; each has its part of the seconds."""
    from colonnade.device.simulator_build import build_simulator
    from colonnade.device.verilator import render_rtl

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
    from colonnade.device.bit_exact import loaded_model, model_frame

    model = loaded_model(manifest, image)

    def one(values: dict[str, int]) -> Rendered:
        begun = time.perf_counter()
        with progress.step("rendering in the model") as share:
            frame = model_frame(model, values, lambda done, total: share(done / total))
        return frame, {"seconds": {"run": time.perf_counter() - begun}}

    yield from map(one, registers)


def pack_scene(scene: Scene, manifest: Manifest, environment: EncodedEnvironment | None = None) -> SceneImage:
    """The scene image of a scene's mesh, made of what the scene says, and of its room."""
    mesh = load_mesh(scene.mesh_source)
    image = pack(mesh, manifest, with_overrides(mesh.materials, scene.material))
    if environment is None:
        return image
    from colonnade.scene_image.environment import with_environment

    return with_environment(image, environment, manifest)


def require_no_errors(frame: Frame) -> None:
    """A frame with an error bit is never shown as a good one."""
    advice = {
        "stackOverflow": "the traversal stack overflowed: raise columnBvhMemory.stackDepth",
        "illegalRecord": "a record was illegal, or pointed outside its section: pack the scene again",
        "watchdog": "no pixel came for longer than any legal frame takes: the image may be corrupt, pack it again",
    }
    if frame.errors:
        raise UserError("the frame failed: " + "; ".join(advice.get(error, error) for error in frame.errors))


def _result(frame: Frame, image: SceneImage, view: View, manifest: Manifest, report: dict[str, Any]) -> RenderResult:
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
