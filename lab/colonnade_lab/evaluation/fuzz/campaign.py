"""Fuzz campaign: runs cases of a design, each followed by legal work, with RTL and model, and compares them."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import GeneratedDesign, design_for, manifest_for, shell_design_for

from colonnade_lab.evaluation.fuzz.batches import BatchBench
from colonnade_lab.evaluation.fuzz.bench import OUTCOMES, Bench
from colonnade_lab.evaluation.fuzz.corruption import KINDS
from colonnade_lab.evaluation.fuzz.frames import FrameBench
from colonnade_lab.evaluation.fuzz.refits import RefitBench

#: Cases per run of a bench.
BATCH = 100

#: Names of all kinds: of frames, of batches of rays, of refits.
ALL_KINDS = tuple(dict.fromkeys((*KINDS, *BatchBench.kinds, *RefitBench.kinds)))

#: The only data bus of a shell for rays, and of one with a refit unit, bytes.
RAY_BUS, REFIT_BUS = 64, 16


@dataclass(frozen=True)
class Disagreement:
    """A case that failed. ``colonnade fuzz --cases 1 --seed SEED --kind KIND`` reproduces it.

    Attributes:
        seed: Seed of the case.
        kind: Its kind.
        change: Description of it.
        differences: Differences between RTL and model, in this case or in the legal work after it.
    """

    seed: int
    kind: str
    change: str
    differences: tuple[str, ...]


def fuzzed_design(
    config: str,
    overrides: Sequence[str] = (),
    refit: bool = False,
    bus_bytes: int = REFIT_BUS,
    progress: Progress = QUIET,
) -> GeneratedDesign:
    """The design of a campaign: the device, or its AXI4 shell if it traces rays of applications.

    Args:
        config: The configuration.
        overrides: Fields that replace some of it.
        refit: The shell with its unit that bends meshes.
        bus_bytes: Width of the data bus of that shell.
        progress: Shows the steps.
    """
    if refit:
        return shell_design_for(config, overrides, bus_bytes, progress, refit=True)
    if manifest_for(config, overrides, progress).manifest.has_queries:
        return shell_design_for(config, overrides, RAY_BUS, progress)
    return design_for(config, overrides, progress)


def bench_of(design: GeneratedDesign, progress: Progress = QUIET) -> Bench[Any]:
    """What runs the cases of a design that `fuzzed_design` answers."""
    if design.manifest.has_queries:
        return BatchBench(design, progress)
    return RefitBench(design, progress) if (design.dir / "shell.json").exists() else FrameBench(design, progress)


def fuzz(
    design: GeneratedDesign,
    cases: int,
    seed: int = 1,
    kinds: Sequence[str] = (),
    progress: Progress = QUIET,
    found: Callable[[Disagreement], None] = lambda disagreement: None,
) -> dict[str, Any]:
    """Run cases with RTL and model, and compare them.

    Args:
        design: The design, of `fuzzed_design`.
        cases: Number of cases.
        seed: Seed of the first case; each later one adds one.
        kinds: Names of `ALL_KINDS`, selected by the seed in rotation; empty: all that the design has.
        progress: Shows the progress.
        found: Called with each disagreement.

    Returns:
        ``{"seed", "cases", "kinds": {name: {outcome: cases}}, "sums": {what: number}, "legal_failures",
        "disagreements", "seconds"}``.

    Raises:
        UserError: The design has nothing of these kinds.
    """
    begun = time.perf_counter()
    bench = bench_of(design, progress)
    selected = [kind for kind in bench.kinds if not kinds or kind in kinds]
    if not selected:
        raise UserError(f"the design has no {' or '.join(kinds)} to corrupt: choose from {', '.join(bench.kinds)}")
    counts = {kind: Counter[str]() for kind in selected}
    failed: list[Disagreement] = []
    legal_failures = 0
    with progress.step("running cases") as report:
        for first in range(seed, seed + cases, BATCH):
            seeds = range(first, min(first + BATCH, seed + cases))
            planned = [bench.plan(number, selected[number % len(selected)]) for number in seeds]
            for plan, result in zip(planned, bench.run(planned), strict=True):
                counts[plan.kind][result.outcome] += 1
                legal_failures += not result.is_legal_right
                if result.differences:
                    failed.append(Disagreement(plan.seed, plan.kind, plan.change, result.differences))
                    found(failed[-1])
            report((seeds.stop - seed) / cases)
    return {
        "seed": seed,
        "cases": cases,
        "kinds": {name: {outcome: count[outcome] for outcome in OUTCOMES} for name, count in counts.items()},
        "sums": bench.sums(),
        "legal_failures": legal_failures,
        "disagreements": [asdict(disagreement) for disagreement in failed],
        "seconds": time.perf_counter() - begun,
    }
