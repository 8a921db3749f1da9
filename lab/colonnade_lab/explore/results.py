"""The output folder of a study: ``study.json``, ``points.csv``, pictures, plots and the report."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from colonnade import __version__
from colonnade.common import processes
from colonnade.common.atomic_files import json_bytes
from colonnade.common.terminal_text import plain
from colonnade.design.idle_parts import idle_contexts
from colonnade.design.toolchain import project_root

from colonnade_lab.common.file_names import FileNames
from colonnade_lab.explore import figures, render_index
from colonnade_lab.explore.jobs import Job
from colonnade_lab.explore.output import PICTURES, STUDY, TABLE, Output
from colonnade_lab.explore.plan import Plan, PointJobs
from colonnade_lab.explore.schedule import Outcome, Tally
from colonnade_lab.explore.work import PICTURE

#: Version of ``study.json``.
VERSION = 1


class Results:
    """Writes the output folder while the study runs. Each file appears whole."""

    def __init__(self, plan: Plan, folder: Path, command: str) -> None:
        self._plan = plan
        self._folder = folder
        self._command = command
        self._commit, self._is_modified = _commit()
        self._output = Output(folder)

    def study(
        self,
        points: Sequence[PointJobs],
        outcomes: Mapping[str, Outcome],
        tally: Tally,
        seconds: float,
        search: Mapping[str, Any] | None = None,
    ) -> dict[str, Any]:
        """The content of ``study.json`` with what is known so far."""
        plan, study = self._plan, self._plan.study
        entries = [point.entry(plan, outcomes) for point in points]
        columns = figures.columns(plan.has, plan.libraries)
        for entry in entries:
            entry["figures"] = figures.point_figures(entry, plan.has, plan.libraries)
            entry["figures"][figures.IDLE.key] = idle_contexts(entry["config_values"])
        if any(entry["figures"][figures.IDLE.key] for entry in entries):
            columns.append(figures.IDLE)
        index = self._render_index(entries)
        for row in index["rows"] if index else ():
            entry = next(entry for entry in entries if entry["name"] == row["name"])
            entry["figures"][f"render_index.{row['library']}"] = row["index"]
        objectives = study.search.objectives if study.search else study.objectives
        known = {column.key for column in columns}
        front = figures.front(entries, objectives, columns) if objectives and known.issuperset(objectives) else []
        for entry in entries:
            entry["figures"] = {column.key: entry["figures"].get(column.key) for column in columns}
            entry["on_front"] = entry["name"] in front
        return {
            "version": VERSION,
            "title": study.title,
            "description": study.description,
            "command": self._command,
            "commit": self._commit,
            "is_modified": self._is_modified,
            "package": __version__,
            "axes": list(study.axes),
            "columns": figures.described(columns),
            "libraries": list(plan.libraries),
            "workloads": [
                {
                    "name": frame.name,
                    "mesh": frame.mesh.name,
                    "scene": Path(frame_scene).name,
                    "triangles": len(frame.mesh.faces),
                    "size": list(study.workload.size),
                }
                for frame, frame_scene in zip(plan.frames, self._scenes(), strict=True)
            ],
            "baseline": study.baseline,
            "points": entries,
            "front": {"objectives": list(objectives), "points": front} if objectives else None,
            "plots": [list(pair) for pair in study.plots],
            "render_index": index,
            "search": search,
            "jobs": {"run": tally.run, "cached": tally.cached, "failed": tally.failed, "seconds": round(seconds, 1)},
        }

    def _scenes(self) -> list[str]:
        workload = self._plan.study.workload
        frames = (len(workload.meshes) or 1) * (len(workload.reduce) or 1)
        return [scene for scene in workload.scenes for _ in range(frames)]

    def _render_index(self, entries: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
        has, baseline = self._plan.has, self._plan.study.baseline
        if baseline is None or not (has["quality"] and has["area"] and has["power"]):
            return None
        norms = self._plan.study.render_index.norms
        rows = render_index.index_rows(entries, baseline, self._plan.libraries, norms)
        return {
            "definition": norms.definition,
            "rows": rows,
            "sensitivity": render_index.sensitivity(entries, baseline, self._plan.libraries),
        }

    def write(self, study: Mapping[str, Any]) -> None:
        """Write ``study.json`` and ``points.csv``."""
        self._output.write(self._folder / STUDY, json_bytes(study))
        self._output.write(self._folder / TABLE, table(study).encode())

    def write_report(self) -> None:
        """Write charts and report of the study that is in the folder."""
        from colonnade_lab.report.explorer import write_plots, write_report

        write_plots(self._folder, self._output.write)
        write_report(self._folder, self._output.write)

    def write_pictures(
        self,
        study: dict[str, Any],
        points: Sequence[PointJobs],
        references: Mapping[str, Job],
        outcomes: Mapping[str, Outcome],
    ) -> None:
        """Copy the pictures of all results, and name them in the study."""
        names = FileNames()

        def copy(job: Job | None, name: str) -> str | None:
            outcome = outcomes.get(job.key) if job else None
            if not isinstance(outcome, Path):
                return None
            relative = f"{PICTURES}/{names.of(name)}.png"
            self._output.write(self._folder / relative, (outcome / PICTURE).read_bytes())
            return relative

        for workload in study["workloads"]:
            name = workload["name"]
            workload["reference"] = copy(references.get(name), f"reference--{name}")
        for entry, point in zip(study["points"], points, strict=True):
            for name, values in entry["workloads"].items():
                values["picture"] = copy(point.pictures.get(name), f"{point.point.name}--{name}")


def table(study: Mapping[str, Any]) -> str:
    """The points as CSV: a line of comment with the command and commit, then a row for each point.

    Text that a spreadsheet would take for a formula has an apostrophe before it, as in the download of the report.
    """
    text = io.StringIO()
    modified = " with changes" if study["is_modified"] else ""
    command = "\\n".join(plain(study["command"]).splitlines())
    text.write(f"# {command} (commit {study['commit'] or 'unknown'}{modified})\n")
    writer = csv.writer(text, lineterminator="\n")
    keys = [column["key"] for column in study["columns"]]
    heads = ["name", *study["axes"], "config_hash", "on_front", *keys, "failures"]
    writer.writerow([_literal(head) for head in heads])
    for point in study["points"]:
        values = [
            json.dumps(v) if isinstance(v := point["values"].get(axis), dict | list) else v for axis in study["axes"]
        ]
        reasons = "; ".join(f"{failure['measure']}: {failure['reason']}" for failure in point["failures"])
        own = [point["figures"].get(key) for key in keys]
        row = [point["name"], *values, point["config_hash"], point["on_front"], *own, reasons]
        writer.writerow([_literal(value) for value in row])
    return text.getvalue()


def _literal(value: Any) -> Any:
    return f"'{value}" if isinstance(value, str) and value.startswith(("=", "+", "-", "@", "\t", "\r")) else value


def _commit() -> tuple[str | None, bool]:
    """The commit of the checkout, and whether files differ from it; None without git."""

    def git(*arguments: str) -> str | None:
        with contextlib.suppress(OSError, subprocess.SubprocessError):
            done = processes.run(["git", "-C", project_root(), *arguments])
            return done.stdout.strip() if done.returncode == 0 else None
        return None

    return git("rev-parse", "HEAD"), bool(git("status", "--porcelain"))
