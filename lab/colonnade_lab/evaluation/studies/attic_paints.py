"""Procedural textures of the synthetic attic: albedo as a function of position."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from colonnade.common.types import Floats

#: Maps points of a part in its own coordinates, float64 [n, 3], to linear albedo, float64 [n, 3].
Paint = Callable[[Floats], Floats]
Rgb = tuple[float, float, float]


def plaster(colour: Rgb) -> Paint:
    """One colour with slow variations."""

    def paint(points: Floats) -> Floats:
        cloud = np.sin(points @ (2.1, 1.3, 1.7)) * np.sin(points @ (-1.1, 2.9, 1.9))
        return np.asarray(np.array(colour) * (1 + 0.06 * cloud[:, None]))

    return paint


def boards(colour: Rgb, along: int, across: int, width: float) -> Paint:
    """Boards of a width along one axis, each with its own shade, with seams and staggered ends."""

    def paint(points: Floats) -> Floats:
        board = np.floor(points[:, across] / width)
        lengths = points[:, along] / (7 * width) + 0.37 * board
        shade = 0.82 + 0.30 * _noise(board * 7.0 + np.floor(lengths))
        seam = (np.abs(points[:, across] / width - np.rint(points[:, across] / width)) < 0.03) | (lengths % 1 < 0.01)
        grain = 1 + 0.05 * np.sin(points[:, across] * 240 + 3 * np.sin(points[:, along] * 9))
        return np.asarray(np.array(colour) * (np.where(seam, 0.45, shade) * grain)[:, None])

    return paint


def spiral(light: Rgb, dark: Rgb) -> Paint:
    """Two stripes that wind around the vertical axis."""

    def paint(points: Floats) -> Floats:
        phase = np.arctan2(points[:, 2], points[:, 0]) / (2 * np.pi) + points[:, 1] * 1.5
        return np.where((phase % 0.5 < 0.17)[:, None], np.array(dark), np.array(light))

    return paint


def rings(colour: Rgb, width: float) -> Paint:
    """Rings of a width around the vertical axis, alternating in brightness."""

    def paint(points: Floats) -> Floats:
        ring = np.floor(np.hypot(points[:, 0], points[:, 2]) / width) % 2
        return np.asarray(np.array(colour) * (1 - 0.35 * ring)[:, None])

    return paint


def stripes(points: Floats) -> Floats:
    """The coloured gores of a beach ball."""
    gore = np.floor(np.arctan2(points[:, 2], points[:, 0]) / (2 * np.pi) * 10).astype(np.intp) % 3
    return np.array([[0.80, 0.20, 0.12], [0.85, 0.80, 0.66], [0.12, 0.30, 0.62]])[gore]


def _noise(number: Floats) -> Floats:
    """Pseudo-random values from 0 to 1 for whole numbers."""
    return np.asarray(np.abs(np.sin(number * 12.9898) * 43758.5453) % 1, dtype=np.float64)
