"""The Verilog of another version of the hardware."""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from colonnade.common import cache, processes
from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.common.temporary import temporary_folder
from colonnade.design.toolchain import cache_directory, project_root


def verilog_of(version: str, config: Mapping[str, Any], progress: Progress = QUIET) -> Path:
    """The folder with the Verilog of a configuration by another version.

    Args:
        version: A folder that has it, or a commit, whose generator is compiled and run.
        config: The configuration.

    Raises:
        UserError: There is no such folder or commit, or its generator fails.
    """
    if Path(version).is_dir():
        return Path(version)
    root = project_root()
    commit = _git(root, "rev-parse", "--verify", "--quiet", f"{version}^{{commit}}")
    if commit is None:
        raise UserError(f"{version} is neither a folder nor a commit")
    text = json.dumps(config)
    key = hashlib.sha256(f"{commit} {text}".encode()).hexdigest()[:20]
    folder = cache_directory(root) / "units" / key
    with cache.entry(folder, f"Verilog of {version}", progress) as empty:
        if empty is not None:
            with temporary_folder() as work, progress.step(f"generating Verilog by {version}"):
                checkout = work / "checkout"
                if _git(root, "worktree", "add", "--detach", str(checkout), commit) is None:
                    raise UserError(f"git worktree cannot check out {version}")
                try:
                    _generate(root, checkout, text, empty / "design", folder.with_suffix(".log"))
                finally:
                    _git(root, "worktree", "remove", "--force", str(checkout))
    return folder / "design"


def _generate(root: Path, checkout: Path, config: str, output: Path, log: Path) -> None:
    """Run the generator of a checkout; what is fetched or compiled of the same sources is shared."""
    for shared in (".cache", ".tools"):
        (checkout / shared).symlink_to(root / shared)
    for compiled in ("target", "project/target", "project/project"):
        if (root / compiled).is_dir():
            shutil.copytree(root / compiled, checkout / compiled, symlinks=True)
    (checkout / "config.json").write_text(config)
    with log.open("w") as stream:
        command = ["tools/sbt", f"runMain colonnade.Generate --config config.json --output {output.absolute()}"]
        done = processes.run(command, cwd=checkout, stdout=stream, stderr=subprocess.STDOUT)
    if done.returncode != 0:
        raise UserError(f"the generator of that commit fails: see {log}")


def _git(root: Path, *arguments: str) -> str | None:
    """What git prints; None where it fails."""
    done = processes.run(["git", "-C", str(root), *arguments])
    return done.stdout.strip() if done.returncode == 0 else None
