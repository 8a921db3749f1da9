"""Generated rooms from cameras beside the maps'."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from colonnade_lab.evaluation.studies.generated_rooms import generated_room
from colonnade_lab.evaluation.studies.moved_views import METRES, measure_seed, moved_rays, table


def test_a_moved_camera_sees_the_room() -> None:
    report = measure_seed(3, "live", views=2)
    assert report.kind == "lean-to"
    assert 0.3 < report.seen <= report.hit + report.hidden + 0.02
    assert 0.95 < report.worst <= report.right <= 1.0
    assert 1.0 < report.steps < 30.0
    lines = table({3: replace(report, right=0.96, worst=0.955)}).splitlines()
    assert lines[2].startswith("|3|lean-to|") and "96.00, 95.50" in lines[2]


def test_cameras_stand_beside_that_of_the_maps() -> None:
    environment, random = generated_room(3, 64, 48).environment, np.random.default_rng(1)
    origins = np.array([moved_rays(environment, random)[0][0] for _ in range(20)])
    assert len(np.unique(origins, axis=0)) == 20 and 0.2 < np.abs(origins).max() <= METRES
