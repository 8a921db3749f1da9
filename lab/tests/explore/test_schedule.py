"""The order of jobs, their failures, and the cache of their results."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest
from colonnade.common import cache

from colonnade_lab.explore import jobs, work
from colonnade_lab.explore.jobs import KINDS, Job, JobFailed
from colonnade_lab.explore.result import RESULT, Content, figures_of
from colonnade_lab.explore.runners import _run_remotely
from colonnade_lab.explore.schedule import Schedule


class FakeRunner:
    """Answers at once with the identity of the job, and fails jobs that say so."""

    parallel = 2
    state = "running"

    def __init__(self) -> None:
        self.ran: list[str] = []
        self.inputs: dict[str, int] = {}

    def missing(self, job: Job) -> str | None:
        return None

    def has_place(self, job: Job, running: Iterable[Job]) -> bool:
        return len(list(running)) < self.parallel

    def submit(self, job: Job, inputs: tuple[Content, ...]) -> Future[dict[str, bytes]]:
        self.ran.append(job.title)
        self.inputs[job.title] = len(inputs)
        future: Future[dict[str, bytes]] = Future()
        if job.identity.get("error") == "lost":
            future.set_exception(OSError("the worker\nis gone"))
        elif job.identity.get("error"):
            future.set_exception(JobFailed(job.identity["error"]))
        else:
            future.set_result({RESULT: json.dumps(dict(job.identity)).encode()})
        return future

    def close(self) -> None:
        pass


@pytest.fixture
def runner(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FakeRunner:
    monkeypatch.setattr(jobs, "cache_directory", lambda _: tmp_path)
    return FakeRunner()


def job(kind: str, number: int, inputs: tuple[Job, ...] = (), after: tuple[Job, ...] = (), **more: Any) -> Job:
    keys = tuple(each.key for each in inputs), tuple(each.key for each in after)
    return Job(KINDS[kind], f"{kind} {number}", {"number": number, **more}, {}, *keys)


def test_jobs_run_once_and_after_their_inputs(runner: FakeRunner) -> None:
    pictures = [job("picture", number) for number in range(4)]
    comparison = job("comparison", 1, inputs=(pictures[3], pictures[0]))
    power = job("power", 1, after=(job("area", 1),))
    schedule = Schedule(runner)
    schedule.run([comparison, power, *pictures, job("picture", 2), job("area", 1)])
    assert sorted(runner.ran) == sorted(
        ["area 1", "comparison 1", "power 1", "picture 0", "picture 1", "picture 2", "picture 3"]
    )
    assert runner.ran.index("comparison 1") > max(runner.ran.index("picture 3"), runner.ran.index("picture 0"))
    assert runner.ran.index("power 1") > runner.ran.index("area 1")
    assert runner.inputs["comparison 1"] == 2
    schedule.run([comparison])
    assert len(runner.ran) == 7


def test_results_are_kept_and_a_damaged_one_is_made_again(runner: FakeRunner) -> None:
    one, two = job("picture", 1), job("picture", 2)
    Schedule(runner).run([one, two])
    again = Schedule(runner)
    again.run([one, two])
    assert (again.tally.cached, len(runner.ran)) == (2, 2)
    folder = jobs.entry_of(one)
    (folder / RESULT).write_text('{"number": 7}')
    cache._verified.clear()
    third = Schedule(runner)
    third.run([one, two])
    assert (third.tally.cached, third.tally.run) == (1, 1)
    assert figures_of(folder) == {"number": 1}


def test_a_failure_does_not_lose_the_others(runner: FakeRunner, capsys: pytest.CaptureFixture[str]) -> None:
    good, bad = job("picture", 1), job("picture", 2, error="no such room")
    gone, either = job("picture", 3, error="lost"), job("comparison", 1, inputs=(good, bad))
    area = job("area", 1, error="no cell")
    power = job("power", 1, after=(area,))
    schedule = Schedule(runner)
    schedule.run([good, bad, gone, either, area, power])
    assert isinstance(schedule.outcomes[good.key], Path)
    assert isinstance(schedule.outcomes[power.key], Path), "a job only saved time for it"
    failures = {each.title: str(schedule.outcomes[each.key]) for each in (bad, gone, either, area)}
    assert failures == {
        "picture 2": "no such room",
        "picture 3": "OSError: the worker is gone",
        "comparison 1": "no such room",
        "area 1": "no cell",
    }
    assert "picture 2 failed: no such room" in capsys.readouterr().err
    retried = Schedule(runner)
    retried.run([bad])
    assert retried.tally.failed == 1, "failures are not cached"


def test_a_job_without_its_input_is_an_error_and_no_hang(runner: FakeRunner) -> None:
    with pytest.raises(RuntimeError, match="comparison 1 waits for a job that is not there"):
        Schedule(runner).run([job("picture", 2), job("comparison", 1, inputs=(job("picture", 1),))])


def test_the_key_is_made_of_everything_that_matters() -> None:
    base = job("picture", 1)
    others = [
        job("picture", 2),
        job("cycles", 1),
        job("picture", 1, inputs=(base,)),
        dataclasses.replace(base, identity={"number": 1, "more": None}),
    ]
    assert len({base.key, *(other.key for other in others)}) == 5
    same = dataclasses.replace(base, title="another", arguments={"scene": 1}, after=(others[0].key,))
    assert same.key == base.key


def test_a_worker_with_other_sources_refuses(runner: FakeRunner) -> None:
    with pytest.raises(JobFailed, match="the worker has other sources"):
        _run_remotely(job("picture", 1), "picture-0", ())


def test_the_key_of_a_result_follows_the_sources_that_make_it(monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = hashlib.sha256().hexdigest()
    for kind in KINDS.values():
        assert all(jobs.package_digest(package) != nothing for package in kind.packages), kind.name
    before = Job(KINDS["comparison"], "a", {}, {}).key
    monkeypatch.setattr(work, "comparison", work.picture)
    assert Job(KINDS["comparison"], "a", {}, {}).key != before
