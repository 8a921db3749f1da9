"""``colonnade cycles``: a frame, and two designs against each other."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from colonnade.cli.main import cli

from colonnade_lab.evaluation.cycles import Change, Compared, changed_units

FRAME = ("--mesh", "teapot:4", "--size", "48x36")


def run(*arguments: str) -> str:
    result = CliRunner().invoke(cli, ["cycles", *arguments])
    assert result.exit_code == 0, result.stderr
    return result.stdout


def test_a_frame_is_reported_as_by_the_rtl(tmp_path: Path) -> None:
    output = run("--config", "tiny", *FRAME, "--json", str(tmp_path / "report.json"))
    report = json.loads((tmp_path / "report.json").read_text())
    assert f"cycles      {report['cycles']:,}" in output
    assert report["backend"] == "cycles" and report["counters"]["raysPrimary"] == 48 * 36
    assert sum(report["stalls"].values()) == pytest.approx(1.0)
    assert report["bottleneck"] in output and "box unit and stack" in output


def test_two_designs_are_compared(tmp_path: Path) -> None:
    file = tmp_path / "report.json"
    output = run("--config", "tiny", "--set", "array.columns=2", "--against", "tiny", *FRAME, "--json", str(file))
    report = json.loads(file.read_text())
    assert "equal" in output and "gates       not measured" in output
    assert -0.6 < report["change"] < -0.3 and report["scatter"] == 0.0
    other = run("--config", "tiny", "--set", "geometry.vertexBits=12", "--against", "tiny", *FRAME)
    assert "pixels differ" in other


def test_the_last_commit_is_compared() -> None:
    output = run("--config", "tiny", "--set", "array.contexts=4", "--against", "HEAD", *FRAME)
    assert "teapot:4" in output


def test_the_mean_change_has_a_scatter() -> None:
    frames = [Compared("a", ((110, 112, 108), (100, 100, 100)), 0), Compared("b", ((90, 90, 90), (100, 100, 100)), 0)]
    change = Change.of(frames)
    assert change.mean == pytest.approx(-0.005, abs=1e-3) and change.scatter == pytest.approx(0.009, abs=1e-3)


def test_units_that_differ_are_named() -> None:
    first = {"units": {"A": {"kge": 1.0}, "B": {"kge": 2.0}}}
    second = {"units": {"A": {"kge": 1.0}, "B": {"kge": 3.0}, "C": {"kge": 4.0}}}
    assert changed_units([first, second]) == [("B", 2.0, 3.0), ("C", 0.0, 4.0)]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--mesh", "teapot", "--mesh", "torus"), "with --against"),
        (("--against", "tiny", "--dram", "50"), "--dram is for one design"),
        (("--config", "tiny", "--dram", "50"), "reads no DRAM"),
        (
            (
                "--config",
                "traversal",
            ),
            "queries",
        ),
        (("--config", "edge", "--set", "array.columns=64"), "at most 32"),
        (("--config", "fpga"), "units.extraSlices"),
    ],
)
def test_what_cannot_be_counted_is_one_line(arguments: tuple[str, ...], message: str) -> None:
    result = CliRunner().invoke(cli, ["cycles", *arguments, "--size", "16x12"])
    assert result.exit_code == 2
    assert message in result.stderr and len(result.stderr.splitlines()) == 1
