"""Runs a study."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest

from colonnade_lab.explore import figures
from colonnade_lab.explore.jobs import Job
from colonnade_lab.explore.output import REPORT
from colonnade_lab.explore.plan import Plan, PointJobs
from colonnade_lab.explore.points import Point, config_of, grid_size, manifests_of, point_of, points_of
from colonnade_lab.explore.results import Results
from colonnade_lab.explore.runners import ClusterRunner, LocalRunner, Runner
from colonnade_lab.explore.schedule import Outcome, Schedule
from colonnade_lab.explore.search import check_search, search_front
from colonnade_lab.explore.study import FieldValue
from colonnade_lab.explore.study_file import StudyFile

#: Seconds between two intermediate tables.
TABLE_SECONDS = 20.0


class Exploration:
    """A study that is checked and ready to run."""

    def __init__(self, file: StudyFile, libraries: Mapping[str, Sequence[str]], progress: Progress = QUIET) -> None:
        """Check everything before the first job: keys, configurations, meshes, libraries, objectives.

        Args:
            file: The study.
            libraries: Liberty files or folders by the library's name.
            progress: Shows the steps.

        Raises:
            UserError: Something is wrong; with its line in the study.
        """
        self.file = file
        self.plan = Plan(file, libraries, progress)
        self._progress = progress
        self._columns = figures.columns(self.plan.has, self.plan.libraries)
        check_search(file, self._columns)
        points = points_of(file)
        corners = _corners(file) if file.study.search else []
        manifests = manifests_of(file, [*points, *corners], progress)
        for point in (*points, *corners):
            self.plan.check(point, manifests[point.name])
        self._baseline: tuple[Point, Manifest] | None = None
        if file.study.baseline is not None:
            (point,) = (point for point in points if point.name == file.study.baseline)
            self._baseline = point, manifests[point.name]
        self.points = [
            self.plan.jobs(point, manifests[point.name], self._baseline, is_checked=point in (points[0], points[-1]))
            for point in points
        ]
        self._failed: list[dict[str, Any]] = []

    def run(
        self,
        runner: Runner,
        output: Path,
        command: str,
        finished: Callable[[Job, Outcome], None] = lambda job, outcome: None,
    ) -> dict[str, Any]:
        """Run all jobs, write the output folder while they run, and return the content of ``study.json``."""
        begun, written = time.monotonic(), 0.0
        results = Results(self.plan, output, command)
        schedule = Schedule(runner, self._progress)
        search: dict[str, Any] | None = None

        def study() -> dict[str, Any]:
            now = time.monotonic() - begun
            return results.study(self.points, schedule.outcomes, schedule.tally, now, search)

        def one_finished(job: Job, outcome: Outcome) -> None:
            nonlocal written
            finished(job, outcome)
            if time.monotonic() - written > TABLE_SECONDS:
                results.write(study())
                written = time.monotonic()

        references = self.plan.references()
        schedule.run([*references.values(), *(job for point in self.points for job in point.all())], one_finished)
        if self.file.study.search is not None:
            for evaluated in self._search(schedule, one_finished):
                settings = self.file.study.search
                search = {
                    "method": {"nsga2": "NSGA-II", "tpe": "TPE"}[settings.sampler],
                    "evaluations": evaluated,
                    "grid": grid_size(self.file),
                    "seed": settings.seed,
                    "constraints": list(settings.constraints),
                    "illegal": self._failed,
                }
        content = study()
        results.write_pictures(content, self.points, references, schedule.outcomes)
        results.write(content)
        with self._progress.step("writing the report"):
            results.write_report()
        return content

    def _search(self, schedule: Schedule, finished: Callable[[Job, Outcome], None]) -> Any:
        known = {point.point.overrides: point for point in self.points}

        def evaluate(values: Sequence[Mapping[str, FieldValue]]) -> list[Mapping[str, float | None] | None]:
            batch: list[PointJobs | None] = []
            for each in values:
                point = point_of(self.file, each)
                if point.overrides not in known:
                    try:
                        manifest = manifest_for(config_of(self.file), point.overrides, self._progress).manifest
                        self.plan.check(point, manifest)
                    except UserError as error:
                        self._failed.append({"name": point.name, "reason": str(error)})
                        batch.append(None)
                        continue
                    known[point.overrides] = self.plan.jobs(point, manifest, self._baseline)
                    self.points.append(known[point.overrides])
                batch.append(known[point.overrides])
            schedule.run([job for jobs in batch if jobs for job in jobs.all()], finished)
            return [None if jobs is None else self._figures(jobs, schedule) for jobs in batch]

        return search_front(self.file, self._columns, evaluate, self._progress)

    def _figures(self, jobs: PointJobs, schedule: Schedule) -> Mapping[str, float | None]:
        entry = jobs.entry(self.plan, schedule.outcomes)
        return figures.point_figures(entry, self.plan.has, self.plan.libraries)


def _corners(file: StudyFile) -> list[Point]:
    """The points of a search's space that differ from its first values in one axis, to check every value once."""
    first = {key: values[0] for key, values in file.study.axes.items()}
    found = {point.name: point for point in [point_of(file, first)]}
    for key, values in file.study.axes.items():
        for value in values[1:]:
            point = point_of(file, first | {key: value})
            found[point.name] = point
    return list(found.values())


def explore(
    file: StudyFile,
    libraries: Mapping[str, Sequence[str]],
    output: Path,
    command: str,
    jobs: int,
    scheduler: str | None = None,
    progress: Progress = QUIET,
    finished: Callable[[Job, Outcome], None] = lambda job, outcome: None,
) -> dict[str, Any]:
    """Check and run a study.

    Args:
        file: The study.
        libraries: Liberty files or folders by the library's name.
        output: The folder for tables, pictures and report.
        command: The command line, for the report.
        jobs: Jobs to run at a time on this machine.
        scheduler: Address of a Dask scheduler; None: this machine.
        progress: Shows the steps.
        finished: Called after each job.

    Returns:
        The content of ``study.json``.
    """
    exploration = Exploration(file, libraries, progress)
    runner: Runner = LocalRunner(jobs) if scheduler is None else ClusterRunner(scheduler)
    try:
        if scheduler is None:
            for kind in {job.kind.name: job for point in exploration.points for job in point.all()}.values():
                if (reason := runner.missing(kind)) is not None:
                    raise UserError(reason)
        return exploration.run(runner, output, command, finished)
    finally:
        runner.close()


def report_of(output: Path) -> Path:
    """The report in an output folder."""
    return output / REPORT
