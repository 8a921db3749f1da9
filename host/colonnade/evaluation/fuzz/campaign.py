"""Corrupt frames by seed: hardware against model, and a legal frame after each."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from colonnade.common.framebuffer import Frame
from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import GeneratedDesign
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import loaded_model, model_frame
from colonnade.device.simulator_build import build_simulator
from colonnade.evaluation.fuzz.cases import Case, legal_cases
from colonnade.evaluation.fuzz.compare import differences
from colonnade.evaluation.fuzz.corruption import KINDS, Kind, corrupt_case
from colonnade.evaluation.fuzz.environments import environment_cases
from colonnade.evaluation.fuzz.simulator import Delivered, run_cases

#: Corrupt frames of one run of the simulator.
BATCH = 100

#: What may become of a corrupt frame; the last one is a failure.
OUTCOMES = ("same", "changed", "flagged", "watchdog", "disagree")


@dataclass(frozen=True)
class Disagreement:
    """A corrupt frame that failed. ``colonnade fuzz --frames 1 --seed SEED --kind KIND`` repeats it.

    Attributes:
        seed: Of the frame.
        kind: Of its corruption.
        change: What was corrupted.
        differences: Of hardware and model; or of the legal frame after it.
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
    def __init__(self, design: GeneratedDesign, progress: Progress) -> None:
        self.manifest: Manifest = design.manifest
        self.program = build_simulator(design, progress)
        self.cases = legal_cases(self.manifest) + environment_cases(self.manifest)
        self.rows = max(len(case.image.records) for case in self.cases)
        self._expected: dict[str, Frame] = {}
        self.legal_failures = 0

    def plan(self, seed: int, kind: Kind) -> _Planned:
        return _Planned(seed, kind, *corrupt_case(seed, kind, self.cases, self.manifest))

    def model(self, case: Case) -> Frame:
        return model_frame(loaded_model(self.manifest, case.image), case.registers)

    def expected(self, legal: Case) -> Frame:
        if legal.name not in self._expected:
            self._expected[legal.name] = self.model(legal)
        return self._expected[legal.name]

    def run(self, planned: Sequence[_Planned]) -> list[tuple[str, Disagreement | None]]:
        """Outcomes of corrupt frames, in order; a frame at which the harness gives up fails, and a new run goes on."""
        results: list[tuple[str, Disagreement | None]] = []
        while len(results) < len(planned):
            left = planned[len(results) :]
            frames, failure = run_cases(
                self.program, self.manifest, [case for one in left for case in (one.corrupt, one.legal)], self.rows
            )
            complete = len(frames) // 2
            for one, corrupt, legal in zip(left[:complete], frames[0::2], frames[1::2], strict=False):
                results.append(self._outcome(one, corrupt, legal))
            if failure is not None and complete < len(left):
                results.append(_failed(left[complete], (failure,)))
        return results

    def _outcome(self, one: _Planned, corrupt: Delivered, legal: Delivered) -> tuple[str, Disagreement | None]:
        expected = self.expected(one.legal)
        found = [f"the next frame: {what}" for what in differences(legal, expected)]
        self.legal_failures += bool(found)
        if corrupt.frame.colour.size:
            found = differences(corrupt, self.model(one.corrupt)) + found
        if found:
            return _failed(one, tuple(found))
        errors = corrupt.frame.errors
        if errors:
            return ("watchdog" if "watchdog" in errors else "flagged"), None
        same = corrupt.frame.colour.shape == expected.colour.shape and (corrupt.frame.colour == expected.colour).all()
        return ("same" if same else "changed"), None


def _failed(one: _Planned, found: tuple[str, ...]) -> tuple[str, Disagreement]:
    return "disagree", Disagreement(one.seed, one.kind.name, one.change, found)


def fuzz(
    design: GeneratedDesign,
    frames: int,
    seed: int = 1,
    kinds: Sequence[str] = (),
    progress: Progress = QUIET,
    found: Callable[[Disagreement], None] = lambda disagreement: None,
) -> dict[str, Any]:
    """Renders corrupt frames through hardware and model.

    Args:
        design: The hardware.
        frames: Corrupt ones; each is followed by a legal one.
        seed: Of the first; the others follow.
        kinds: Names of `KINDS` to take in turn by the seed; all that the design has if empty.
        progress: Shows the share done.
        found: Called with each disagreement.

    Returns:
        ``{"seed", "frames", "kinds": {name: {outcome: frames}}, "legal_failures", "disagreements", "seconds"}``
    """
    begun = time.perf_counter()
    campaign = _Campaign(design, progress)
    chosen = [
        kind
        for name, kind in KINDS.items()
        if (not kinds or name in kinds) and any(kind.applies(case) for case in campaign.cases)
    ]
    counts = {kind.name: Counter[str]() for kind in chosen}
    failed: list[Disagreement] = []
    with progress.step("rendering corrupt frames") as report:
        for first in range(seed, seed + frames, BATCH):
            seeds = range(first, min(first + BATCH, seed + frames))
            planned = [campaign.plan(number, chosen[number % len(chosen)]) for number in seeds]
            for one, (outcome, disagreement) in zip(planned, campaign.run(planned), strict=True):
                counts[one.kind.name][outcome] += 1
                if disagreement is not None:
                    failed.append(disagreement)
                    found(disagreement)
            report((seeds.stop - seed) / frames)
    return {
        "seed": seed,
        "frames": frames,
        "kinds": {name: {outcome: count[outcome] for outcome in OUTCOMES} for name, count in counts.items()},
        "legal_failures": campaign.legal_failures,
        "disagreements": [asdict(disagreement) for disagreement in failed],
        "seconds": time.perf_counter() - begun,
    }
