"""The passes of a frame that the host adds up: its samples, and some of other layers (docs/gather.md, "Coats").

`view`, `render`, sequences and the reference have their passes from here.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from colonnade.common import notes
from colonnade.mesh.materials.materials import BLACK, LAYERS, Layer, MeshMaterial, as_rendered, in_layer
from colonnade.scene.model import Scene
from colonnade.scene.samples import PERIOD, Sample, samples_of_frame

#: The device's number for the colour 1.0 where light is gathered, as a factor: a ray may bring more than the mean.
_GATHER_EXPOSURE = 0.5
#: Samples of surfaces for each one of another layer.
_SAMPLES_OF_A_LAYER = 4


def exposed(scene: Scene) -> Scene:
    """The scene with the exposure of frames that the host adds up (docs/gather.md, "Exposure")."""
    return replace(scene, exposure=_GATHER_EXPOSURE) if scene.paths.gather else scene


def of_a_device(scene: Scene) -> Scene:
    """The scene for frames that a device shows by itself: one sample a pixel; a note names keys that need more."""
    keys = scene.blurs
    keys += [f"frame.samples = {scene.frame.samples}"] if (scene.frame.samples or 1) > 1 else []
    keys += ["frame.denoise"] if scene.frame.denoise else []
    gathers = may_have_layers(scene)
    keys += ["the samples, coats and highlights of paths.gather"] if gathers else []
    if keys:
        named = f"{' and '.join(keys)} {'is' if len(keys) == 1 and not gathers else 'are'}"
        notes.report([f"{named} of colonnade render: frames that a device shows by itself have one sample a pixel"])
    if scene.background.shows_panorama:
        notes.tell("colonnade render draws the panorama behind the object; a device by itself shows background.colour")
    return scene.with_samples(1)


def may_have_layers(scene: Scene) -> bool:
    """Whether frames show coats and highlights: gathered light, and not one sample a pixel."""
    return scene.paths.gather > 0 and scene.frame.samples != 1


def layers_of(materials: Iterable[MeshMaterial]) -> list[Layer]:
    """The layers, beside surfaces, in which materials, as a mesh has them, are not all black."""
    rendered = [as_rendered(one, gathers=True) for one in materials]
    return [layer for layer in LAYERS[1:] if any(in_layer(one, layer) != BLACK for one in rendered)]


def frame_passes(
    scene: Scene, materials: Iterable[MeshMaterial] = (), exposure: float = 0.0, number: int = 0
) -> list[Scene]:
    """The scene at each pass of its frame: at its samples, and one of each other layer after every fourth.

    Args:
        scene: At the beginning of the frame.
        materials: Of the mesh, with the scene's overrides: they have the layers.
        exposure: Progress of the motion while the shutter is open (`Motion.exposure`).
        number: Of the frame, if its colours are blended with those before (`samples_of_frame`).
    """
    count, of_frame = scene.frame.samples or 1, number % PERIOD
    passes = _samples(scene, count, of_frame)
    if count > 1 and may_have_layers(scene):
        layers, few = layers_of(materials), _samples(scene, max(1, count // _SAMPLES_OF_A_LAYER), of_frame)
        for number, sample in reversed(list(enumerate(few, 1))):
            after = -(-number * count // len(few))
            passes[after:after] = [replace(sample, layer=layer) for layer in layers]
    return [
        replace(scene, sample=sample, motion_progress=min(1.0, scene.motion_progress + sample.time * exposure))
        for sample in passes
    ]


def _samples(scene: Scene, count: int, number: int) -> list[Sample]:
    """The samples of a frame, each with as many lights as a pass can have."""
    samples = list(samples_of_frame(count, len(scene.lights), number))
    if not 0 < scene.pass_lights < len(scene.lights):
        return samples
    shares = light_shares([max(light.colour) for light in scene.lights], count, scene.pass_lights)
    return [replace(sample, shares=of_pass) for sample, of_pass in zip(samples, shares, strict=True)]


def light_shares(strengths: Sequence[float], count: int, slots: int) -> list[tuple[float, ...]]:
    """Factors of lights in each of ``count`` passes that have ``slots`` lights, so that the mean of each light is 1.

    A stronger light is in more passes, so that these are about as bright. If all passes have too few lights, those
    that come last in ``strengths`` are in none, and the others are as bright as all.
    """
    kept = sum(strengths[: count * slots])
    scale = sum(strengths) / kept if kept > 0 else 1.0
    counts = [0 if index < count * slots else count for index in range(len(strengths))]
    for _ in range(count * slots):
        open_lights = [index for index, passes in enumerate(counts) if passes < count]
        if open_lights:
            # A light that is in no pass comes first
            best = max(open_lights, key=lambda index: strengths[index] / counts[index] if counts[index] else np.inf)
            counts[best] += 1
    factors, place = np.zeros((count, len(strengths))), 0
    for index, passes in enumerate(counts):
        if index < count * slots:
            factors[np.arange(place, place + passes) % count, index] = scale * count / passes
            place += passes
    return [tuple(map(float, row)) for row in factors]
