"""Materials that differ from pass to pass: blended surfaces, and clear coats (docs/textures.md, docs/gather.md)."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.render.frames import render_frames
from colonnade.render.request import RenderRequest
from colonnade.scene.model import Background, Camera, Colour, Light, MeshSource, Paths, Scene

SKY, AMBIENT = (0.2, 0.4, 0.8), (0.5, 0.5, 0.5)
SCENE = Scene(
    mesh=MeshSource(name="cube"),
    camera=Camera(direction=(0.0, 0.0, 1.0)),
    light=Light(colour=(0.0, 0.0, 0.0)),
    ambient=Colour(AMBIENT),
    background=Background(colour=SKY),
)


def middle(
    scene: Scene, material: MeshMaterial, config: str, backend: Literal["model", "reference"] = "model"
) -> np.ndarray:
    """The colour in the middle of a cube of a material, linear."""
    mesh = replace(load_mesh("cube"), materials=(material,))
    (result,) = render_frames(RenderRequest(scene, config, mesh=mesh, backend=backend, size=(32, 24)))
    return np.asarray(result.image[10:14, 14:18].mean(axis=(0, 1)))


@pytest.mark.parametrize("backend", ["model", "reference"])
@pytest.mark.parametrize("coverage", [0.25, 0.75])
def test_a_blended_surface_is_there_in_its_share_of_the_passes(
    coverage: float, backend: Literal["model", "reference"]
) -> None:
    """Of 16 passes, whose thresholds are spread evenly; the others show what is behind the cube."""
    found = middle(SCENE.with_samples(16), MeshMaterial(albedo=(1.0, 0.5, 0.0), coverage=coverage), "small", backend)
    expected = coverage * np.array((0.5, 0.25, 0.0)) + (1 - coverage) * np.array(SKY)
    np.testing.assert_allclose(found, expected, atol=2e-3)


@pytest.mark.parametrize(("coverage", "share"), [(0.25, 0.0), (0.75, 1.0)])
def test_one_pass_shows_a_surface_or_a_pane(coverage: float, share: float, told: list[str]) -> None:
    found = middle(SCENE.with_samples(1), MeshMaterial(albedo=(1.0, 0.5, 0.0), coverage=coverage), "small")
    pane = np.array(SKY) * (1 - coverage * (1 - np.array((1.0, 0.5, 0.0))))
    expected = share * np.array((0.5, 0.25, 0.0)) + (1 - share) * pane
    np.testing.assert_allclose(found, expected, atol=2e-3)
    assert any("is not blended: from alpha 1/2 on it is opaque" in line for line in told)


def test_a_clear_coat_reflects_the_light_around(told: list[str]) -> None:
    """Six hundredths of it, on a black surface, as a layer of its own; a scene of one sample says that it lacks it."""
    coated = MeshMaterial(albedo=(0.0, 0.0, 0.0), clear_coat=(0.5, 0.0))
    scene = replace(SCENE, paths=Paths(gather=1))
    found = middle(scene.with_samples(4), coated, "small")
    np.testing.assert_allclose(found, 0.5 * 0.06 * np.array(AMBIENT), rtol=0.1)
    assert not any("clear coat" in line for line in told)
    assert middle(scene.with_samples(1), coated, "small").max() == 0.0
    assert any("1 clear coat is not shown" in line for line in told)
