"""Accuracy of a reconstructed room: probe rays, figures, and the march through the full depth map."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from colonnade_lab.evaluation.environment_march import DeviceMarch
from colonnade_lab.evaluation.studies.environment_accuracy import study, table
from colonnade_lab.evaluation.studies.probe_spheres import (
    RADIUS,
    cosine_rays,
    glass_rays,
    mirror_rays,
    standing_spheres,
)
from colonnade_lab.evaluation.studies.synthetic_attic import SyntheticRoom, attic, write_attic

from colonnade.cli.main import cli
from colonnade.design.generator import manifest_for
from colonnade.environment.model import Environment, EnvironmentCamera
from colonnade.maps.image import encode_environment
from colonnade.maps.layout import AttributeLayout
from colonnade.reference.embree import RayTracer
from colonnade.reference.environment.ray_march import (
    HIDDEN,
    HIT,
    LEFT_VIEW,
    LOST,
    DepthMarch,
    MarchedGeometry,
    MarchHits,
    positions,
)
from colonnade.reference.environment.surface import Backdrop


@pytest.fixture(scope="module")
def made() -> SyntheticRoom:
    return attic(160, 120)


def test_spheres_are_free_and_visible(made: SyntheticRoom) -> None:
    environment, tracer = made.environment, RayTracer(made.surface)
    centres = standing_spheres(environment)
    assert len(centres) == 6
    for centre in centres:
        rays = mirror_rays(centre)
        on_sphere = rays.origins @ environment.camera_to_world[:, :3].T + environment.camera_to_world[:, 3]
        eye = np.broadcast_to(environment.camera_to_world[:, 3], on_sphere.shape)
        assert not tracer.occluded(eye, (on_sphere - eye) * 0.999).any()
        np.testing.assert_allclose(np.linalg.norm(rays.origins - centre, axis=1), RADIUS, rtol=1e-2)
    gaps = np.linalg.norm(centres[:, None] - centres, axis=2) + 9 * np.eye(6)
    assert gaps.min() > 2 * RADIUS


def test_rays_leave_their_sphere(made: SyntheticRoom) -> None:
    centre = standing_spheres(made.environment)[0]
    for rays in (mirror_rays(centre), glass_rays(centre), cosine_rays(centre, 500, np.random.default_rng(1))):
        outward = np.einsum("ni,ni->n", rays.origins - centre, rays.directions)
        assert (outward > 0).all()
        np.testing.assert_allclose(np.linalg.norm(rays.directions, axis=1), 1)
    straight = glass_rays(centre)
    axis = centre / np.linalg.norm(centre)
    middle = np.argmax(straight.directions @ axis)
    np.testing.assert_allclose(straight.directions[middle], axis, atol=0.02)


def test_the_march_hits_the_true_surface(made: SyntheticRoom) -> None:
    environment = made.environment
    march = DepthMarch(environment)
    rays = cosine_rays(standing_spheres(environment)[0], 2000, np.random.default_rng(5))
    met = march(rays.origins, rays.directions)
    met = replace(met, z=np.where(met.kind == HIT, met.z, 1.0))
    world, turn = environment.camera_to_world, environment.camera_to_world[:, :3]
    origins, directions = rays.origins @ turn.T + world[:, 3], rays.directions @ turn.T
    tracer = RayTracer(made.surface)
    truth = tracer.surface_points(tracer.first_hits(origins, directions), origins, directions).position
    hit = met.kind == HIT
    away = np.linalg.norm(positions(environment, met) @ turn.T + world[:, 3] - truth, axis=1)[hit]
    assert 0.2 < hit.mean() < 0.95 and set(np.unique(met.kind)) <= {HIT, HIDDEN, LEFT_VIEW, LOST}
    assert (away < 0.1).mean() > 0.9


def test_the_study_separates_good_and_bad_marches(made: SyntheticRoom) -> None:
    environment = made.environment
    march = DepthMarch(environment)

    def shifted(origins: np.ndarray, directions: np.ndarray) -> MarchHits:
        met = march(origins, directions)
        return replace(met, seen_u=met.seen_u + 12, z=met.z * 1.2)

    def blind(origins: np.ndarray, directions: np.ndarray) -> MarchHits:
        nothing, count = np.zeros(len(origins)), np.full(len(origins), 3)
        return MarchHits(*[nothing] * 2, nothing + 1, *[nothing] * 2, np.full(len(origins), LEFT_VIEW), count)

    good = study(environment, march, environment.depth)
    assert good.mirror.ok > 0.85 and good.cosine.ok > 0.85 and good.mirror.missed < 0.1
    assert good.receiver_mean == 0 and good.receiver_p95 == 0
    bad = study(environment, shifted, environment.depth + 0.1)
    assert bad.mirror.ok < 0.2 and bad.mirror.missed == good.mirror.missed
    assert bad.mirror_psnr < good.mirror_psnr - 1 and bad.mirror_flip > 2 * good.mirror_flip
    assert bad.receiver_mean is not None and 0.1 <= bad.receiver_mean < 0.15
    none = study(environment, blind)
    assert (none.mirror.ok, none.mirror.missed, none.mirror.invented) == (0, 1, 0)
    assert none.mean_steps == 3 and none.receiver_mean is None
    assert len(table({"good": good, "none": none}).splitlines()) == 4


def test_what_a_march_does_not_hit_is_outside(made: SyntheticRoom) -> None:
    environment = made.environment
    march = DepthMarch(environment)
    rays = mirror_rays(standing_spheres(environment)[0])
    met = march(rays.origins, rays.directions)
    points = Backdrop(
        environment, MarchedGeometry(environment, march), environment.albedo, environment.normals
    ).intersect(rays.origins, rays.directions)
    np.testing.assert_array_equal(points.outside, (met.kind != HIT) & (met.kind != HIDDEN))


def test_an_origin_just_behind_the_surface_is_on_it(made: SyntheticRoom) -> None:
    environment = made.environment
    row, column = 100, 80
    point = environment.points()[row, column]
    inward = -environment.normals[row, column] + [0.3, 0, 0]
    met = DepthMarch(environment)((point * 1.002)[None], inward[None])
    assert met.kind[0] == HIT and np.hypot(met.u[0] - column - 0.5, met.v[0] - row - 0.5) < 2


@pytest.mark.parametrize(("gap", "passes"), [(0.015, True), (0.001, False)])
def test_the_device_passes_closely_behind_a_thin_board(gap: float, passes: bool) -> None:
    """A ray behind a board by 1.5 % of its depth reaches the wall beside it; by 0.1 %, it is on the board."""
    width, height, distance = 160, 120, 2.0
    pose = np.array([[1.0, 0, 0, 0], [0, -1, 0, 1.2], [0, 0, -1, 0]])
    camera = EnvironmentCamera(120.0, 120.0, width / 2, height / 2, pose)
    rays = camera.directions(width, height)
    normals, along = np.array([[0.0, 0, -1], [-1, 0, 0]]), np.stack([rays[..., 2] / 4, rays[..., 0] / 1.2], axis=2)
    wall = along.argmax(axis=2)
    board = np.abs(rays[..., 0] + 0.2) < 0.05
    depth, facing = np.where(board, distance, 1 / along.max(axis=2)), normals[np.where(board, 0, wall)]
    environment = Environment("board", np.full((height, width, 3), 0.5), facing, depth, True, camera, None)
    layout = AttributeLayout(width, height)
    manifest = manifest_for("small", (f"physicalAttributeMemory={json.dumps(layout.to_config())}",)).manifest
    march = DeviceMarch(environment, encode_environment(environment, layout), manifest)
    hits = march(np.array([[-1.0, 0.05, distance * (1 + gap)]]), np.array([[1.0, 0.0, 0.0]]))
    assert hits.kind[0] == HIT
    (x, _, _) = positions(environment, hits)[0]
    np.testing.assert_allclose(x, 1.2 if passes else -0.5, atol=0.04)


@pytest.mark.matrix
def test_the_command_prints_a_table_and_writes_json(tmp_path: Path) -> None:
    write_attic(tmp_path / "attic", 96, 72)
    output = tmp_path / "r.json"
    result = CliRunner().invoke(cli, ["study", "rays", str(tmp_path / "attic"), "--json", str(output)])
    assert result.exit_code == 0, result.output
    report = json.loads(output.read_text())
    assert list(report) == ["attic, full maps", "attic, planes", "attic, device"]
    assert report["attic, planes"]["mirror"]["ok"] > 0.8
    assert report["attic, device"]["mirror"]["ok"] > 0.8
    assert len(result.output.splitlines()) == 5
