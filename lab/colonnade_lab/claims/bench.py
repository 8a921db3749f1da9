"""Runs the commands of claims, and holds what they need."""

from __future__ import annotations

import json
import os
import re
import shlex
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from colonnade.common import processes
from colonnade.common.errors import UserError
from colonnade.common.published import LIBRARIES, MESHES
from colonnade.design.toolchain import project_root
from colonnade.mesh.files.catalog import find
from colonnade.quality.dists_weights import weights

from colonnade_lab.figures.data import Data
from colonnade_lab.ppa.library.liberty_files import find_liberties

#: The mesh of the cheap forms beside the teapot, which is built in.
SECOND = "fandisk"

#: The need of DISTS, whose weights come from the package index.
DISTS = "dists"


class Differs(Exception):
    """A command failed; the argument says which, and how."""


@dataclass
class Bench:
    """Where claims are measured.

    Attributes:
        data: The data of the page.
        folder: Receives studies and reports.
        meshes: The cheap forms' meshes.
        missing: What cannot be fetched, with the reason; filled by `lacks`.
    """

    data: Data
    folder: Path
    meshes: tuple[str, ...] = ("teapot", SECOND)
    missing: dict[str, str | None] = field(default_factory=dict)

    def lacks(self, needs: Iterable[str]) -> str | None:
        """Why one of the needed meshes, libraries or weights cannot be had; None if all are there."""
        for need in needs:
            if need not in self.missing:
                try:
                    _fetch(need)
                    self.missing[need] = None
                except UserError as error:
                    self.missing[need] = str(error)
            if self.missing[need] is not None:
                return self.missing[need]
        return None

    def run(self, *command: str) -> Any:
        """Run ``colonnade`` or a tool, and read its report.

        Raises:
            Differs: It failed.
        """
        report = self.folder / "report.json"
        report.unlink(missing_ok=True)
        self.call(*command, "--json", str(report))
        return json.loads(report.read_text(encoding="utf-8"))

    def call(self, *command: str) -> None:
        """Run ``colonnade`` or a tool.

        Raises:
            Differs: It failed.
        """
        text = shlex.join(part for part in command if part not in ("--json", str(self.folder / "report.json")))
        print(f"paper: {text}", flush=True)
        program, *arguments = command
        own = Path(sys.executable).parent / "colonnade" if program == "colonnade" else project_root() / program
        log = self.folder / "log"
        with log.open("w", encoding="utf-8") as stream:
            done = processes.run([own, *arguments], cwd=project_root(), stdout=stream, stderr=stream)
        if done.returncode != 0:
            last = log.read_text(encoding="utf-8").strip().splitlines()[-1:]
            raise Differs(f"{text} ended with status {done.returncode}: {' '.join(last)}")

    def study(self, name: str, *, sections: Iterable[str] = (), **lists: list[Any]) -> Any:
        """A study of ``scenes/studies`` with less in it: lists of other values, and without sections and libraries."""
        text = (project_root() / "scenes" / "studies" / f"{name}.toml").read_text(encoding="utf-8")
        for section in sections:
            text = re.sub(rf"^\[{section}\]\n(?:(?!\[).*\n)*", "", text, flags=re.MULTILINE)
        if "area" in sections:
            text = re.sub(r"^(libraries|objectives) = .*\n", "", text, flags=re.MULTILINE)
        for key, values in lists.items():
            text = re.sub(rf"^{key} = \[[^\]]*\]", f"{key} = {json.dumps(values)}", text, count=1, flags=re.MULTILINE)
        text = text.replace('"../', f'"{project_root() / "scenes"}/')
        file = self.folder / f"{name}.toml"
        file.write_text(text, encoding="utf-8")
        output = self.folder / name
        # The page's cycles are the RTL's
        backend = ("--backend", "rtl") if "[cycles]" in text else ()
        self.call("colonnade", "explore", from_root(file), *backend, "--output", from_root(output))
        found = json.loads((output / "study.json").read_text(encoding="utf-8"))
        failed = [failure["reason"] for point in found["points"] for failure in point["failures"]]
        if failed:
            raise Differs(f"explore {name}: {failed[0]}")
        return found


def from_root(path: Path) -> str:
    """A path from the root, where commands run."""
    return os.path.relpath(path, project_root())


def _fetch(need: str) -> None:
    if need in MESHES:
        find(need)
    elif need in LIBRARIES:
        find_liberties((need,))
    elif need == DISTS:
        weights()
