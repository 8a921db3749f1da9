"""Frames that keep the light of those before: what is averaged, what is forgotten."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from colonnade.render.denoise import Guide, Noisy
from colonnade.render.frames import render, render_frames
from colonnade.render.history import Camera, History
from colonnade.render.request import RenderRequest

HEIGHT, WIDTH, NOISE = 40, 60, 0.1


def seen(shift: float, depth: float = 5.0) -> tuple[Guide, Camera]:
    """A wall before a camera that has gone right by so many pixels of its picture."""
    rays = np.array([[-WIDTH / 2, 1.0, 0.0], [-HEIGHT / 2, 0.0, 1.0], [30.0, 0.0, 0.0]]) / 30
    origin = np.array([shift * depth / 30, 0.0, 0.0])
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    position = origin + depth * np.einsum("ij,yxj->yxi", rays, np.stack([np.ones_like(x), x, y], axis=2))
    return Guide.of(position, np.ones((HEIGHT, WIDTH), dtype=bool)), Camera(origin, rays)


def frame(number: int, mean: np.ndarray | float = 0.5) -> Noisy:
    noise = np.random.default_rng(number).normal(size=(HEIGHT, WIDTH, 1)) * NOISE * np.ones(3)
    return Noisy(mean + noise, np.full((HEIGHT, WIDTH), NOISE**2))


def test_points_keep_their_light_while_the_camera_moves() -> None:
    """A pattern on the wall moves through the picture, and stays as sharp as samples of it are."""
    history = History()
    for number in range(8):
        guide, camera = seen(1.5 * number)
        pattern = 0.5 + 0.2 * np.sin(guide.position[..., :1] * 2)
        found = history.blended("wall", frame(number, pattern), guide, camera)
    known = np.s_[:, :-12]
    assert (found.colour - pattern)[known].std() < 0.45 * NOISE
    assert found.variance[known].mean() < 0.3 * NOISE**2
    edge = np.s_[:, -1]
    np.testing.assert_array_equal(found.colour[edge], frame(7, pattern).colour[edge], "it is seen for the first time")


@pytest.mark.parametrize("light", [0.1, 0.9])
def test_light_that_changes_is_followed_at_once(light: float) -> None:
    history, (guide, camera) = History(), seen(0.0)
    for number in range(6):
        history.blended("wall", frame(number), guide, camera)
    found = history.blended("wall", frame(6, light), guide, camera)
    assert abs(found.colour.mean() - light) < 0.15 * abs(light - 0.5)


def test_another_surface_has_no_history() -> None:
    history, new = History(), frame(1, 0.6)
    history.blended("wall", frame(0), *seen(0.0))
    np.testing.assert_array_equal(history.blended("wall", new, *seen(0.0, 5.2)).colour, new.colour)
    np.testing.assert_array_equal(history.blended("other", new, *seen(0.0)).colour, new.colour)


def test_frames_of_one_sample_grow_calm(tmp_path: Path) -> None:
    """The last of eight frames of an object that turns slowly is nearer the truth than by itself."""
    scene = tmp_path / "scene.toml"
    scene.write_text('mesh.name = "teapot:4"\npaths.gather = 1\nmotion.turn = 0.01\n')
    request = RenderRequest(scene, "small", backend="model", size=(64, 48), frames=8, samples=1, denoise=True)
    *_, last = render_frames(request)
    truth, alone = (render(replace(request, samples=samples)).image for samples in (64, 1))
    inner = np.s_[20:32, 24:40]
    errors = [((image - truth)[inner] ** 2).mean() for image in (last.image, alone)]
    assert errors[0] < 0.75 * errors[1]
