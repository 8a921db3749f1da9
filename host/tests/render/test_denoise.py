"""The filter of gathered light: what it smooths, and what it leaves alone."""

from __future__ import annotations

import sys
from dataclasses import replace
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from textured_files import gltf

from colonnade.cli.main import cli
from colonnade.common import extras
from colonnade.common.image_io import encode_srgb, read_picture
from colonnade.mesh.load import load_mesh
from colonnade.render.denoise import Guide, Noisy, denoised
from colonnade.render.frames import render
from colonnade.render.hit_points import HitPoints
from colonnade.render.request import RenderRequest

HEIGHT, WIDTH = 40, 60


def wall(depth: np.ndarray | float = 5.0) -> Guide:
    """A guide of a wall before the camera; the border of the picture shows no object."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(float)
    mask = np.zeros((HEIGHT, WIDTH), dtype=bool)
    mask[4:-4, 4:-4] = True
    return Guide.of(np.stack([x * 0.1, y * 0.1, np.broadcast_to(depth, (HEIGHT, WIDTH))], axis=2), mask)


def noisy(mean: np.ndarray, deviation: float, seed: int = 1) -> np.ndarray:
    return np.asarray(mean + np.random.default_rng(seed).normal(size=mean.shape) * deviation)


def filtered(colour: np.ndarray, variance: np.ndarray | None, guide: Guide) -> np.ndarray:
    return denoised(Noisy.of(colour, variance, guide), guide)


@pytest.mark.parametrize("is_known", [True, False])
def test_noise_on_a_plane_is_averaged(is_known: bool) -> None:
    guide, flat = wall(), np.full((HEIGHT, WIDTH, 3), 0.5)
    variance = np.full((HEIGHT, WIDTH), 0.1**2 * (0.2126**2 + 0.7152**2 + 0.0722**2)) if is_known else None
    found = filtered(noisy(flat, 0.1), variance, guide)
    assert (found[guide.mask] - 0.5).std() < 0.1 / 4
    assert abs(found[guide.mask].mean() - 0.5) < 0.01


def test_what_shows_no_object_stays() -> None:
    guide, picture = wall(), noisy(np.full((HEIGHT, WIDTH, 3), 0.5), 0.1)
    found = filtered(picture, None, guide)
    np.testing.assert_array_equal(found[~guide.mask], picture[~guide.mask])
    nothing = replace(guide, mask=np.zeros_like(guide.mask))
    np.testing.assert_array_equal(filtered(picture, None, nothing), picture)


def test_surfaces_at_a_distance_and_at_an_angle_do_not_mix() -> None:
    x = np.arange(WIDTH)[None, :]
    left = np.broadcast_to(x < WIDTH // 2, (HEIGHT, WIDTH))
    colour = np.where(left[..., None], 0.2, 0.8) * np.ones(3)
    step = wall(np.where(left, 5.0, 9.0))
    edge = wall(np.where(left, 5.0, 5.0 + 0.2 * (x - WIDTH // 2)))
    for guide in (step, edge):
        # So large a variance that colours do not matter
        found = filtered(noisy(colour, 0.05), np.full((HEIGHT, WIDTH), 1e6), guide)
        # The pixel of the ridge lies on both sides
        inner = guide.mask & (np.abs(x - WIDTH // 2) > 1)
        assert np.abs(found - colour)[inner].max() < 0.12


def test_normals_of_shading_guide_a_detailed_surface() -> None:
    """Its depth is as rough as a scan's, its normals are not."""
    rough = wall(noisy(np.full((HEIGHT, WIDTH), 5.0), 0.03, seed=2))
    smooth = Guide.of(rough.position, rough.mask, np.broadcast_to((0.0, 0.0, -1.0), rough.position.shape))
    flat = np.full((HEIGHT, WIDTH, 3), 0.5)
    left = [(filtered(noisy(flat, 0.1), None, guide)[guide.mask] - 0.5).std() for guide in (smooth, rough)]
    assert left[0] < 0.1 / 4 and left[0] < 0.7 * left[1]


@pytest.mark.parametrize("value", [0.0, 2.0])
def test_no_point_stays_of_a_single_sample_that_is_far_off(value: float) -> None:
    guide, picture = wall(), noisy(np.full((HEIGHT, WIDTH, 3), 1.0), 0.01)
    picture[20, 30] = value
    found = filtered(picture, None, guide)
    assert np.abs(found - 1)[guide.mask].max() < 0.12, "the point is spread, whether light or dark"


def test_points_of_few_samples_are_spread_as_far_as_these_differ() -> None:
    """One of two samples was bright at a point; a dot of a texture is in both."""
    guide, picture, variance = wall(), noisy(np.full((HEIGHT, WIDTH, 3), 1.0), 0.01), np.full((HEIGHT, WIDTH), 1e-4)
    (point, dot) = (20, 20), (20, 40)
    picture[point], picture[dot], variance[point] = 3.0, 3.0, 2.0**2
    found = Noisy.of(picture, variance, guide, are_few=True)
    assert abs(found.colour[point][0] - 1.0) < 0.4 and found.colour[dot][0] > 2.9
    np.testing.assert_array_equal(found.variance, variance)
    np.testing.assert_array_equal(Noisy.of(picture, variance, guide).colour, picture)
    # A light that a point brings is not lost
    assert found.colour.sum() == pytest.approx(picture.sum(), rel=2e-3)


def test_a_pattern_without_noise_stays() -> None:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    pattern = ((x // 3 + y // 3) % 2 * 0.6 + 0.2)[..., None] * np.ones(3)
    found = filtered(pattern, np.full((HEIGHT, WIDTH), 1e-8), wall())
    assert np.abs(found - pattern).max() < 1e-3


SCENE = """
[mesh]
name = "teapot:4"
[paths]
gather = {}
"""


def run(folder: Path, gather: int, *options: str) -> tuple[int, str]:
    (folder / "scene.toml").write_text(SCENE.format(gather))
    arguments = ["render", str(folder / "scene.toml"), "--config", "small", "--size", "64x48", *options]
    done = CliRunner().invoke(cli, arguments)
    return done.exit_code, done.output


def test_the_command_filters_the_object(tmp_path: Path) -> None:
    pictures = {}
    for name, options in (("raw", ("1",)), ("filtered", ("1", "--denoise")), ("truth", ("64",))):
        output_file = str(tmp_path / f"{name}.png")
        status, output = run(tmp_path, 1, "--backend", "model", "--output", output_file, "--samples", *options)
        assert status == 0, output
        # Without the outline, where samples of the background count
        pictures[name] = read_picture(tmp_path / f"{name}.png")[20:32, 24:40].astype(float)
    error = {name: ((picture - pictures["truth"]) ** 2).mean() for name, picture in pictures.items()}
    assert error["filtered"] < 0.7 * error["raw"]


def test_the_shadow_on_a_photo_is_filtered_and_the_photo_is_not(tmp_path: Path) -> None:
    scene = Path(__file__).parents[3] / "scenes" / "gathered.toml"
    pictures = {}
    for name, options in (("raw", ("1",)), ("filtered", ("1", "--denoise")), ("truth", ("64",))):
        arguments = ["render", str(scene), "--config", "small", "--size", "80x60", "--encoder", "live"]
        output = tmp_path / f"{name}.png"
        options = ("--backend", "model", "--output", str(output), "--samples", *options)
        done = CliRunner().invoke(cli, [*arguments, *options])
        assert done.exit_code == 0, done.output
        pictures[name] = read_picture(output).astype(float)
    shadow = np.s_[44:52, 24:56]
    error = {name: ((picture - pictures["truth"])[shadow] ** 2).mean() for name, picture in pictures.items()}
    assert error["filtered"] < 0.8 * error["raw"]
    assert (pictures["filtered"] == pictures["truth"])[:16, :16].all(), "far from the object it is the photo"


def test_a_scene_asks_for_the_filter(tmp_path: Path) -> None:
    frame = "[frame]\ndenoise = true\nsamples = 1\nwidth = 64\nheight = 48\n"
    (tmp_path / "own.toml").write_text(SCENE.format(1) + frame)
    run(tmp_path, 1, "--backend", "model", "--samples", "1", "--denoise", "--output", str(tmp_path / "filtered.png"))
    for backend in ("model", "reference"):
        own = ["render", str(tmp_path / "own.toml"), "--config", "small", "--backend", backend]
        done = CliRunner().invoke(cli, [*own, "--output", str(tmp_path / f"{backend}.png")])
        assert done.exit_code == 0, done.output
    assert (tmp_path / "model.png").read_bytes() == (tmp_path / "filtered.png").read_bytes()


@pytest.mark.parametrize(
    ("gather", "options", "message"),
    [
        (0, ("--backend", "model"), "set paths.gather = 1"),
        (1, ("--backend", "reference"), "give the reference more --samples"),
        (1, ("--backend", "model", "--set", "frame.hits=false"), "set frame.hits=true"),
    ],
)
def test_what_cannot_be_filtered_is_refused(
    tmp_path: Path, gather: int, options: tuple[str, ...], message: str
) -> None:
    status, output = run(tmp_path, gather, "--denoise", *options)
    assert status == 2
    assert message in output


def test_oidn_sees_the_object_and_its_albedo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By a stand-in of its interface: the package has 88 MB."""
    seen: dict[str, np.ndarray] = {}

    def denoise(colour: np.ndarray, *, hdr: bool, albedo: np.ndarray, normal: np.ndarray) -> np.ndarray:
        assert hdr and all(one.dtype == np.float32 and one.shape == (48, 64, 3) for one in (colour, albedo, normal))
        seen.update(colour=colour, albedo=albedo, normal=normal)
        return np.zeros_like(colour)

    package = ModuleType("pyoidn")
    package.__spec__, package.denoise = ModuleSpec("pyoidn", None), denoise  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "pyoidn", package)
    output_file = tmp_path / "filtered.png"
    material = "[material]\nalbedo = [0.2, 0.4, 0.8]\n[background]\ncolour = [1.0, 1.0, 1.0]\n"
    (tmp_path / "own.toml").write_text(SCENE.format(1) + material + '[frame]\ndenoise = "oidn"\nsamples = 1\n')
    options = ["--config", "small", "--size", "64x48", "--backend", "model", "--output", str(output_file)]
    done = CliRunner().invoke(cli, ["render", str(tmp_path / "own.toml"), *options])
    assert done.exit_code == 0, done.output
    is_object = seen["albedo"].any(axis=2)
    np.testing.assert_array_equal(read_picture(output_file), 255 * ~np.repeat(is_object[..., None], 3, axis=2))
    np.testing.assert_allclose(seen["colour"][~is_object], 1.0, err_msg="it sees what is around")
    np.testing.assert_allclose(seen["albedo"], is_object[..., None] * np.float32([0.2, 0.4, 0.8]))
    assert (np.linalg.norm(seen["normal"][is_object], axis=1) > 0.99).mean() > 0.9


def test_the_albedo_of_a_point_is_that_of_its_texture(tmp_path: Path) -> None:
    mesh = load_mesh(gltf(tmp_path), corner_colours=True)
    weights = np.random.default_rng(1).dirichlet((1, 1, 1), (2, 3))
    expected = mesh.textures[0].colours((weights @ np.array([(0, 0), (1, 0), (0, 1)])).reshape(-1, 2)).reshape(2, 3, 3)
    hits = np.array([[0, 0, 0], [0, 0, -1]])
    expected[1, 2] = 0
    np.testing.assert_allclose(HitPoints.of(mesh, hits, weights @ np.eye(3)).albedo(), expected, atol=1e-6)


@pytest.mark.parametrize("samples", [1, 4])
def test_a_texture_stays(tmp_path: Path, samples: int) -> None:
    """Light alone is filtered, which is constant here."""
    codes = np.random.default_rng(1).integers(30, 255, (6, 6, 3)).astype(np.uint8)
    gltf(tmp_path, np.asarray(Image.fromarray(codes).resize((64, 64), Image.Resampling.BILINEAR)))
    (tmp_path / "scene.toml").write_text('mesh.path = "a.gltf"\npaths.gather = 1\n')
    request = RenderRequest(tmp_path / "scene.toml", "small", backend="model", size=(64, 48), samples=samples)
    raw, found = (render(replace(request, denoise=denoise)) for denoise in (False, True))
    difference = encode_srgb(raw.image).astype(int) - encode_srgb(found.image)
    assert np.abs(difference[raw.object_mask]).mean() < 5


def test_without_the_package_oidn_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "find_spec", lambda _name: None)
    status, output = run(tmp_path, 1, "--backend", "model", "--denoise", "oidn")
    assert status == 2 and "pip install 'colonnade[denoise]'" in output
