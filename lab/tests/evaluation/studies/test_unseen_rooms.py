"""Generated rooms, and the study of encodings and marches in them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from colonnade.cli.main import cli
from colonnade.common.errors import UserError
from colonnade.reference.environment.ray_march import HIDDEN, HIT, LEFT_VIEW, MarchHits
from colonnade.reference.environment.surface import SurfaceHits

from colonnade_lab.evaluation.studies import unseen_rooms
from colonnade_lab.evaluation.studies.environment_accuracy import Comparison
from colonnade_lab.evaluation.studies.generated_rooms import CORRIDOR, KINDS, LENSES, REPORT, TUNING, generated_room
from colonnade_lab.evaluation.studies.probe_spheres import Rays
from colonnade_lab.evaluation.studies.unseen_rooms import CAUSES, MAX_STEPS, measure_seed, parse_seeds, table
from colonnade_lab.evaluation.studies.visible_surface import VisibleSurface


def test_a_seed_decides_everything() -> None:
    first, again, other = (generated_room(seed, 64, 48).environment for seed in (3, 3, 7))
    for name in ("albedo", "normals", "depth", "photo"):
        np.testing.assert_array_equal(getattr(first, name), getattr(again, name))
    assert not np.array_equal(first.depth, other.depth)


@pytest.mark.parametrize("seed", range(8))
def test_rooms_are_what_their_kind_says(seed: int) -> None:
    """No hole, no camera inside furniture, a lens within the bounds, and a corridor's depth."""
    environment = generated_room(seed, 64, 48).environment
    width = 2 * np.degrees(np.arctan(32 / environment.fx))
    assert LENSES[0] <= width <= LENSES[1]
    assert environment.depth.min() > 0.2
    assert (environment.depth.max() > CORRIDOR - 3) == (KINDS[seed % 4] == "corridor")
    assert environment.albedo.min() >= 0.0 and environment.albedo.max() <= 1.0
    sloped = (np.abs(environment.normals @ environment.camera_to_world[1, :3] + 0.7) < 0.28).mean() > 0.03
    assert sloped or KINDS[seed % 4] in ("room", "corridor")


def test_nobody_tunes_on_the_reported_seeds() -> None:
    assert not set(TUNING) & set(REPORT)


@pytest.mark.parametrize(
    ("text", "seeds"), [("4", [4]), ("0-3", [0, 1, 2, 3]), ("100-101, 7,7", [100, 101, 7]), ("5-5", [5])]
)
def test_seeds(text: str, seeds: list[int]) -> None:
    assert parse_seeds(text) == seeds


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "'' is no seed"),
        ("a", "'a' is no seed"),
        ("1,,2", "'' is no seed"),
        ("-3", "'-3' is no seed"),
        ("3-1", "is empty"),
        ("1234567", "from 0 to 999999"),
        ("٣", "is no seed"),
        ("0-999999", "more than 1,000"),
    ],
)
def test_no_seeds(text: str, message: str) -> None:
    with pytest.raises(UserError, match=message):
        parse_seeds(text)


def test_the_commands_refuse_bad_seeds() -> None:
    runner = CliRunner()
    for words, message in (
        (["occlusion", "--rooms", "0-"], "is no seed"),
        (["views", "room"], "is no seed"),
        (["generated", "0-"], "is no seed"),
        (["generated"], "SEEDS"),
    ):
        result = runner.invoke(cli, ["study", *words])
        assert result.exit_code == 2 and message in result.output


def test_a_room_is_measured() -> None:
    """Right and wrong rays are all rays, and the maps fit the memory."""
    report = measure_seed(3, with_dists=False, size=(160, 120))
    assert report.kind == "lean-to" and report.rays > 1000 and report.dists is None
    assert min(report.full, report.planes, report.device, report.true) > 0.9
    np.testing.assert_allclose(report.device + sum(report.causes.values()), 1.0)
    assert report.bytes == {"albedo": 16384, "normals": 16384, "planes": 12288}
    lines = table({3: report, 4: replace(report, device=0.5)}).splitlines()
    assert lines[2].startswith("|3|lean-to|") and lines[-1].startswith("|worst|") and "**50.0**" in lines[-1]


def test_the_real_surface_is_in_the_maps_where_the_camera_sees_it() -> None:
    """The camera's own rays hit what its depth map has; from the other side, a table is not in the maps."""
    made = generated_room(3, 64, 48)
    environment = made.environment
    rays = environment.camera.directions(64, 48).reshape(-1, 3)
    hits = VisibleSurface(made).intersect(np.zeros_like(rays), rays)
    assert not hits.outside.any()
    np.testing.assert_allclose(hits.position[:, 2], environment.depth.ravel(), rtol=1e-5)
    np.testing.assert_allclose(hits.u.reshape(48, 64)[7], np.arange(64) + 0.5, atol=1e-3)
    beyond = 1.5 * environment.points().reshape(-1, 3)
    assert VisibleSurface(made).intersect(beyond, -rays).outside.all()


def test_each_wrong_ray_has_one_cause() -> None:
    """Of eight wrong rays, one has each cause; the eighth has several, and the first of them counts."""
    kinds = np.array([HIT, HIT, HIT, LEFT_VIEW, LEFT_VIEW, HIDDEN, HIT, LEFT_VIEW])
    steps = np.array([1, 1, 1, MAX_STEPS, 5, 5, 5, MAX_STEPS])
    u = np.array([0.5, 1.5, 0.5, 0.5, 0.5, 0.5, 0.5, 1.5])
    rights = np.ones(8, dtype=np.bool_)
    by_maps, by_planes = rights.copy(), rights.copy()
    by_maps[[0, 7]], by_planes[[1, 2]] = False, False

    def part(ok: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> Comparison:
        nothing = np.zeros((8, 3))
        truth = SurfaceHits(nothing, u, np.full(8, 0.5), np.zeros(8, dtype=np.bool_))
        marched = MarchHits(u, u, u, u, u, kinds, steps)
        rays = Rays(nothing, nothing, np.zeros(8, dtype=np.int64))
        return Comparison(rays, truth, np.zeros(8, dtype=np.bool_), marched, ok)

    is_off = np.array([[False, True]])
    shares = unseen_rooms._causes(is_off, [part(by_maps)], [part(by_planes)], [part(~rights)])
    assert shares == dict.fromkeys(CAUSES, 0.125) | {"maps": 0.25}
