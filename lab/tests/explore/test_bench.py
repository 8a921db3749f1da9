"""The benchmark: by the jobs of a study, in order, and cached results only with `reuse`."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from colonnade.common.errors import UserError

from colonnade_lab.evaluation.bench import mesh_result
from colonnade_lab.explore import frames, jobs
from colonnade_lab.explore.bench import bench
from colonnade_lab.explore.explore import Exploration
from colonnade_lab.explore.jobs import Job, JobFailed
from colonnade_lab.explore.result import RESULT, Content
from colonnade_lab.explore.study_file import load_study

STUDY = """title = "Two meshes"
combine = "list"

[design]
config = "tiny"
set = ["array.contexts=4"]

[[point]]
name = "as it is"

[workload]
scenes = ["object.toml"]
meshes = ["cube", "torus"]
size = [16, 12]

[cycles]
backend = "rtl"
"""

NOT_FOUND = "cycles needs verilator: sudo apt-get install verilator"


class Simulators:
    """A runner whose jobs end together, the last one first; in-box rays per cycle grow with the triangles."""

    def __init__(self, rtl_report: Callable[[float], dict[str, Any]]) -> None:
        self.parallel = 8
        self.ran: list[Job] = []
        self.reason: str | None = None
        self.failing = ""
        self.closed = 0
        self._report = rtl_report

    def missing(self, job: Job) -> str | None:
        return self.reason

    def has_place(self, job: Job, running: Iterable[Job]) -> bool:
        return True

    def submit(self, job: Job, inputs: tuple[Content, ...]) -> Future[dict[str, bytes]]:
        self.ran.append(job)
        future: Future[dict[str, bytes]] = Future()
        mesh = job.arguments["mesh"]
        if mesh.name == self.failing:
            future.set_exception(JobFailed(f"mesh {mesh.name} needs more records"))
        else:
            result = mesh_result(self._report(float(len(mesh.faces))))
            future.set_result({RESULT: json.dumps(result).encode()})
        return future

    def close(self) -> None:
        self.closed += 1


@pytest.fixture
def simulators(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rtl_report: Callable[[float], dict[str, Any]]
) -> Simulators:
    runner = Simulators(rtl_report)
    monkeypatch.setattr(jobs, "cache_directory", lambda _: tmp_path / "cache")
    monkeypatch.setattr(frames, "LocalRunner", lambda parallel: runner)
    return runner


def measured(*meshes: str, **more: Any) -> dict[str, Any]:
    printed: list[str] = []
    report = bench("tiny", ("array.contexts=4",), meshes, (16, 12), 2, finished=lambda n, _: printed.append(n), **more)
    assert printed == list(report["meshes"]), "in order"
    return report


def test_meshes_are_rendered_once_and_reported_in_order(simulators: Simulators) -> None:
    report = measured("torus", "cube", "torus")
    assert list(report["meshes"]) == ["torus", "cube"]
    assert report["meshes"]["cube"]["rays_per_cycle_in_box"] == 12.0
    assert (report["config"]["array"]["contexts"], report["size"]) == (4, [16, 12])
    assert (len(simulators.ran), simulators.closed) == (2, 1)


def test_cached_results_are_used_only_with_reuse(simulators: Simulators) -> None:
    first = measured("cube", "torus")
    assert measured("cube", "torus", reuse=True) == first
    assert len(simulators.ran) == 2
    assert measured("cube", "torus") == first
    assert len(simulators.ran) == 4
    assert not any(job.arguments["reuse"] for job in simulators.ran), "nor are the counters of the same Verilog"
    measured("cube", "octahedron", reuse=True)
    assert [job.arguments["reuse"] for job in simulators.ran[4:]] == [True]


def test_mirrors_are_other_frames(simulators: Simulators) -> None:
    measured("cube", reuse=True)
    measured("cube", reuse=True, mirror=True)
    scene = simulators.ran[1].arguments["scene"]
    assert (scene.material.kind, scene.paths.bounces) == ("mirror", 1)


def test_another_dram_is_another_measurement(simulators: Simulators) -> None:
    names = ("lines", "ways", "misses", "sharedLines", "sharedWays", "sharedMisses", "busBytes")
    cache = json.dumps(dict(zip(names, (16, 4, 8, 32, 4, 8, 16), strict=True)) | {"parity": False})
    memories: list[dict[str, int]] = [{}, {"dram_latency": 50}, {"dram_banks": 8}, {"dram_latency": 50}]
    for dram in memories:
        bench("tiny", (f"columnBvhMemory.cache={cache}",), ("cube",), (16, 12), 1, reuse=True, dram=dram)
    assert [job.arguments["dram"] for job in simulators.ran] == [{}, {"dram_latency": 50}, {"dram_banks": 8}]


def test_a_study_shares_the_results(simulators: Simulators, tmp_path: Path) -> None:
    from colonnade.design.toolchain import project_root

    (tmp_path / "object.toml").write_text((project_root() / "scenes" / "object.toml").read_text())
    (tmp_path / "study.toml").write_text(STUDY)
    measured("torus", "cube")
    (point,) = Exploration(load_study(tmp_path / "study.toml"), {}).points
    assert {job.key for job in point.all()} == {job.key for job in simulators.ran}
    assert all(jobs.cached(job) for job in point.all())


def test_the_first_failure_ends_the_benchmark(simulators: Simulators, capsys: pytest.CaptureFixture[str]) -> None:
    simulators.failing = "torus"
    with pytest.raises(UserError, match="mesh torus needs more records"):
        measured("torus", "cube")
    assert simulators.closed == 1
    assert capsys.readouterr().err == "", "the error line says it"


def test_what_is_wrong_is_said_before_the_first_frame(simulators: Simulators) -> None:
    with pytest.raises(UserError, match="no-such-mesh"):
        measured("cube", "no-such-mesh")
    with pytest.raises(UserError, match=r"frame\.maxWidth"):
        bench("tiny", (), ("cube",), (9999, 12), 1)
    with pytest.raises(UserError, match=r"columnBvhMemory\.cache"):
        measured("cube", dram={"dram_latency": 50})
    simulators.reason = NOT_FOUND
    with pytest.raises(UserError, match=NOT_FOUND):
        measured("cube")
    assert simulators.ran == []


def test_cached_results_need_no_simulator(simulators: Simulators) -> None:
    first = measured("cube")
    simulators.reason = NOT_FOUND
    assert measured("cube", reuse=True) == first
