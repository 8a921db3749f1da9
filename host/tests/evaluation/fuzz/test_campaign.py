"""Corrupt frames: RTL and model agree, and the frame after each is exact (docs/errors.md)."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from colonnade.cli.main import cli
from colonnade.common.errors import UserError
from colonnade.common.framebuffer import Frame
from colonnade.design.generator import design_for, manifest_for
from colonnade.device.bit_exact import loaded_model, model_frame
from colonnade.evaluation.fuzz import campaign
from colonnade.evaluation.fuzz.cases import legal_cases
from colonnade.evaluation.fuzz.compare import differences
from colonnade.evaluation.fuzz.corruption import KINDS, corrupt_case
from colonnade.evaluation.fuzz.simulator import SimulatedFrame

needs_verilator = pytest.mark.skipif(shutil.which("verilator") is None, reason="Verilator is not installed")

#: Configurations and their number of frames.
DESIGNS = (("tiny", 160), ("small", 120))


@needs_verilator
@pytest.mark.long_simulation
@pytest.mark.parametrize(("config", "frames"), DESIGNS)
def test_corrupt_frames_equal_the_models_and_leave_no_state(config: str, frames: int) -> None:
    report = campaign.fuzz(design_for(config, ()), frames, seed=1)
    assert report["disagreements"] == []
    assert report["legal_failures"] == 0
    counts = report["kinds"]
    assert sum(sum(outcomes.values()) for outcomes in counts.values()) == frames
    assert all(counts["records"][outcome] > 0 for outcome in ("same", "changed", "flagged"))
    assert counts["registers"]["changed"] > 0


@needs_verilator
@pytest.mark.long_simulation
def test_a_wrong_model_is_found_and_its_frame_is_reproducible(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = campaign.model_frame

    def wrong(model: Any, registers: dict[str, int]) -> Frame:
        frame = honest(model, registers)
        return replace(frame, colour=frame.colour ^ 1) if frame.errors else frame

    monkeypatch.setattr(campaign, "model_frame", wrong)
    design = design_for("tiny", ())
    found = campaign.fuzz(design, 20, seed=300, kinds=("records",))["disagreements"]
    assert found and all("192 colours" in " ".join(one["differences"]) for one in found)
    again = campaign.fuzz(design, 1, seed=found[-1]["seed"], kinds=(found[-1]["kind"],))["disagreements"]
    assert again == found[-1:]


@pytest.mark.parametrize("kind", KINDS)
def test_a_seed_determines_the_corruption(kind: str) -> None:
    manifest = manifest_for("tiny").manifest
    cases = legal_cases(manifest)
    if not any(KINDS[kind].applies(case) for case in cases):
        pytest.skip(f"tiny has nothing for {kind}")
    changes = set()
    for seed in range(40):
        (_, one, change), (_, other, same) = (corrupt_case(seed, KINDS[kind], cases, manifest) for _ in range(2))
        np.testing.assert_array_equal(one.image.records, other.image.records)
        assert (one.registers, change) == (other.registers, same)
        changes.add(change)
    assert len(changes) > 30


def test_every_difference_is_described() -> None:
    manifest = manifest_for("tiny").manifest
    case = legal_cases(manifest)[0]
    frame = model_frame(loaded_model(manifest, case.image), case.registers)
    assert differences(SimulatedFrame(frame, 0), frame) == []
    assert differences(SimulatedFrame(frame, 3), frame) == ["3 pixels missing"]
    hits = int(frame.is_object.sum())
    changed = {
        "errors illegalRecord instead of none": replace(frame, errors=["illegalRecord"]),
        f"{frame.colour.shape[0] * frame.colour.shape[1]} colours": replace(frame, colour=frame.colour ^ 1),
        f"{hits} triangles": replace(frame, triangle=frame.triangle + frame.is_object),
        f"{hits} distances": replace(frame, distance=frame.distance + 1),
        f"hits {hits + 1} instead of {hits}": replace(frame, counters={**frame.counters, "hits": hits + 1}),
    }
    for what, other in changed.items():
        assert differences(SimulatedFrame(other, 0), frame) == [what]
    aborted = replace(frame, errors=["watchdog"], colour=frame.colour ^ 1)
    assert differences(SimulatedFrame(aborted, 7), replace(frame, errors=["watchdog"])) == []
    assert differences(SimulatedFrame(aborted, 7), frame) == ["errors watchdog instead of none"]


def test_the_command_reports_and_fails_on_a_disagreement(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    disagreement = campaign.Disagreement(7, "records", "cube: record 1 is zeros", ("3 colours",))
    report = {
        "kinds": {"records": dict.fromkeys(campaign.OUTCOMES, 1)},
        "legal_failures": 0,
        "disagreements": [disagreement],
    }

    def fuzz(design: object, frames: int, seed: int, kinds: object, progress: object, found: Any) -> dict[str, Any]:
        found(disagreement)
        return {**report, "disagreements": [vars(disagreement)]}

    monkeypatch.setattr("colonnade.design.generator.design_for", lambda *_: None)
    monkeypatch.setattr(campaign, "fuzz", fuzz)
    file = tmp_path / "report.json"
    result = CliRunner().invoke(cli, ["fuzz", "--config", "tiny", "--frames", "5", "--json", str(file)])
    assert result.exit_code == 1
    assert "seed 7, records, cube: record 1 is zeros: 3 colours" in result.output
    assert json.loads(file.read_text())["disagreements"][0]["seed"] == 7


def test_an_unknown_kind_is_refused() -> None:
    result = CliRunner().invoke(cli, ["fuzz", "--kind", "weather"], standalone_mode=False)
    assert isinstance(result.exception, (UserError, SystemExit))
