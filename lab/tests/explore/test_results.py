"""The output folder of a study."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import pytest
from colonnade.common import notes
from colonnade.design.manifest import Manifest

from colonnade_lab.explore.explore import Exploration
from colonnade_lab.explore.jobs import KINDS, Job
from colonnade_lab.explore.plan import Plan, PointJobs
from colonnade_lab.explore.points import Point
from colonnade_lab.explore.results import Results, table
from colonnade_lab.explore.schedule import Outcome, Tally
from colonnade_lab.explore.study_file import load_study
from colonnade_lab.explore.work import PICTURE

NAMES = ("a b", "a/b", "x+", "x*", "A B", "\N{LATIN SMALL LETTER O WITH STROKE}", "\N{SNOWMAN}", "..", 300 * "n")


def test_each_picture_has_a_file_of_its_own(tmp_path: Path) -> None:
    """Points and workloads whose names differ in characters that file names cannot hold."""
    workloads = ("d/m.ply", "d_m.ply")
    outcomes: dict[str, Outcome] = {}

    def job(name: str) -> Job:
        made = Job(KINDS["picture"], name, {"name": name}, {})
        folder = tmp_path / "results" / str(len(outcomes))
        folder.mkdir(parents=True)
        (folder / PICTURE).write_text(name)
        outcomes[made.key] = folder
        return made

    references = {workload: job(f"reference of {workload}") for workload in workloads}
    points = [PointJobs(Point(name, {}, ()), cast(Manifest, None)) for name in NAMES]
    for point in points:
        point.pictures = {workload: job(f"{point.point.name} of {workload}") for workload in workloads}
    study: dict[str, Any] = {
        "workloads": [{"name": workload} for workload in workloads],
        "points": [{"workloads": {workload: {} for workload in workloads}} for _ in points],
    }
    folder = tmp_path / "out"
    Results(cast(Plan, None), folder, "colonnade").write_pictures(study, points, references, outcomes)
    shown = {f"reference of {each['name']}": each["reference"] for each in study["workloads"]}
    for name, entry in zip(NAMES, study["points"], strict=True):
        shown |= {f"{name} of {workload}": entry["workloads"][workload]["picture"] for workload in workloads}
    assert {name: (folder / path).read_text() for name, path in shown.items()} == {name: name for name in shown}
    assert len({path.casefold() for path in shown.values()}) == len(shown) == (len(NAMES) + 1) * len(workloads)


@pytest.mark.parametrize(("contexts", "idle"), [("4, 8", None), ("8, 12", [0, 4])])
def test_a_column_has_idle_contexts_if_a_point_has_some(tmp_path: Path, contexts: str, idle: list[int] | None) -> None:
    """A column of `tiny` has eight rays at most."""
    (tmp_path / "cube.toml").write_text('mesh.name = "cube"\n')
    (tmp_path / "study.toml").write_text(
        'title = "Idle"\ndesign.config = "tiny"\nworkload.scenes = ["cube.toml"]\ncycles = {}\n'
        f'axes = {{"array.contexts" = [{contexts}]}}\n'
    )
    lines: list[str] = []
    with notes.opened(lines.append):
        exploration = Exploration(load_study(tmp_path / "study.toml"), {})
    study = Results(exploration.plan, tmp_path, "colonnade").study(exploration.points, {}, Tally(), 0.0)
    assert [point["figures"].get("idle_contexts") for point in study["points"]] == (idle or [None, None])
    assert ("idle_contexts" in table(study).splitlines()[1]) == (idle is not None)
    assert len(lines) == (idle is not None)


def test_a_table_holds_no_formulas_and_one_line_of_comment() -> None:
    evil = "=cmd|' /C calc'!A0"
    point = {"name": evil, "values": {"precision": "+1", "array.contexts": -1}, "config_hash": "c", "on_front": False}
    failure = {"measure": "area", "reason": "@x"}
    study = {
        "command": "colonnade explore 'a\nb.toml'",
        "commit": "c",
        "is_modified": False,
        "axes": ["precision", "array.contexts"],
        "columns": [{"key": "psnr_min"}],
        "points": [point | {"figures": {"psnr_min": -2.5}, "failures": [failure]}],
    }
    lines = table(study).splitlines()
    assert lines[0] == "# colonnade explore 'a\\nb.toml' (commit c)"
    assert lines[2] == f"'{evil},'+1,-1,c,False,-2.5,area: @x"
