"""Frames of objects that move before a camera that moves, by the model, and what each takes: encoder, refit, rays, RTL.

As on a headset, each frame has a photo and a depth map of its camera, and so maps of its own.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np
from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import GeneratedDesign
from colonnade.device.bit_exact import loaded_model, model_frame
from colonnade.device.device import require_no_errors
from colonnade.device.verilator import render_rtl
from colonnade.environment.model import EnvironmentCamera
from colonnade.environment.sequence import Sequence
from colonnade.mesh.load import load_mesh
from colonnade.render.camera_look import CameraLook
from colonnade.render.history import History
from colonnade.render.host_frame import HostFrame
from colonnade.render.passes import model_passes
from colonnade.render.sequence_frames import sequence_scenes
from colonnade.scene.model import Camera, Scene
from colonnade.scene.object_pose import Placed
from colonnade.scene.passes import exposed
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene.view import world_view
from colonnade.scene_image.device_image import load_cycles
from numpy.typing import NDArray

from colonnade_lab.evaluation.demonstration.measure import TimedEncoder, differing_pixels


@dataclass(frozen=True)
class MovedCost:
    """What a frame takes; rays, steps and cycles are of its first pass.

    Attributes:
        samples: Passes of the frame.
        encode_ms: CPU time of the live encoder.
        refit_ms: Time of pose, vertices and records, by the driver's code on a core of the host.
        load_cycles: Of its maps.
        rays_in_box: Rays that enter the box of all objects.
        node_reads: Of all rays.
        march_steps: Of all rays.
        cycles: Of the RTL; None without it.
        differing: Pixels in which the RTL is not the model.
    """

    samples: int
    encode_ms: float
    refit_ms: float
    load_cycles: int
    rays_in_box: int
    node_reads: int
    march_steps: int
    cycles: int | None = None
    differing: int = 0


def cameras(scene: Scene, size: tuple[int, int], frames: int) -> list[EnvironmentCamera]:
    """The cameras of the frames of a scene whose camera has a position, for maps of a size."""
    extent, found = load_mesh("cube").extent, []
    for share in scene.frame_progress(frames):
        camera = world_view(Placed(scene.at(share), extent), *size).camera
        right, up, back = camera.axes
        fx, fy = (1 / float(np.linalg.norm(step)) for step in (camera.step_x, camera.step_y))
        pose = np.column_stack([right, -up, -back, camera.position])
        found.append(EnvironmentCamera(fx, fy, size[0] / 2, size[1] / 2, pose))
    return found


def run(
    scene: Scene,
    sequence: Sequence,
    design: GeneratedDesign,
    take: Callable[[NDArray[np.uint8]], None],
    rtl_frames: Collection[int] = (),
    progress: Progress = QUIET,
) -> tuple[int, int, list[MovedCost]]:
    """Render frames of a scene's motion; answers its triangles, how many of them bend, and what each frame takes.

    Args:
        scene: The scene, whose objects have transforms; it names its samples. The cameras are the sequence's.
        sequence: The room in each frame.
        design: The hardware.
        take: Gets the frames, sRGB, uint8 [height, width, 3].
        rtl_frames: Numbers of frames whose first pass the RTL renders too.
        progress: Shows the frames.
    """
    frames, size = len(sequence), (sequence.content.width, sequence.content.height)
    encoder, history, costs = TimedEncoder(design, sequence), History(), list[MovedCost]()
    here = exposed(replace(scene, camera=Camera(), motion=replace(scene.motion, camera=())))
    scenes = sequence_scenes(sequence, here, design.manifest, size, encoder)
    with progress.step(f"rendering {frames} frames of {len(scene.objects)} objects") as report:
        for number, (prepared, share) in enumerate(zip(scenes, scene.frame_progress(frames), strict=True)):
            pose, begun = prepared.scene.at(share), time.perf_counter()
            prepared.image.posed(share)
            refit_ms = 1e3 * (time.perf_counter() - begun)
            posed = prepared.lit_at(pose).with_scene(pose)
            passes = tuple(posed.passes(pose, scene.opening(frames), number))
            look = CameraLook.of(pose, posed.photo, size)
            frame = HostFrame(posed, size, passes, denoise="atrous", look=look, number=number, history=history)
            registers = [frame.registers(one) for one in passes]
            ((found, _, _),) = model_passes([frame], [registers])
            require_no_errors(found.frame.errors)
            take(frame.pixels(found))
            costs.append(_cost(posed, design, registers, (encoder.milliseconds, refit_ms), number in rtl_frames))
            report((number + 1) / frames)
    assert prepared.mesh is not None
    bent = sum(len(one.faces) for one in prepared.mesh.objects if one.clip is not None)
    return prepared.image.header.triangles, bent, costs


def _cost(
    posed: DeviceScene,
    design: GeneratedDesign,
    registers: list[dict[str, int]],
    milliseconds: tuple[float, float],
    has_rtl: bool,
) -> MovedCost:
    frame = model_frame(loaded_model(posed.manifest, posed.image), registers[0])
    cycles, differing = None, 0
    if has_rtl:
        rtl = render_rtl(design, posed.image, [registers[0]]).frames[0]
        require_no_errors(rtl.errors)
        cycles, differing = rtl.counters["cycles"], differing_pixels(rtl, frame)
    assert posed.maps is not None
    counters = frame.counters
    return MovedCost(
        len(registers),
        *milliseconds,
        load_cycles(posed.maps.image, posed.manifest),
        counters["raysInBox"],
        counters["nodeReads"],
        counters["marchSteps"],
        cycles,
        differing,
    )
