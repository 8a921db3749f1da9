"""Samples by a budget of time: one number for model and RTL, by a true estimate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from colonnade.cli.main import cli
from colonnade.common.progress import QUIET
from colonnade.design.generator import manifest_for
from colonnade.mesh.load import load_mesh
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.render.budget import CLOCK, Budget, rounded
from colonnade.render.frames import render, render_frames
from colonnade.render.request import RenderRequest
from colonnade.scene.model import FrameSize, Light, Material, MeshSource, Paths, Scene
from colonnade.scene.prepared.device_scene import DeviceScene

SIZE = (24, 18)
GATHERS = Scene(MeshSource(name="teapot:4"), paths=Paths(gather=1), frame=FrameSize(*SIZE))
#: As in `test_gather.py`, so that the simulator is there.
OPTIONS = ("physicalAttributeMemory=null", "array.columns=1")


@pytest.mark.verilator
def test_rtl_and_model_have_the_samples_of_one_budget(told: list[str]) -> None:
    scene = replace(GATHERS, frame=FrameSize(*SIZE, budget=3e-4))
    rtl, model = (render(RenderRequest(scene, "small", OPTIONS, backend)) for backend in ("rtl", "model"))
    assert rtl.report.samples == model.report.samples in (2, 4, 8)
    np.testing.assert_array_equal(rtl.image, model.image)
    (line,) = [line for line in told if "a pixel" in line]
    assert f"{model.report.samples} samples a pixel, within frame.budget = 0.0003 s at 200 MHz" in line
    cycles = float(line.split("about ")[1].split(" ")[0].replace(",", ""))
    assert cycles == pytest.approx(rtl.report.cycles_per_sample, rel=0.1)


def test_longer_budgets_give_more_samples() -> None:
    def samples(budget: float | None) -> int:
        scene = replace(GATHERS, frame=FrameSize(*SIZE, budget=budget))
        return render(RenderRequest(scene, "small", backend="model")).report.samples

    found = [samples(budget) for budget in (1e-6, 1e-4, 1.0, None)]
    assert found == sorted(found) and found[0] == 1 and found[2:] == [16, 16]
    assert set(found) <= {1, 2, 4, 8, 16}


def test_passes_of_coats_count() -> None:
    """16 samples with coats are 20 passes: a budget of 17 has 8 samples, and 16 without coats."""
    prepared = DeviceScene.of(GATHERS, manifest_for("small").manifest)
    cycles = Budget.of(prepared.manifest, prepared.image, prepared.registers(SIZE, composited=True), 1.0).cycles or 0
    frame = FrameSize(*SIZE, budget=17 * cycles / CLOCK)
    coated = replace(load_mesh("teapot:2"), materials=(MeshMaterial(roughness=0.3),))
    for roughness, mesh, samples, passes in ((1.0, None, 16, 16), (0.3, None, 8, 10), (None, coated, 8, 10)):
        scene = replace(GATHERS, material=Material(roughness=roughness), frame=frame)
        report = render(RenderRequest(scene, "small", backend="model", mesh=mesh)).report
        assert report.samples == samples and report.rays["primary"] == passes * SIZE[0] * SIZE[1]


def test_what_is_named_wins(told: list[str]) -> None:
    """And all frames of a motion have the number of the first one."""
    still = RenderRequest(GATHERS, "small", backend="model")
    for request in (replace(still, samples=3), replace(still, scene=GATHERS.with_samples(3))):
        assert render(request).report.samples == 3
    assert render(replace(still, hits=True)).report.samples == 1
    assert told == []
    assert render(replace(still, backend="reference")).report.samples == 16
    assert "the reference has no clock" in told.pop()
    short = replace(GATHERS, frame=FrameSize(*SIZE, budget=1e-5), light=Light(radius=0.2))
    frames = list(render_frames(replace(still, scene=short, frames=2), QUIET))
    assert [frame.report.samples for frame in frames] == [1, 1]
    (line,) = told
    assert line.startswith("1 sample a pixel") and "light.radius shows its middle" in line


def test_estimates_are_rounded_to_two_digits() -> None:
    assert [rounded(cycles) for cycles in (7, 99, 104, 105, 112_870)] == [7, 99, 100, 110, 110_000]
    assert "the least, beyond frame.budget = 1e-06 s at" in Budget(1, 1000, 1e-6).note
    assert Budget(1, 1000, 1 / 30).note.startswith("1 sample a pixel, within frame.budget = 0.0333 s at 200 MHz")


def test_a_design_without_a_cycle_model_has_one_sample(told: list[str]) -> None:
    options = ("units.extraSlices=true",)
    request = RenderRequest(replace(GATHERS, frame=FrameSize(*SIZE, budget=1.0)), "small", options, backend="model")
    assert render(request).report.samples == 1
    assert "the cycle model does not know" in told[-1]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("paths.gather = 1\nframe = {samples = 4, budget = 0.1}", "leave out frame.samples or frame.budget"),
        ("frame.budget = 0.1", "frame.budget is of frames that gather light: set paths.gather = 1"),
        ("paths.gather = 1\nframe.budget = 0", "frame.budget must be"),
    ],
)
def test_budgets_that_mean_nothing_are_one_line(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "scene.toml").write_text(f'mesh.name = "teapot:2"\n{text}\n')
    result = CliRunner().invoke(cli, ["render", str(tmp_path / "scene.toml"), "--config", "small"])
    assert result.exit_code == 2
    assert message in result.stderr and len(result.stderr.splitlines()) == 1
