"""Procedural textures of the generated rooms: strong patterns, which a palette and masks hold badly."""

from __future__ import annotations

import numpy as np
from colonnade.common.types import Floats

from colonnade_lab.evaluation.studies.attic_paints import Paint, Rgb


def checkers(dark: Rgb, light: Rgb, width: float) -> Paint:
    """Cubes of two colours, which are squares on a flat part, with slow variations of brightness."""

    def paint(points: Floats) -> Floats:
        # Off the planes of axis-aligned parts, where rounding would decide
        cube = np.floor(points / width + 0.313).sum(axis=1) % 2
        shade = 1 + 0.08 * np.sin(points @ (1.9, 2.3, 1.4))
        return np.asarray(np.where((cube == 0)[:, None], np.array(dark), np.array(light)) * shade[:, None])

    return paint


def marble(dark: Rgb, light: Rgb, frequency: float) -> Paint:
    """Veins of many shades between two colours; ``frequency`` in veins per metre."""

    def paint(points: Floats) -> Floats:
        phase = points @ (frequency, 0.7 * frequency, 1.3 * frequency)
        for octave in (1.0, 2.1, 4.3, 8.7):
            phase = phase + np.sin(octave * frequency * np.roll(points, 1, axis=1) @ (1.0, 1.7, 0.6)) / octave
        vein = 0.5 + 0.5 * np.sin(np.pi * phase)
        return np.asarray(np.array(dark) + (np.array(light) - np.array(dark)) * vein[:, None] ** 2)

    return paint


def poster(colours: Floats, across: int, centre: tuple[float, float, float]) -> Paint:
    """A framed picture of discs and bars; five colours, float64 [5, 3]; its width lies along an axis.

    Parts of a turned box get points in the box's own axes, so posters are not turned.
    """

    def paint(points: Floats) -> Floats:
        x, y = points[:, across] - centre[across], points[:, 1] - centre[1]
        layers = [
            np.hypot(x + 0.06, y - 0.03) < 0.09,
            np.floor((x + 0.8 * y) / 0.035) % 3 == 0,
            np.abs(np.hypot(x - 0.1, y + 0.06) - 0.07) < 0.015,
            (np.floor(y / 0.024) % 2 == 0) & (x > 0.05) & (np.sin(x * 300) > -0.6),
        ]
        return np.asarray(colours[np.select(layers, [1, 2, 3, 4], 0)])

    return paint
