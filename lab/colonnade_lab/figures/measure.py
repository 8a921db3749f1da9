"""Measures an entry of the catalog: runs its commands and writes its data file."""

from __future__ import annotations

import datetime
import json
import os
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from colonnade.common import processes
from colonnade.common.atomic_files import replacing
from colonnade.common.errors import UserError
from colonnade.common.temporary import temporary_folder
from colonnade.design.generator import manifest_for
from colonnade.design.toolchain import project_root

from colonnade_lab.common.parallel import processors
from colonnade_lab.figures.catalog import REPORT, Entry
from colonnade_lab.figures.data import Data, commands_of, commit, config_problem, declare_measured, is_current, text_of
from colonnade_lab.figures.digests import digests_of, emit
from colonnade_lab.figures.kept import kept, record_lines
from colonnade_lab.ppa.library.liberty_files import find_liberties


def require_libraries(entries: Sequence[Entry]) -> None:
    """Fetch the libraries of entries, unless they are there.

    Raises:
        UserError: A library cannot be fetched.
    """
    for library in dict.fromkeys(library for entry in entries for library in entry.libraries):
        find_liberties((library,))


def measure(entry: Entry, docs: Path, *, again: bool = False) -> None:
    """Run the commands of an entry and write its data file; else tell of its age if the file is of today's sources.

    Raises:
        UserError: A command failed.
    """
    known = Data(docs).get(entry.name)
    emit([entry])
    if known is not None and not again and is_current(entry, known):
        print(f"figures: {entry.name} was {age(known)}; --again repeats", flush=True)
        return
    print(f"figures: {entry.name}", flush=True)
    head, is_modified = commit()
    digests = digests_of(entry)
    config = manifest_for(entry.config, entry.overrides).manifest.config
    begin, used = time.monotonic(), cpu_seconds()
    reports = {part: _report(entry, command) for part, command in entry.commands.items()}
    seconds = time.monotonic() - begin
    content = {
        "command": commands_of(entry),
        "commit": head,
        "is_modified": is_modified,
        "date": datetime.datetime.now(datetime.timezone.utc).date().isoformat(),
        "seconds": round(max(seconds, _seconds_before(known, entry, head)), 1),
        "processors": processors(),
        "config": config,
        "digests": digests,
        "result": kept(reports.get("", {part: each for part, each in reports.items() if part[:1] != "-"})),
    }
    reported = reports.get("", {}).get("config")
    # Some reports have the name of the configuration alone
    problem = config_problem(entry, {"config": reported}) if isinstance(reported, Mapping) else None
    if problem is not None:
        raise UserError(f"{entry.name}: the report of {text_of(next(iter(entry.commands.values())))}: {problem}")
    (docs / "data").mkdir(parents=True, exist_ok=True)
    with replacing(docs / "data" / f"{entry.name}.json") as stream:
        stream.write(f"{record_lines(content)}\n".encode())
    declare_measured(docs, entry.name)
    print(f"figures: {entry.name} took {seconds:,.0f} s, {cpu_seconds() - used:,.0f} CPU s", flush=True)


def cpu_seconds() -> float:
    """CPU seconds of the programs that were run and have ended."""
    used = os.times()
    return used.children_user + used.children_system


def age(content: Mapping[str, Any]) -> str:
    """When, of which commit and in what time a data file was measured."""
    seconds = float(content["seconds"])
    took = f"{seconds / 60:.1f} min" if seconds >= 60 else f"{seconds:.0f} s"
    return f"measured {content['date']} of commit {str(content['commit'])[:8]} in {took}"


def _seconds_before(known: Mapping[str, Any] | None, entry: Entry, head: str | None) -> float:
    """The time of an earlier run of the same commands on the same commit, whose results are cached now."""
    if known is None or (known.get("commit"), known.get("command")) != (head, commands_of(entry)):
        return 0.0
    return float(known["seconds"])


def _report(entry: Entry, command: tuple[str, ...]) -> Any:
    """Run a command and read its report."""
    root = project_root()
    (root / "out").mkdir(exist_ok=True)
    with temporary_folder() as folder:
        report = root / entry.report if entry.report else folder / "report.json"
        program, *arguments = (part.replace(REPORT, str(report)) for part in command)
        programs: dict[str, list[object]] = {
            "colonnade": [Path(sys.executable).parent / "colonnade"],
            **{tool: [sys.executable, tool] for tool in ("tools/room-frames", "tools/simulators", "tools/view-frames")},
        }
        started = programs.get(program, [root / program])
        done = processes.run([*started, *arguments], cwd=root, stdout=None, stderr=None)
        if done.returncode != 0:
            raise UserError(f"{entry.name}: {text_of(command)} failed with status {done.returncode}")
        content = json.loads(report.read_text(encoding="utf-8"))
    failed = [failure["reason"] for point in content.get("points", ()) for failure in point["failures"]]
    if failed:
        raise UserError(f"{entry.name}: {len(failed)} measurements failed, the first one: {failed[0]}")
    return content
