"""The data files: what they hold, which are missing, and whether their hardware is today's."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from colonnade.common import processes
from colonnade.common.atomic_files import replacing
from colonnade.common.errors import UserError
from colonnade.common.temporary import temporary_folder
from colonnade.design.generator import manifest_for
from colonnade.design.toolchain import project_root

from colonnade_lab.explore.figures import area_figures
from colonnade_lab.figures.catalog import REPORT, Entry, catalog
from colonnade_lab.figures.catalog import SOURCES as OF_SOURCES
from colonnade_lab.figures.digests import digests_of, stale

#: Lists the entries without a file, or with one of other hardware than today's. It is absent if there are none.
UNMEASURED = "unmeasured.txt"

#: The preset whose values a configuration has for keys that it lacks; and with the sections that the preset lacks.
_DEFAULTS: tuple[tuple[str, ...], ...] = ((), ("physicalAttributeMemory={}", "columnBvhMemory.cache={}"))

#: What the figures depend on, as arguments of git.
SOURCES = (
    *("build.sbt", "configs", "driver", "host", "lab", "project", "scenes", "soc", "src", "tools/light"),
    *(
        "tools/ray-suites",
        "tools/ray_suites",
        "tools/room-frames",
        "tools/simulators",
        "tools/soc-fpga",
        "tools/view-frames",
    ),
    *(":!lab/colonnade_lab/claims", ":!lab/colonnade_lab/figures", ":!lab/colonnade_lab/report", ":!lab/tests"),
    *(":!host/tests", ":!host/locks", ":!src/test"),
)


class Missing(Exception):
    """A table needs a data file that is not there; the argument is its name."""


class Data:
    """The data files of a folder, each read once."""

    def __init__(self, docs: Path) -> None:
        self._folder = docs / "data"
        self._read: dict[str, Mapping[str, Any] | None] = {}

    def get(self, name: str) -> Mapping[str, Any] | None:
        """The content of a data file; None without one."""
        if name not in self._read:
            file = self._folder / f"{name}.json"
            self._read[name] = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else None
        return self._read[name]

    def file(self, name: str) -> Mapping[str, Any]:
        """The content of a data file.

        Raises:
            Missing: There is none.
        """
        content = self.get(name)
        if content is None:
            raise Missing(name)
        return content

    def result(self, name: str) -> Any:
        """What the commands of a data file have reported.

        Raises:
            Missing: There is none.
        """
        return self.file(name)["result"]

    def optional(self, name: str) -> Any:
        """What the commands of a data file have reported; None without the file."""
        content = self.get(name)
        return None if content is None else content["result"]


def unmeasured(docs: Path) -> list[str]:
    """The entries that are declared as not measured on today's hardware."""
    file = docs / "data" / UNMEASURED
    return file.read_text(encoding="utf-8").split() if file.is_file() else []


def declare_measured(docs: Path, name: str) -> None:
    """Take an entry from the list of unmeasured ones."""
    file = docs / "data" / UNMEASURED
    left = [each for each in unmeasured(docs) if each != name]
    if left:
        with replacing(file) as stream:
            stream.write("".join(f"{each}\n" for each in left).encode())
    else:
        file.unlink(missing_ok=True)


def problems(docs: Path) -> Iterator[str]:
    """One line for each data file that is missing, of no entry, or of other hardware than today's or another file's."""
    entries, declared = catalog(), unmeasured(docs)
    files = {file.stem for file in (docs / "data").glob("*.json")}
    for name in sorted(files - entries.keys()):
        yield f"data/{name}.json: tools/figures does not write it: remove it"
    for name in declared:
        if name not in entries:
            yield f"data/{UNMEASURED}: {name} is no part of tools/figures"
    for name, entry in entries.items():
        if name not in files:
            if name not in declared:
                yield f"data/{name}.json is missing: run tools/figures {name}"
            continue
        problem = problem_of(entry, json.loads((docs / "data" / f"{name}.json").read_text(encoding="utf-8")))
        if problem and name not in declared:
            yield f"data/{name}.json: {problem}: run tools/figures {name}"
        elif not problem and name in declared and None not in digests_of(entry).values():
            yield f"data/{UNMEASURED}: {name} is measured: take it from the list"
    yield from _size_problems(Data(docs), entries)


def release_problems(docs: Path) -> Iterator[str]:
    """One line for each figure that a release cannot show: not measured, or of a commit that is not in the history."""
    for name in unmeasured(docs):
        yield f"data/{UNMEASURED}: {name} is not measured: run tools/figures {name}"
    for name, entry in catalog().items():
        content = Data(docs).get(name)
        if content is None:
            continue
        head, again = str(content.get("commit")), f"run tools/figures --again {name}"
        if _git("merge-base", "--is-ancestor", head, "HEAD") is None:
            yield f"data/{name}.json: its commit {head[:8]} is not in the history: {again}"
        elif content.get("is_modified") and entry.occasion != OF_SOURCES:
            yield f"data/{name}.json: it is of changes to commit {head[:8]}: {again}"


def _size_problems(data: Data, entries: Mapping[str, Entry]) -> Iterator[str]:
    """One line for each array whose size differs from the same configuration's in an earlier entry."""
    known: dict[str, tuple[str, str]] = {}
    for name, entry in entries.items():
        for design, library, config, kge in _sizes(entry, data.get(name) or {}):
            key = json.dumps([library, _today(config)], sort_keys=True)
            size = f"{kge / 1e3:.2f} MGE"
            first, expected = known.setdefault(key, (name, size))
            if size != expected:
                yield (
                    f"data/{name}.json: the array of {design} has {size}, in data/{first}.json {expected}: "
                    f"run tools/figures {name}"
                )


def _sizes(entry: Entry, content: Mapping[str, Any]) -> Iterator[tuple[str, str, Any, float]]:
    """Design, library, configuration and size, kGE, of each array of a data file."""
    result = content.get("result")
    if not isinstance(result, Mapping):
        return
    if "levels" in result:
        report = {**result, "config": content["config"]}
        yield entry.config, entry.libraries[0].lower(), content["config"], area_figures(report)["array_kge"]
    for point in result.get("points", ()):
        for library, area in point.get("area", {}).items():
            yield point["name"], library, point["config_values"], area["array_kge"]


def problem_of(entry: Entry, content: Mapping[str, Any]) -> str | None:
    """Why a data file is not of today's hardware and sources; None if it is, as far as digests are cached."""
    different = config_problem(entry, content)
    if different is None and (changes := list(stale(entry, content.get("digests", {})))):
        different = f"{', '.join(changes)} (measured at {str(content.get('commit'))[:8]})"
    return different


def config_problem(entry: Entry, content: Mapping[str, Any]) -> str | None:
    """Why a data file is not of today's configuration; None if it is."""
    try:
        config = manifest_for(entry.config, entry.overrides).manifest.config
        measured = _today(content.get("config"))
    except UserError as error:
        return f"the generator refuses its configuration: {error}"
    if measured != config:
        keys = sorted(dict(_leaves(config)).items() ^ dict(_leaves(measured or {})).items())
        return f"it is of another configuration than {entry.config} ({', '.join(dict.fromkeys(k for k, _ in keys))})"
    return None


def _today(config: Any) -> Any:
    """A configuration with all keys of today's, as the generator migrates it."""
    version = config.get("version") if isinstance(config, Mapping) else None
    if version is not None and version < manifest_for("tiny").manifest.config["version"]:
        return _migrated(json.dumps(config, sort_keys=True))
    for sections in _DEFAULTS:
        config = _completed(config, manifest_for("tiny", sections).manifest.config)
    return config


@cache
def _migrated(text: str) -> Mapping[str, Any]:
    """The configuration of a JSON text of an older version."""
    with temporary_folder() as folder:
        (folder / "config.json").write_text(text, encoding="utf-8")
        return manifest_for(str(folder / "config.json")).manifest.config


def _completed(config: Any, defaults: Any) -> Any:
    """A configuration with the values of the keys that are younger than it (docs/release.md)."""
    if not isinstance(config, Mapping) or not isinstance(defaults, Mapping):
        return config
    return {**defaults, **{key: _completed(value, defaults.get(key)) for key, value in config.items()}}


def _leaves(value: Any, path: str = "") -> Iterator[tuple[str, str]]:
    """The fields of a configuration by path, with their values as text."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _leaves(inner, f"{path}.{key}" if path else key)
    else:
        yield path, json.dumps(value)


def commit() -> tuple[str | None, bool]:
    """The commit of the checkout, and whether `SOURCES` differ from it; None without git."""
    head = _git("rev-parse", "HEAD")
    status = _git("status", "--porcelain", "--", *SOURCES)
    return (head.strip() if head and re.fullmatch(r"[0-9a-f]{40,64}\s*", head) else None), bool(
        status is None or status
    )


def is_current(entry: Entry, content: Mapping[str, Any]) -> bool:
    """Whether a data file is of the commands, the configuration and the digests of the checkout."""
    return content.get("command") == commands_of(entry) and problem_of(entry, content) is None


def digest_table(docs: Path) -> Iterator[str]:
    """One line for each digest of each data file: file, commit, state, digest, what it is of."""
    data = Data(docs)
    for name, entry in catalog().items():
        content, today = data.get(name) or {}, digests_of(entry)
        for what, measured in content.get("digests", {}).items():
            known = today.get(what)
            state = "not cached" if known is None else "current" if known == measured else "stale"
            yield f"{name:<20} {str(content['commit'])[:8]} {state:<10} {measured[:16]} {what}"


def commands_of(entry: Entry) -> list[str]:
    """The commands of an entry as a reader types them."""
    return [text_of(command) for command in entry.commands.values()]


def text_of(command: tuple[str, ...]) -> str:
    """A command as a reader types it, without its report."""
    return " ".join(part for part in command if part != "--json" and REPORT not in part)


def _git(*arguments: str) -> str | None:
    """What git prints; None if it fails or is not there."""
    try:
        done = processes.run(["git", "-C", project_root(), *arguments])
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout if done.returncode == 0 else None
