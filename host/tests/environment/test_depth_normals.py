"""Normals of depth maps: exact on planes, and far better than windows' where depth is noisy."""

from __future__ import annotations

import numpy as np
import pytest
from capture_files import ROOMS, phone, recording_of
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_edt

from colonnade.capture.picture import fitted
from colonnade.capture.source import Frame, Lens
from colonnade.environment.depth_normals import normals_of_depth
from colonnade.environment.load import load_environment
from colonnade.environment.model import Environment, EnvironmentCamera
from colonnade.environment.repair import filled


def degrees(first: np.ndarray, second: np.ndarray) -> float:
    return float(np.degrees(np.arccos((first * second).sum(axis=2).clip(-1, 1))).mean())


def captured(room: Environment, noise: float) -> np.ndarray:
    """Depth of the room as a phone gives it, in the size of the maps."""
    recording = phone(recording_of(room, 1), noise)
    frame = Frame(0, 0.0, recording.photo, recording.depth, Lens(*recording.lens), np.eye(3, 4))
    return fitted(frame, room.width, room.height).depth


@pytest.fixture(scope="module")
def living() -> Environment:
    return load_environment(ROOMS / "living")


def test_a_plane_has_its_normal_everywhere() -> None:
    camera = EnvironmentCamera(300.0, 310.0, 170.0, 110.0, np.eye(3, 4))
    rays = camera.directions(320, 240)
    normal = np.array([0.3, -0.5, -0.8]) / np.sqrt(0.98)
    depth = -2.0 / (rays @ normal)
    found = normals_of_depth(depth, np.zeros(depth.shape, bool), camera)
    assert np.abs(found.normals - normal).max() < 1e-6
    assert (found.planes, found.on_planes) == (1, 1.0)


def test_noise_is_measured_and_planes_average_it(living: Environment) -> None:
    holes = np.zeros((living.height, living.width), bool)
    limits = {0.0: 4.5, 0.005: 7.0, 0.01: 9.5}
    for noise, limit in limits.items():
        depth = captured(living, noise)
        found = normals_of_depth(depth, holes, living.camera)
        assert degrees(found.normals, living.normals) < limit
        if noise:
            assert 0.6 * noise < found.noise < 1.1 * noise
    windows = normals_of_depth(depth, holes, living.camera, max_planes=0)
    assert degrees(windows.normals, living.normals) > 1.5 * degrees(found.normals, living.normals)


@given(st.integers(1, 30), st.integers(1, 30), st.floats(0.0, 0.99), st.integers(0, 2**32 - 1))
def test_a_missing_pixel_takes_a_nearest_one(width: int, height: int, share: float, seed: int) -> None:
    missing = np.random.default_rng(seed).random((height, width)) < share
    missing[height // 2, width // 3] = False
    pixels = np.arange(missing.size, dtype=np.float64).reshape(missing.shape)
    found = filled(pixels, missing).astype(int)
    assert not missing.ravel()[found].any()
    rows, columns = np.indices(missing.shape)
    squared = (found // width - rows) ** 2 + (found % width - columns) ** 2
    assert (squared == np.rint(distance_transform_edt(missing) ** 2)).all()


def test_holes_take_the_normals_of_what_is_beside_them(living: Environment) -> None:
    holes = np.zeros((living.height, living.width), bool)
    holes[200:240, 300:340] = True
    depth = np.where(holes, 0.2, living.depth)
    found = normals_of_depth(depth, holes, living.camera)
    whole = normals_of_depth(living.depth, ~holes & False, living.camera)
    assert degrees(found.normals[~holes][None], whole.normals[~holes][None]) < 1.0
    assert np.isfinite(found.normals).all()
    assert ((found.normals * living.camera.directions(640, 480)).sum(axis=2) < 0).all()
