"""``colonnade explore``: quality, speed, area and power of many configurations."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import click
from colonnade.cli.options import FILE, Command, echo, strict_option


@click.command(cls=Command)
@click.argument("study", type=FILE)
@click.option("--output", type=FILE, metavar="DIR", help="Folder for tables, pictures and report; not for --check.")
@click.option(
    "--library",
    "libraries",
    multiple=True,
    metavar="NAME=PATH",
    help="Files of a standard-cell library that the study names: a .lib or .lib.gz file, or a folder. Repeatable; all "
    "files of a name form one library.",
)
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    metavar="N",
    help="Jobs to run in parallel on this machine.  [default: number of processors]",
)
@click.option(
    "--backend",
    type=click.Choice(["model", "rtl"]),
    help="Count cycles by the cycle model or by the RTL.  [default: as the study says]",
)
@click.option("--scheduler", metavar="ADDRESS", help="Run the jobs on a Dask cluster, e.g. tcp://HOST:8786.")
@click.option("--check", "only_check", is_flag=True, help="Check the study and list its points; run nothing.")
@strict_option
def explore(
    study: Path,
    output: Path | None,
    libraries: tuple[str, ...],
    jobs: int | None,
    backend: Literal["model", "rtl"] | None,
    scheduler: str | None,
    only_check: bool,
) -> None:
    """Measure all points of a study: pictures and cycles of models, gates, timing paths and power.

    Everything is checked before the first job. Results are cached: after an interruption, or with more points, the
    same command continues. A failed job is reported with its reason and does not stop the others. DIR receives
    study.json, points.csv, pictures, plots and report.html.
    """
    from colonnade.common import progress

    from colonnade_lab.common.parallel import processors
    from colonnade_lab.explore.explore import Exploration, report_of
    from colonnade_lab.explore.explore import explore as run_study
    from colonnade_lab.explore.output import check_output
    from colonnade_lab.explore.points import grid_size
    from colonnade_lab.explore.runners import check_address
    from colonnade_lab.explore.study_file import load_study

    if scheduler is not None and jobs is not None:
        raise click.UsageError("--jobs is for this machine, the cluster has its own", click.get_current_context())
    if scheduler is not None:
        check_address(scheduler)
    if output is not None:
        check_output(output)
    elif not only_check:
        raise click.UsageError("--output DIR is missing; --check does without", click.get_current_context())
    file = load_study(study)
    if backend is not None:
        file = file.with_backend(backend)
    terminal = progress.for_terminal()
    named = _named(libraries)
    if only_check or output is None:
        exploration = Exploration(file, named, terminal)
        number = len({job.key for point in exploration.points for job in point.all()})
        for point in exploration.points:
            echo(point.point.name)
        echo(f"{len(exploration.points)} points, {number} jobs")
        if file.study.search is not None:
            echo(f"search: up to {file.study.search.budget} of {grid_size(file):,} points")
        return
    command = shlex.join(["colonnade", *sys.argv[1:]])
    report = run_study(file, named, output, command, jobs or processors(), scheduler, terminal)
    _print(report)
    echo(f"report      {report_of(output)}")


def _named(libraries: tuple[str, ...]) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for text in libraries:
        name, equals, path = text.partition("=")
        if not name or not equals or not path:
            raise click.UsageError(f"--library {text} is not of the form NAME=PATH", click.get_current_context())
        found.setdefault(name, []).append(str(Path(path).expanduser()))
    return found


def _print(report: Mapping[str, Any]) -> None:
    """Print the table of points, one line each."""
    from colonnade_lab.common.text_table import Column, Table

    width = max([5, *(len(point["name"]) for point in report["points"])])
    shown = [
        column for column in report["columns"] if any(p["figures"][column["key"]] is not None for p in report["points"])
    ]
    table = Table(
        (
            Column("point", width, is_text=True),
            *(Column(column["key"], 8, column["format"]) for column in shown),
        ),
        echo,
    )
    for point in report["points"]:
        table.print(point["name"], *(point["figures"][column["key"]] for column in shown))
    for point in report["points"]:
        for name, frame in point["workloads"].items():
            if frame.get("rtl_cycles") is not None and frame["cycles"] is not None:
                error = frame["cycles"] / frame["rtl_cycles"] - 1.0
                echo(
                    f"check       {point['name']}, {name}: {frame['cycles']:,} cycles,"
                    f" of the RTL {frame['rtl_cycles']:,}: {error:+.1%}"
                )
    for point in report["points"]:
        for failure in point["failures"]:
            echo(f"failed      {point['name']}: {failure['measure']}: {failure['reason']}", err=True)
    tally = report["jobs"]
    echo(f"jobs        {tally['run']} run, {tally['cached']} from the cache, {tally['failed']} failed")
