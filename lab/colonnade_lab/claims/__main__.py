"""``tools/paper``: see its usage."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from colonnade.common.errors import UserError
from colonnade.common.processes import tool
from colonnade.design.toolchain import project_root

from colonnade_lab.claims import full, page, plots
from colonnade_lab.claims.bench import SECOND, Bench, Differs
from colonnade_lab.claims.checks import CHECKS, Check
from colonnade_lab.claims.outcome import Outcome
from colonnade_lab.figures.data import Data, Missing, commit


def main() -> None:
    """Measure claims, print them, write the page; exit with status 1 if one differs."""
    root = project_root()
    docs = Path(os.environ.get("DOCS") or root / "docs").resolve()
    folder = root / "out" / "paper"
    folder.mkdir(parents=True, exist_ok=True)
    data, arguments, begin = Data(docs), sys.argv[1:], time.monotonic()
    if arguments == ["--full"]:
        found = list(_printed(full.outcomes(data, folder)))
    else:
        found = list(_printed(_cheap(Bench(data, folder), arguments)))
    minutes = (time.monotonic() - begin) / 60
    head, is_modified = commit()
    state = f"Commit {(head or 'unknown')[:8]}{', modified' if is_modified else ''}; {minutes:.0f} minutes."
    words = [
        state,
        f"{sum(each.reason is None for each in found)} claims measured, {_count(found, 'left out')} left out.",
    ]
    different = [each for each in found if not each.is_right]
    words.append(
        f"{len(different)} failed, or differ from docs/paper.md." if different else "All figures equal docs/paper.md."
    )
    page.write(folder / "index.html", "The paper, measured again", words, found, list(plots.draw(data, folder)))
    for word in (*words, f"The page is {os.path.relpath(folder / 'index.html')}."):
        print(f"paper: {word}", flush=True)
    raise SystemExit(1 if different else 0)


def _count(found: list[Outcome], kind: str) -> int:
    return sum(each.reason is not None and each.failed == (kind != "left out") for each in found)


def _cheap(bench: Bench, names: list[str]) -> Iterator[Outcome]:
    """The claims of names, of `--quick`, or all. Named ones fail if their files cannot be had."""
    known = {check.name: check for check in CHECKS}
    is_quick = names == ["--quick"]
    named = [] if is_quick else names
    for name in named:
        if name not in known:
            raise UserError(f"there is no claim {name}: choose from {', '.join(known)}")
    if not named:
        for mesh in bench.meshes[1:]:
            if (reason := bench.lacks((mesh,))) is not None:
                print(f"paper: without {mesh}: {reason}", flush=True)
                bench.meshes = tuple(each for each in bench.meshes if each != mesh)
    for check in [known[name] for name in named] or CHECKS:
        if not is_quick or check.is_quick:
            yield _measured(check, bench, named=bool(named))


def _measured(check: Check, bench: Bench, named: bool) -> Outcome:
    """Measure a claim; one that is not named does without a second mesh."""
    lacking = bench.lacks(need for need in check.needs if named or need != SECOND)
    found = partial(Outcome, check.claim, check.paper, command=f"tools/paper {check.name}")
    if lacking is not None:
        return found(reason=lacking, failed=named)
    begin = time.monotonic()
    try:
        figures = check.measure(bench)
    except Missing as missing:
        return found(reason=f"docs/data has no {missing}", failed=named)
    except (Differs, UserError) as error:
        return found(reason=str(error), failed=True)
    return found(figures=tuple(figures), seconds=time.monotonic() - begin)


def _printed(outcomes: Iterator[Outcome]) -> Iterator[Outcome]:
    """Print each outcome as it comes."""
    print("claim | paper | page | now | equal", flush=True)
    for outcome in outcomes:
        for line in outcome.lines():
            print(line, flush=True)
        if outcome.seconds:
            print(f"paper: {outcome.seconds:.0f} s", flush=True)
        yield outcome


if __name__ == "__main__":
    tool(main)
