"""The paper in one command: the commands of its page, cheap forms, outcomes, plots and the HTML page."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest
from colonnade.cli.main import cli as colonnade
from colonnade.common import published
from colonnade.common.errors import UserError
from colonnade.design.toolchain import project_root

from colonnade_lab.claims import __main__ as command
from colonnade_lab.claims import bench, checks, full, page, plots
from colonnade_lab.claims.bench import Bench, Differs
from colonnade_lab.claims.checks import CHECKS, Check
from colonnade_lab.claims.outcome import Figure, Outcome
from colonnade_lab.explore.study_file import load_study
from colonnade_lab.figures.catalog import selected
from colonnade_lab.figures.data import Data, Missing, unmeasured
from colonnade_lab.figures.paper_tables import PARTS

ROOT = project_root()
PAGE = (ROOT / "docs" / "paper.md").read_text()
COMMANDS = sorted(
    set(re.findall(r"`((?:colonnade|make|tools/\w+)\b[^`…]*)`", PAGE)) - {"tools/figures PART", "tools/paper NAME"}
)


def parse_colonnade(arguments: list[str]) -> None:
    """Let click parse the arguments of ``colonnade``; a missing or unknown one is an error."""
    group: Any = colonnade
    with click.Context(group) as context:
        name, found, rest = group.resolve_command(context, arguments)
        assert found is not None
        if isinstance(found, click.Group):
            name, found, rest = found.resolve_command(click.Context(found, parent=context), rest)
        found.make_context(name, list(rest), parent=context)


@pytest.mark.parametrize("text", COMMANDS)
def test_every_command_of_the_page_exists_and_parses(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    program, *arguments = shlex.split(text)
    if program == "colonnade":
        parse_colonnade(arguments)
    elif program == "make":
        assert f"\n{arguments[0]}:" in (ROOT / "Makefile").read_text()
    elif program == "tools/paper":
        assert set(arguments) <= {check.name for check in CHECKS}
    elif program == "tools/figures":
        assert selected(tuple(each for each in arguments if not each.startswith("--")))
    elif program == "tools/pictures":
        assert (ROOT / "docs" / "pictures" / f"{arguments[0]}.png").is_file()
    else:
        assert program == "tools/sbt"
        (spec,) = re.findall(r"testOnly \*(\w+)", arguments[0])
        assert list((ROOT / "src" / "test").rglob(f"{spec}.scala"))


def test_the_page_names_every_claim_and_every_part() -> None:
    named = {word for text in COMMANDS if text.startswith("tools/paper ") for word in text.split()[1:]}
    assert named == {check.name for check in CHECKS}
    assert set(PARTS) <= {entry.name for entry in selected(PARTS)}


class Recorded(Bench):
    """A bench whose commands only are noted; each study is read."""

    commands: list[tuple[str, ...]]

    def call(self, *command: str) -> None:
        self.commands.append(command)
        if command[:2] == ("colonnade", "explore"):
            study = load_study(Path(command[2])).study
            assert command[3:5] == ("--backend", "rtl") or not study.cycles
        if command[0] == "colonnade":
            parse_colonnade([part for part in command[1:]])
        raise Differs("noted")


@pytest.mark.parametrize("check", [check for check in CHECKS if check.name != "gates"], ids=lambda check: check.name)
def test_every_cheap_form_begins_with_a_command_that_parses(
    check: Check, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    recorded = Recorded(Data(ROOT / "docs"), tmp_path)
    recorded.commands = []
    with pytest.raises(Differs, match="noted"):
        check.measure(recorded)
    assert len(recorded.commands) == 1


def test_a_cheap_study_has_less_than_its_source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    recorded = Recorded(Data(ROOT / "docs"), tmp_path)
    recorded.commands = []
    with pytest.raises(Differs):
        recorded.study(
            "mixed-precision", sections=["area", "power"], meshes=["teapot"], precision=["24b24s24d", "64b64s64d"]
        )
    study = load_study(tmp_path / "mixed-precision.toml").study
    assert (study.workload.meshes, study.libraries, study.power, study.area) == (("teapot",), (), None, None)


def measured(check: Check, tmp_path: Path, named: bool = False) -> Outcome:
    return command._measured(check, Bench(Data(tmp_path), tmp_path), named)


def test_what_cannot_be_fetched_is_left_out_unless_it_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("COLONNADE_MESHES", raising=False)
    monkeypatch.setenv("COLONNADE_DOWNLOADS", str(tmp_path))
    (tmp_path / published.MESHES["fandisk"].name).touch()
    (tmp_path / published.MESHES["bunny"].name).touch()
    check = Check("c", "claim", "6", lambda bench: [], ("bunny",))
    found = measured(check, tmp_path)
    assert found.reason is not None and "is another file than the mesh bunny" in found.reason
    assert found.is_right and found.lines()[0].endswith("| left out")
    assert not measured(check, tmp_path, named=True).is_right


def test_the_second_mesh_is_left_out_if_it_cannot_be_fetched(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("COLONNADE_MESHES", raising=False)
    monkeypatch.setenv("COLONNADE_DOWNLOADS", str(tmp_path))
    (tmp_path / published.MESHES[bench.SECOND].name).touch()
    check = Check("c", "claim", "6", lambda of: [Figure(mesh, "1", "1") for mesh in of.meshes], (bench.SECOND,))
    monkeypatch.setattr(command, "CHECKS", (check,))
    (found,) = command._cheap(Bench(Data(tmp_path), tmp_path), [])
    assert [figure.what for figure in found.figures] == ["teapot"]
    assert capsys.readouterr().out.startswith("paper: without fandisk: ")
    (found,) = command._cheap(Bench(Data(tmp_path), tmp_path), ["c"])
    assert not found.is_right


def failing(bench: Bench) -> list[Figure]:
    raise Differs("it broke")


def test_an_outcome_is_right_if_nothing_failed_or_differs(tmp_path: Path) -> None:
    equal, other, own = Figure("a", "1", "1"), Figure("b", "1", "2"), Figure("c", "", "3")
    assert measured(Check("c", "claim", "6", lambda bench: [equal, own], ()), tmp_path).is_right
    wrong = measured(Check("c", "claim", "6", lambda bench: [equal, other], ()), tmp_path)
    assert not wrong.is_right
    assert wrong.lines() == ["claim | 6 | a: 1 | 1 | yes", "claim | 6 | b: 1 | 2 | NO"]
    assert not measured(Check("c", "claim", "6", failing, ()), tmp_path).is_right
    assert Outcome("claim", "6", (own,)).lines() == ["claim | 6 | c: – | 3 | –"]


def test_the_command_ends_with_1_if_a_figure_differs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(command, "project_root", lambda: tmp_path)
    monkeypatch.setattr(command, "commit", lambda: ("c0ffee00", False))
    drawn = plots.Drawn(plots.Plot("Fig. 1", "title", "note", lambda data, axes: None), None, ())
    monkeypatch.setattr(plots, "draw", lambda data, folder: iter([drawn]))
    for now, status in (("1", 0), ("2", 1)):
        check = Check("one", "claim <1>", "6", lambda bench, now=now: [Figure("a", "1", now)], ())
        monkeypatch.setattr(command, "CHECKS", (check,))
        monkeypatch.setattr("sys.argv", ["paper", "one"])
        with pytest.raises(SystemExit) as ended:
            command.main()
        assert ended.value.code == status
        text = (tmp_path / "out" / "paper" / "index.html").read_text()
        assert "claim &lt;1&gt;" in text and "Fig. 1" in text and ('class="no"' in text) == bool(status)
        assert ("1 failed, or differ" in capsys.readouterr().out) == bool(status)
    monkeypatch.setattr("sys.argv", ["paper", "two"])
    with pytest.raises(UserError, match="there is no claim two: choose from one"):
        command.main()


def test_all_plots_are_drawn_from_the_data(tmp_path: Path) -> None:
    found = list(plots.draw(Data(ROOT / "docs"), tmp_path))
    assert [each.plot for each in found] == list(plots.PLOTS)
    for each in found:
        if each.file is None:
            with pytest.raises(Missing) as missing:
                each.plot.draw(Data(ROOT / "docs"), None)
            assert str(missing.value) in unmeasured(ROOT / "docs")
    assert found[1].sources[0].startswith("bvh-cycles: measured 20")
    assert all(each.file is None for each in plots.draw(Data(tmp_path), tmp_path))
    page.write(tmp_path / "index.html", "Title", [], [], found[:1])
    text = (tmp_path / "index.html").read_text()
    assert 'src="data:image/png;base64,' in text and "mixed-precision: measured 20" in text


def test_the_full_form_measures_the_entries_and_compares_the_tables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured: list[str] = []

    def measure(entry: Any, docs: Path) -> None:
        measured.append(entry.name)
        if entry.name == "bvh-cycles":
            content = json.loads((ROOT / "docs" / "data" / "bvh-cycles.json").read_text())
            content["result"]["points"][0]["workloads"]["teapot, 50"]["cycles"] *= 2
            (docs / "data").mkdir(parents=True)
            (docs / "data" / "bvh-cycles.json").write_text(json.dumps(content))
        if entry.name == "ablation":
            raise UserError("no simulator")

    monkeypatch.setattr(full, "measure", measure)
    monkeypatch.setattr(full, "require_libraries", lambda entries: None)
    outcomes = list(full.outcomes(Data(ROOT / "docs"), tmp_path))
    assert measured == list(PARTS)
    wrong = [outcome for outcome in outcomes if not outcome.is_right]
    assert [outcome.claim for outcome in wrong] == ["tools/figures ablation", full.TABLES["bvh-cycles"][0]]
    assert [figure.what for figure in wrong[1].figures if not figure.is_equal] == ["50"]


@pytest.fixture(autouse=True)
def no_command_runs(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    def run(*_: object, **__: object) -> None:
        raise AssertionError("a command runs")

    monkeypatch.setattr(bench.processes, "run", run)
    monkeypatch.setattr(checks, "DISTS", "dists")
    yield
