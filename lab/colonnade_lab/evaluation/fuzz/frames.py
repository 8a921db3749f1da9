"""Corrupt frames, each followed by a legal one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from colonnade.common.framebuffer import Frame
from colonnade.common.progress import Progress
from colonnade.design.generator import GeneratedDesign
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import loaded_model, model_frame
from colonnade.device.simulator_build import build_simulator

from colonnade_lab.evaluation.fuzz.bench import Bench, Planned, Result
from colonnade_lab.evaluation.fuzz.cases import Case, legal_cases
from colonnade_lab.evaluation.fuzz.compare import differences
from colonnade_lab.evaluation.fuzz.corruption import KINDS, corrupt_case
from colonnade_lab.evaluation.fuzz.dram import as_read, with_failed_reads
from colonnade_lab.evaluation.fuzz.environments import environment_cases
from colonnade_lab.evaluation.fuzz.gathered import with_any_light
from colonnade_lab.evaluation.fuzz.instances import instance_cases
from colonnade_lab.evaluation.fuzz.simulator import SimulatedFrame, run_cases


@dataclass(frozen=True)
class PlannedFrame(Planned):
    """A corrupt frame, and the legal one that it was made of."""

    legal: Case
    corrupt: Case


class FrameBench(Bench[PlannedFrame]):
    """Frames of a device that renders."""

    def __init__(self, design: GeneratedDesign, progress: Progress) -> None:
        self.manifest = design.manifest
        self.cases = all_cases(design.manifest)
        self.kinds = [name for name, kind in KINDS.items() if any(map(kind.applies, self.cases))]
        self._design, self._progress = design, progress
        self._rows = max(len(case.image.records) for case in self.cases)
        self._expected: dict[str, Frame] = {}
        self._sums = Counter[str]()

    def plan(self, seed: int, kind: str) -> PlannedFrame:
        """See `Bench`."""
        legal, corrupt, change = corrupt_case(seed, KINDS[kind], self.cases, self.manifest)
        return PlannedFrame(seed, kind, change, legal, corrupt)

    def run(self, planned: Sequence[PlannedFrame]) -> list[Result]:
        """See `Bench`. After a frame at which the harness fails, a new run of it continues."""
        program = build_simulator(self._design, self._progress)
        results: list[Result] = []
        while len(results) < len(planned):
            remaining = planned[len(results) :]
            cases = [case for plan in remaining for case in (plan.corrupt, plan.legal)]
            frames, failure = run_cases(program, self.manifest, cases, self._rows)
            complete = len(frames) // 2
            for plan, corrupt, legal in zip(remaining[:complete], frames[0::2], frames[1::2], strict=False):
                results.append(self._result(plan, corrupt, legal))
            if failure is not None and complete < len(remaining):
                results.append(Result.of("", (failure,), ()))
        return results

    def sums(self) -> dict[str, int]:
        """See `Bench`."""
        names = []
        if self.manifest.gathers:
            names += ["corrupt frames gathered light", "legal frames gathered light"]
        if "instances" in self.kinds:
            names += ["corrupt frames had instances", "legal frames had instances"]
        return {name: self._sums[name] for name in names}

    def _model(self, case: Case) -> Frame:
        read = as_read(case, self.manifest)
        frame = model_frame(loaded_model(self.manifest, read.image), read.registers)
        return with_failed_reads(frame, case, self.manifest)

    def _result(self, plan: PlannedFrame, corrupt: SimulatedFrame, legal: SimulatedFrame) -> Result:
        for name, case, simulated in (("corrupt", plan.corrupt, corrupt), ("legal", plan.legal, legal)):
            self._sums[f"{name} frames gathered light"] += simulated.frame.counters.get("raysGather", 0) > 0
            self._sums[f"{name} frames had instances"] += case.has_instances
        if plan.legal.name not in self._expected:
            self._expected[plan.legal.name] = self._model(plan.legal)
        expected = self._expected[plan.legal.name]
        found = differences(corrupt, self._model(plan.corrupt)) if corrupt.frame.colour.size else []
        outcome, errors = "changed", corrupt.frame.errors
        if errors:
            outcome = "watchdog" if "watchdog" in errors else "flagged"
        elif corrupt.frame.colour.shape == expected.colour.shape and (corrupt.frame.colour == expected.colour).all():
            outcome = "same"
        return Result.of(outcome, found, differences(legal, expected))


def all_cases(manifest: Manifest) -> tuple[Case, ...]:
    """The legal frames of a design, with and without a room."""
    return with_any_light(legal_cases(manifest) + environment_cases(manifest), manifest) + instance_cases(manifest)
