"""Light of the walls around a room, and its fit beside point lights."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from colonnade_lab.evaluation.studies.synthetic_attic import attic
from scipy.optimize import nnls

from colonnade.common.image_io import encode_srgb
from colonnade.common.vectors import unit_vectors
from colonnade.environment.fitted_lights import fitted_lights
from colonnade.environment.light_fit import fit_lights
from colonnade.environment.lights import MIN_HEIGHT, irradiance, light_box, world_surface
from colonnade.environment.model import Environment
from colonnade.environment.surround import PATCHES, Surround, non_negative_least_squares, wall_exposures

LOW, HIGH = np.array([-2.0, 0.0, -3.0]), np.array([2.0, 2.5, 3.0])


@pytest.fixture(scope="module")
def environment() -> Environment:
    return attic(96, 72).environment


def test_directions_and_exposures_see_the_same_walls() -> None:
    """The exposure of a surface is the mean of the radiance over its directions, weighted by their cosine."""
    random = np.random.default_rng(1)
    walls = Surround(LOW, HIGH, random.uniform(0, 2, (PATCHES, 3)))
    point = np.array([0.4, 1.1, -0.7])
    directions = unit_vectors(random.normal(size=(40_000, 3)))
    for normal in unit_vectors(np.array([[0.3, 0.8, 0.5], [-0.3, -0.8, -0.5]])):
        cosine = (directions @ normal).clip(min=0.0)
        expected = (walls.at(point, directions) * cosine[:, None]).sum(axis=0) / cosine.sum()
        found = wall_exposures(point[None], normal[None], LOW, HIGH) @ walls.radiance
        np.testing.assert_allclose(found[0], expected, rtol=0.05)


def test_even_walls_are_ambient_light() -> None:
    points, normals = np.random.default_rng(2).uniform(LOW, HIGH, (50, 3)), np.eye(3)[np.arange(50) % 3]
    np.testing.assert_allclose(wall_exposures(points, normals, LOW, HIGH).sum(axis=1), 1.0, rtol=1e-9)


def test_least_squares_are_those_of_the_library() -> None:
    random = np.random.default_rng(3)
    columns, target = random.uniform(0, 1, (80, 12)) + 2 * np.eye(80, 12), random.uniform(-1, 1, 80)
    found = non_negative_least_squares(columns.T @ columns, columns.T @ target)
    np.testing.assert_allclose(found, nnls(columns, target)[0], atol=1e-4)


def test_a_window_is_light_of_a_wall(environment: Environment) -> None:
    """One bright patch of the ceiling lights the room: the walls explain it, and less is left for lamps."""
    low, high = light_box(environment)
    low = np.array([low[0], low[1] - MIN_HEIGHT, low[2]])
    points, normals = (surface.reshape(-1, 3) for surface in world_surface(environment))
    radiance = np.full((PATCHES, 3), 0.15)
    window = 8
    radiance[window] = 4.0
    light = (wall_exposures(points, normals, low, high) @ radiance).reshape(environment.albedo.shape)
    room = replace(environment, photo=encode_srgb(environment.albedo * light))
    fit, without = fit_lights(room, 1, walls=True), fit_lights(room, 1)
    assert fit.surround is not None and without.surround is None
    assert fit.surround.radiance.mean(axis=1).argmax() == window
    assert fit.surround.radiance[window].mean() > 5 * np.median(fit.surround.radiance)
    lamps = [irradiance(points, normals, replace(one.lights, ambient=np.zeros(3))).mean() for one in (fit, without)]
    assert lamps[0] < 0.7 * lamps[1]


def test_walls_are_cached(environment: Environment, tmp_path: Path) -> None:
    first = fitted_lights(environment, 0, tmp_path, walls=True)
    assert first.surround is not None
    assert repr(fitted_lights(environment, 0, tmp_path, walls=True)) == repr(first)
    assert fitted_lights(environment, 0, tmp_path).surround is None
