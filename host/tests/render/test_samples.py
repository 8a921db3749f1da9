"""Frames of several samples a pixel: the RTL against the model, the model against the reference, and their files."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from colonnade_lab.evaluation.studies.synthetic_attic import write_attic
from colonnade_lab.evaluation.verify import equality, verify
from equal_frames import NARROW
from live_maps import SMALL_MAPS

from colonnade.cli.main import cli
from colonnade.common.errors import UserError
from colonnade.common.image_io import encode_srgb, read_picture
from colonnade.device import verilator
from colonnade.quality.image_metrics import psnr
from colonnade.render.frames import render, render_frames
from colonnade.render.request import Backend, RenderRequest
from colonnade.render.result import RenderResult

SIZE = (40, 30)

EVERYTHING = """
mesh.name = "teapot:3"
camera = {position = [2.0, 4.0, 8.0], target = [0.0, 1.0, 0.0], aperture = 0.3, focus = 7.0}
light = {offset = [-0.75, 0.85, 0.9], radius = 1.5}
background.colour = [0.1, 0.2, 0.4]
frame.samples = 5
motion = {turn = 30.0, shutter = 0.5}
"""
SOFT = """
mesh.name = "teapot:4"
camera = {direction = [-0.35, 0.55, 1.0]}
light = {offset = [-0.75, 0.85, 0.9], radius = 1.8}
"""
STANDING = """
mesh.name = "teapot:2"
background = {room = "rooms/attic", colours = "albedo"}
object = {stand_at = [48, 43], size = 0.6}
material.kind = "mirror"
paths.bounces = 1
light = {position = [0.6, 2.2, 0.6], falloff = 1.5, radius = 0.2}
motion = {stand_at = [52, 43], turn = 20.0, shutter = 1.0}
frame.samples = 4
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("samples")
    write_attic(folder / "rooms" / "attic", 96, 72)
    return folder


def scene_file(folder: Path, text: str) -> Path:
    file = folder / "scene.toml"
    file.write_text(text)
    return file


def of(file: Path, backend: Backend, samples: int | None = None, config: str = "tiny") -> RenderResult:
    return render(RenderRequest(file, config, (), backend, SIZE, samples=samples))


@pytest.mark.verilator
@pytest.mark.parametrize(
    "overrides",
    [(), NARROW, pytest.param(("precision=24b20s40d",), marks=pytest.mark.matrix)],
    ids=["tiny", "narrow", "24b20s40d"],
)
def test_the_hardware_renders_the_passes_of_the_model(folder: Path, overrides: tuple[str, ...]) -> None:
    file = scene_file(folder, EVERYTHING)
    rtl, model = (render(RenderRequest(file, "tiny", overrides, backend, SIZE)) for backend in ("rtl", "model"))
    assert equality(rtl, model).holds
    assert rtl.report.samples == 5 and rtl.report.rays["primary"] == 5 * SIZE[0] * SIZE[1]
    assert rtl.report.cycles == rtl.report.counters["cycles"] == 5 * (rtl.report.cycles_per_sample or 0)
    assert np.count_nonzero((rtl.sums.coverage > 0) & (rtl.sums.coverage < 5)) > 0


@pytest.mark.verilator
def test_verify_compares_frames_of_several_samples(folder: Path) -> None:
    file = scene_file(folder, SOFT + "frame.samples = 3\n")
    report = verify(file, "tiny", (), ["teapot:3"], SIZE)
    assert report["equal"]
    assert report["meshes"]["teapot:3"]["reference"]["psnr"] > 40


@pytest.mark.verilator
@pytest.mark.parametrize("backend", ["model", "rtl"])
def test_a_preview_is_of_the_first_sample_and_changes_nothing(
    folder: Path, backend: Backend, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run_program, were_there = verilator.run_program, list[bool]()

    def run_long(command: list[str], place: Path, report: Callable[[float], None]) -> list[str]:
        report(0.1)
        were_there.append(preview.exists())
        lines = run_program(command, place, lambda _: None)
        # As the simulator does in its second frame
        report(0.2)
        were_there.append(preview.exists())
        return lines

    monkeypatch.setattr(verilator, "run_program", run_long)
    file, preview, picture = scene_file(folder, EVERYTHING), tmp_path / "preview.png", tmp_path / "picture.png"
    options = ["--config", "tiny", "--backend", backend, "--size", "40x30", "--preview", preview, "--output", picture]
    done = run("render", file, *options)
    assert done.exit_code == 0, done.output
    assert done.stderr.count(f"{preview} shows the first sample of each pixel, the others follow") == 1
    assert were_there == ([False, True] if backend == "rtl" else [])
    first, whole = map(read_picture, (preview, picture))
    np.testing.assert_array_equal(whole, encode_srgb(of(file, backend).image))
    assert not np.array_equal(first, whole) and psnr(whole, first) > 20


def test_a_preview_is_of_one_frame(folder: Path) -> None:
    done = run("render", scene_file(folder, SOFT), "--config", "tiny", "--preview", "p.png", "--frames", 2)
    assert done.exit_code == 2 and "--preview is of one frame, not of the reference" in done.stderr


def test_one_sample_is_the_frame_without_samples(folder: Path) -> None:
    plain = "\n".join(line for line in EVERYTHING.splitlines() if not line.startswith(("frame", "motion")))
    sharp = plain.replace(", aperture = 0.3, focus = 7.0", "").replace(", radius = 1.5", "")
    one = of(scene_file(folder, plain), "model", samples=1)
    without = of(scene_file(folder, sharp), "model")
    np.testing.assert_array_equal(one.image, without.image)
    np.testing.assert_array_equal(one.t, without.t)
    assert one.report.counters == without.report.counters and one.report.samples == 1


@pytest.mark.matrix
def test_soft_shadows_converge_to_the_reference(folder: Path) -> None:
    file = scene_file(folder, SOFT)
    wanted = encode_srgb(of(file, "reference", samples=64).image)
    frames = [encode_srgb(of(file, "model", samples=samples).image) for samples in (1, 4, 16, 64)]
    found = [psnr(wanted, frame) for frame in frames]
    assert found == sorted(found)
    assert found[1] > found[0] + 4 and found[2] > found[1] + 4
    assert found[3] > 50, found
    # Points that have nothing to do with the model's
    independent = encode_srgb(of(file, "reference", samples=81).image)
    assert psnr(independent, frames[3]) > 40


@pytest.mark.parametrize("backend", ["model", "reference"])
def test_frames_of_a_motion_are_exposed(folder: Path, backend: Backend) -> None:
    """The passes of each frame are the frames of its moments; the last frame rests."""
    request = RenderRequest(scene_file(folder, STANDING), "small", SMALL_MAPS, backend, (96, 72), 3)
    frames = list(render_frames(request))
    assert [frame.report.share for frame in frames] == [0.0, 0.5, 1.0]
    still = STANDING.replace(", shutter = 1.0", "")
    sharp = list(render_frames(replace(request, scene=scene_file(folder, still))))
    assert not np.array_equal(frames[0].image, sharp[0].image)
    np.testing.assert_array_equal(frames[2].image, sharp[2].image)
    seen = frames[0].sums.coverage
    assert (
        0
        < np.count_nonzero((seen > 0) & (seen < 4))
        > np.count_nonzero((sharp[0].sums.coverage > 0) & (sharp[0].sums.coverage < 4))
    )


def test_the_photo_shows_through_in_proportion(folder: Path) -> None:
    """Pixels without object and shadow are the photo; those at the object's edge mix it with the object."""
    file = scene_file(folder, STANDING)
    result = render(RenderRequest(file, "small", SMALL_MAPS, "model", (96, 72)))
    assert result.sums.ratio is not None
    lit = (result.sums.coverage == 0) & (result.sums.ratio == 4 * 4096).all(axis=2)
    soft = (result.sums.ratio % 4096 != 0).any(axis=2) & (result.sums.coverage == 0)
    assert lit.any() and soft.any()
    relit = render(RenderRequest(file, "small", SMALL_MAPS, "model", (96, 72), relit=True))
    whole = result.sums.coverage == 4
    np.testing.assert_array_equal(result.image[whole], relit.image[whole])
    assert result.report.counters["raysPrimary"] == relit.report.counters["raysPrimary"]


def test_an_object_in_a_photo_has_several_samples_unless_named(folder: Path, told: list[str]) -> None:
    """The default is four samples', and is reported; a mirror's salt and pepper goes."""

    def rendered(text: str, **options: Any) -> RenderResult:
        return render(RenderRequest(scene_file(folder, text), "small", SMALL_MAPS, "model", (96, 72), **options))

    still = re.sub(r"frame.samples = 4\n|, radius = 0.2|, shutter = 1.0", "", STANDING)
    result = rendered(still)
    assert "4 samples a pixel, the default in a room: --samples 1" in told.pop()
    assert result.report.samples == 4
    np.testing.assert_array_equal(result.image, rendered(still, samples=4).image)
    one, many = rendered(still, samples=1), rendered(still, samples=32)
    assert one.report.samples == 1 and result.report.rays["primary"] > 3 * one.report.rays["primary"]
    for other in (rendered(still, relit=True), rendered(still, hits=True), rendered(still + "frame.samples = 1\n")):
        assert other.report.samples == 1
    assert told == []
    errors = [np.square(frame.image - many.image).mean() for frame in (result, one)]
    assert errors[0] < 0.5 * errors[1]


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, [str(argument) for argument in arguments])


def test_the_report_names_samples_and_cycles(folder: Path, tmp_path: Path) -> None:
    common = ("render", scene_file(folder, EVERYTHING), "--config", "tiny", "--backend", "model", "--size", "32x24")
    result = run(*common, "--samples", 3, "--frames", 2, "--json", tmp_path / "r.json")
    assert result.exit_code == 0, result.output
    assert "2 frames, 3 samples a pixel" in result.output
    report = json.loads((tmp_path / "r.json").read_text())
    assert report["samples"] == 3 and report["rays"]["primary"] == 2 * 3 * 32 * 24


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        (SOFT, (), "light.radius shows only with several samples: give frame.samples or --samples"),
        (EVERYTHING, ("--hits", "h.npz"), "hits are of one sample a pixel, this frame has 5: give --samples 1"),
        (EVERYTHING, ("--backend", "rtl", "--waveform", "w.vcd", "--size", "8x8"), "a waveform is of one sample"),
        (EVERYTHING, ("--samples", 0), "--samples"),
        (EVERYTHING, ("--samples", 1025), "--samples"),
    ],
)
def test_what_samples_do_not_show_is_one_line(
    tmp_path: Path, text: str, options: tuple[object, ...], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    backend = () if "--backend" in options else ("--backend", "model")
    result = run("render", scene_file(tmp_path, text), "--config", "tiny", *backend, *options)
    assert result.exit_code == 2
    assert message in result.stderr and len(result.stderr.splitlines()) == 1


def test_a_shutter_of_one_sample_is_refused(folder: Path) -> None:
    with pytest.raises(UserError, match=r"motion\.shutter"):
        of(scene_file(folder, 'mesh.name = "cube"\nmotion = {shutter = 0.5}\n'), "model")
