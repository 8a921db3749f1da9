"""Fuzz campaign: renders corrupt frames, each followed by a legal one, with RTL and model, and compares them."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from colonnade.common.errors import UserError
from colonnade.common.framebuffer import Frame
from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import GeneratedDesign
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import loaded_model, model_frame
from colonnade.device.simulator_build import build_simulator

from colonnade_lab.evaluation.fuzz.cases import Case, legal_cases
from colonnade_lab.evaluation.fuzz.compare import differences
from colonnade_lab.evaluation.fuzz.corruption import KINDS, Kind, corrupt_case
from colonnade_lab.evaluation.fuzz.dram import as_read, with_failed_reads
from colonnade_lab.evaluation.fuzz.environments import environment_cases
from colonnade_lab.evaluation.fuzz.gathered import with_any_light
from colonnade_lab.evaluation.fuzz.simulator import SimulatedFrame, run_cases

#: Corrupt frames per simulator run.
BATCH = 100

#: Outcomes of a corrupt frame. The last one is a failure.
OUTCOMES = ("same", "changed", "flagged", "watchdog", "disagree")


@dataclass(frozen=True)
class Disagreement:
    """A corrupt frame that failed. ``colonnade fuzz --frames 1 --seed SEED --kind KIND`` reproduces it.

    Attributes:
        seed: Seed of the frame.
        kind: Kind of corruption.
        change: Description of the corruption.
        differences: Differences between RTL and model, in this frame or in the legal frame after it.
    """

    seed: int
    kind: str
    change: str
    differences: tuple[str, ...]


@dataclass(frozen=True)
class _Planned:
    seed: int
    kind: Kind
    legal: Case
    corrupt: Case
    change: str


class _Campaign:
    def __init__(self, design: GeneratedDesign, cases: tuple[Case, ...], progress: Progress) -> None:
        self.manifest: Manifest = design.manifest
        self.program = build_simulator(design, progress)
        self.cases = cases
        self.rows = max(len(case.image.records) for case in self.cases)
        self._expected: dict[str, Frame] = {}
        self.legal_failures = 0
        self.gathered = Counter[str]()

    def plan(self, seed: int, kind: Kind) -> _Planned:
        return _Planned(seed, kind, *corrupt_case(seed, kind, self.cases, self.manifest))

    def model(self, case: Case) -> Frame:
        read = as_read(case, self.manifest)
        frame = model_frame(loaded_model(self.manifest, read.image), read.registers)
        return with_failed_reads(frame, case, self.manifest)

    def expected(self, legal: Case) -> Frame:
        if legal.name not in self._expected:
            self._expected[legal.name] = self.model(legal)
        return self._expected[legal.name]

    def run(self, planned: Sequence[_Planned]) -> list[tuple[str, Disagreement | None]]:
        """Outcomes of corrupt frames, in order. After a frame at which the harness fails, a new run continues."""
        results: list[tuple[str, Disagreement | None]] = []
        while len(results) < len(planned):
            remaining = planned[len(results) :]
            cases = [case for plan in remaining for case in (plan.corrupt, plan.legal)]
            frames, failure = run_cases(self.program, self.manifest, cases, self.rows)
            complete = len(frames) // 2
            for plan, corrupt, legal in zip(remaining[:complete], frames[0::2], frames[1::2], strict=False):
                results.append(self._outcome(plan, corrupt, legal))
            if failure is not None and complete < len(remaining):
                results.append(_failed(remaining[complete], (failure,)))
        return results

    def _outcome(
        self, plan: _Planned, corrupt: SimulatedFrame, legal: SimulatedFrame
    ) -> tuple[str, Disagreement | None]:
        for name, frame in (("corrupt", corrupt.frame), ("legal", legal.frame)):
            self.gathered[name] += frame.counters.get("raysGather", 0) > 0
        expected = self.expected(plan.legal)
        found = [f"the next frame: {difference}" for difference in differences(legal, expected)]
        self.legal_failures += bool(found)
        if corrupt.frame.colour.size:
            found = differences(corrupt, self.model(plan.corrupt)) + found
        if found:
            return _failed(plan, tuple(found))
        errors = corrupt.frame.errors
        if errors:
            return ("watchdog" if "watchdog" in errors else "flagged"), None
        same = corrupt.frame.colour.shape == expected.colour.shape and (corrupt.frame.colour == expected.colour).all()
        return ("same" if same else "changed"), None


def _failed(plan: _Planned, found: tuple[str, ...]) -> tuple[str, Disagreement]:
    return "disagree", Disagreement(plan.seed, plan.kind.name, plan.change, found)


def all_cases(manifest: Manifest) -> tuple[Case, ...]:
    """The legal frames of a design, with and without a room."""
    return with_any_light(legal_cases(manifest) + environment_cases(manifest), manifest)


def fuzz(
    design: GeneratedDesign,
    frames: int,
    seed: int = 1,
    kinds: Sequence[str] = (),
    progress: Progress = QUIET,
    found: Callable[[Disagreement], None] = lambda disagreement: None,
) -> dict[str, Any]:
    """Render corrupt frames with RTL and model, and compare them.

    Args:
        design: The design.
        frames: Number of corrupt frames.
        seed: Seed of the first frame; each later frame adds one.
        kinds: Names of `KINDS`, selected by the seed in rotation; empty: all that apply to the design.
        progress: Shows the progress.
        found: Called with each disagreement.

    Returns:
        ``{"seed", "frames", "kinds": {name: {outcome: frames}}, "gathered": {"corrupt": frames, "legal": frames},
        "legal_failures", "disagreements", "seconds"}``, where ``gathered`` counts frames that trace gathered rays; it
        is None if the design cannot.

    Raises:
        UserError: The design has nothing of these kinds.
    """
    begun = time.perf_counter()
    cases = all_cases(design.manifest)
    selected = [
        kind
        for name, kind in KINDS.items()
        if (not kinds or name in kinds) and any(kind.applies(case) for case in cases)
    ]
    if not selected:
        need = "maps need a room or textures, gather needs frame.gather=true"
        raise UserError(f"the design has no {' or '.join(kinds)} to corrupt: {need}")
    campaign = _Campaign(design, cases, progress)
    counts = {kind.name: Counter[str]() for kind in selected}
    failed: list[Disagreement] = []
    with progress.step("rendering corrupt frames") as report:
        for first in range(seed, seed + frames, BATCH):
            seeds = range(first, min(first + BATCH, seed + frames))
            planned = [campaign.plan(number, selected[number % len(selected)]) for number in seeds]
            for plan, (outcome, disagreement) in zip(planned, campaign.run(planned), strict=True):
                counts[plan.kind.name][outcome] += 1
                if disagreement is not None:
                    failed.append(disagreement)
                    found(disagreement)
            report((seeds.stop - seed) / frames)
    return {
        "seed": seed,
        "frames": frames,
        "kinds": {name: {outcome: count[outcome] for outcome in OUTCOMES} for name, count in counts.items()},
        "gathered": {name: campaign.gathered[name] for name in ("corrupt", "legal")}
        if design.manifest.gathers
        else None,
        "legal_failures": campaign.legal_failures,
        "disagreements": [asdict(disagreement) for disagreement in failed],
        "seconds": time.perf_counter() - begun,
    }
