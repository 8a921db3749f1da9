"""Frames of a camera that has moved: maps that are marched from where it is are better than stale ones."""

from __future__ import annotations

import numpy as np
import pytest

from colonnade_lab.evaluation.studies import moving_frames
from colonnade_lab.evaluation.studies.generated_rooms import plan_of


def test_ways_to_the_maps_of_a_moved_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(moving_frames, "MAPS", (160, 120))
    monkeypatch.setattr(moving_frames, "FRAME", (80, 60))
    monkeypatch.setattr(moving_frames, "SHARES", (1.0,))
    (errors,) = moving_frames.study_seeds([101], with_dists=False).values()
    assert list(errors) == list(moving_frames.WAYS)
    assert errors["fresh"].object > errors["marched"].object > errors["stale"].object + 2
    assert errors["fresh"].frame > errors["marched"].frame > errors["stale"].frame
    assert "|0.3 m, 10.0°|stale|" in moving_frames.table({"0.3 m, 10.0°": errors})


def test_the_camera_moves_and_turns_to_one_side() -> None:
    made = plan_of(100)
    start, end = (moving_frames.moved_camera(made, share).to_world for share in (0.0, 1.0))
    assert np.linalg.norm(end[:, 3] - start[:, 3]) == pytest.approx(0.3)
    assert (end[:, 3] - start[:, 3]) @ start[:, 0] == pytest.approx(0.3)
    # Right, and level with the ground: the angle between both views, less by what the view looks down
    ahead = [pose[[0, 2], 2] / np.linalg.norm(pose[[0, 2], 2]) for pose in (start, end)]
    assert np.degrees(np.arccos(ahead[0] @ ahead[1])) == pytest.approx(10.0)
    assert end[:, 2] @ start[:, 0] > 0, "to the right"
