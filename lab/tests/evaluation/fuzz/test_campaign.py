"""Corrupt frames: RTL and model agree, and the frame after each is exact (docs/errors.md)."""

from __future__ import annotations

import json
from collections import Counter
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
from colonnade.device.verilator import render_rtl
from colonnade.scene_image.dram_image import dram_image, line_layout
from equal_frames import PIPELINED

from colonnade_lab.evaluation.fuzz import campaign, frames
from colonnade_lab.evaluation.fuzz.bench import OUTCOMES
from colonnade_lab.evaluation.fuzz.cases import legal_cases
from colonnade_lab.evaluation.fuzz.compare import differences
from colonnade_lab.evaluation.fuzz.corruption import KINDS, corrupt_case
from colonnade_lab.evaluation.fuzz.dram import as_read
from colonnade_lab.evaluation.fuzz.environments import environment_cases
from colonnade_lab.evaluation.fuzz.registers import EXCLUDED, INTERVALS
from colonnade_lab.evaluation.fuzz.simulator import SimulatedFrame, run_cases

#: Configurations and their number of frames.
DESIGNS = (("tiny", 48), pytest.param("small", 120, marks=pytest.mark.matrix))

#: The shape of each preset with one column, and frames.
SHAPES = tuple((config, ("array.columns=1",), 240) for config in ("tiny", "small", "edge", "lean", "fpga"))


@pytest.mark.verilator
@pytest.mark.parametrize(("config", "count"), DESIGNS)
def test_corrupt_frames_equal_the_models_and_leave_no_state(config: str, count: int) -> None:
    report = campaign.fuzz(design_for(config, ()), count, seed=1)
    assert report["disagreements"] == []
    assert report["legal_failures"] == 0
    counts = report["kinds"]
    assert sum(sum(outcomes.values()) for outcomes in counts.values()) == count
    assert all(counts["records"][outcome] > 0 for outcome in ("same", "changed", "flagged"))
    assert counts["registers"]["changed"] > 0


@pytest.mark.verilator
@pytest.mark.matrix
@pytest.mark.parametrize(("config", "overrides", "count"), SHAPES)
def test_every_preset_agrees_with_its_model_on_corrupt_frames(
    config: str, overrides: tuple[str, ...], count: int
) -> None:
    report = campaign.fuzz(design_for(config, overrides), count, seed=1)
    assert report["disagreements"] == []
    assert report["legal_failures"] == 0


@pytest.mark.verilator
def test_pipelines_and_shared_triangle_units_agree_on_corrupt_frames() -> None:
    """Also on the error bit of a triangles record that is illegal: a unit's events depend on no input of the cycle."""
    report = campaign.fuzz(design_for("tiny", PIPELINED), 24, seed=1)
    assert report["disagreements"] == []
    assert report["legal_failures"] == 0


@pytest.mark.verilator
def test_inverted_bounds_are_as_empty_for_a_pipeline_as_for_the_model() -> None:
    """On each axis: the lower plane above the upper one, by much, by little, and by no more than the pads."""
    design = design_for("tiny", PIPELINED)
    legal = next(case for case in legal_cases(design.manifest) if case.name == "torus")
    highest = (1 << design.manifest.registers["bounds.low.x"].width) - 1
    settings = [legal.registers]
    for axis in "xyz":
        low, high = f"bounds.low.{axis}", f"bounds.high.{axis}"
        middle = (legal.registers[low] + legal.registers[high]) // 2
        for bounds in ((highest, legal.registers[high]), (legal.registers[low], 0), (middle + 9, middle), (highest, 0)):
            settings.append({**legal.registers, low: bounds[0], high: bounds[1]})
    model = loaded_model(design.manifest, legal.image)
    simulated = render_rtl(design, legal.image, settings).frames
    for registers, frame in zip(settings, simulated, strict=True):
        assert differences(SimulatedFrame(frame, 0), model_frame(model, registers)) == []
    assert simulated[0].counters["hits"] > 0 and simulated[1].counters["hits"] == 0


@pytest.mark.parametrize("config", ["small", "fpga"])
def test_every_register_is_reached(config: str) -> None:
    """All but `EXCLUDED`; a room's in a frame that shows one."""
    manifest = manifest_for(config).manifest
    cases = legal_cases(manifest) + environment_cases(manifest)[:1]
    reached: set[str] = set()
    for seed in range(3000):
        legal, corrupt, _ = corrupt_case(seed, KINDS["registers"], cases, manifest)
        reached |= {name for name, value in corrupt.registers.items() if value != legal.registers[name]}
    writable = {register.name for register in manifest.registers.values() if register.access == "rw"}
    assert writable - reached == set(EXCLUDED)


def test_intervals_are_inverted_in_some_of_two_hundred_frames() -> None:
    manifest = manifest_for("small").manifest
    cases = legal_cases(manifest) + environment_cases(manifest)[:1]
    found = Counter[str]()
    for seed in range(200):
        _, corrupt, _ = corrupt_case(seed, KINDS["registers"], cases, manifest)
        for low, high, axes in INTERVALS:
            ends = [(corrupt.registers[low.format(axis)], corrupt.registers[high.format(axis)]) for axis in axes]
            found[low] += any(lower > upper for lower, upper in ends)
    assert all(found[low] >= 3 for low, _, _ in INTERVALS), found


def test_records_of_another_page_are_those_of_its_lines() -> None:
    """A case with `dram.page` has the records that lie in DRAM from this page on."""
    manifest = manifest_for("fpga").manifest
    case = max(legal_cases(manifest), key=lambda case: len(case.image.records))
    case = replace(case, image=replace(case.image, records=np.tile(case.image.records, (4, 1))))
    line, content = line_layout(manifest), dram_image(case.image, manifest)
    for page in (1, 2, 1000):
        read = as_read(replace(case, registers={**case.registers, "dram.page": page}), manifest)
        lines = [content[at : at + line["bytes"]] for at in range(page * 4096, len(content), line["pitch"])]
        expected = np.frombuffer(b"".join(lines), dtype=np.uint8).reshape(-1, read.image.records.shape[1])
        records = read.image.records
        np.testing.assert_array_equal(expected[: len(records)], records[: len(expected)])
        assert not expected[len(records) :].any() and not records[len(expected) :].any()
    assert len(content) > 4096


@pytest.mark.verilator
def test_a_wrong_model_is_found_and_its_frame_is_reproducible(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = frames.model_frame

    def wrong(model: Any, registers: dict[str, int]) -> Frame:
        frame = honest(model, registers)
        return replace(frame, colour=frame.colour ^ 1) if frame.errors else frame

    monkeypatch.setattr(frames, "model_frame", wrong)
    design = design_for("tiny", ())
    found = campaign.fuzz(design, 20, seed=300, kinds=("records",))["disagreements"]
    assert found and all("108 colours" in " ".join(one["differences"]) for one in found)
    again = campaign.fuzz(design, 1, seed=found[-1]["seed"], kinds=(found[-1]["kind"],))["disagreements"]
    assert again == found[-1:]


def test_an_assertion_of_the_hardware_is_the_difference(tmp_path: Path) -> None:
    """A simulator that stops at one prints it between the results."""
    manifest, program = manifest_for("tiny").manifest, tmp_path / "simulator"
    cause = "%Error: A.sv:1: Assertion failed in TOP: too early"
    program.write_text(f"#!/bin/sh\nprintf '%s\\n' '{cause}' '' '%Error: A.sv:1: Verilog $stop'\nexit 134\n")
    program.chmod(0o755)
    case = legal_cases(manifest)[0]
    failed = run_cases(program, manifest, [case], len(case.image.records))
    assert failed == ([], f"the simulated hardware failed (status 134): {cause}")


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
        "kinds": {"records": dict.fromkeys(OUTCOMES, 1)},
        "sums": {"corrupt frames gathered light": 2, "legal frames gathered light": 3},
        "legal_failures": 0,
        "disagreements": [disagreement],
    }

    def fuzz(design: object, cases: int, seed: int, kinds: object, progress: object, found: Any) -> dict[str, Any]:
        found(disagreement)
        return {**report, "disagreements": [vars(disagreement)]}

    monkeypatch.setattr(campaign, "fuzzed_design", lambda *_: None)
    monkeypatch.setattr(campaign, "fuzz", fuzz)
    file = tmp_path / "report.json"
    result = CliRunner().invoke(cli, ["fuzz", "--config", "tiny", "--cases", "5", "--json", str(file)])
    assert result.exit_code == 1
    assert "seed 7, records, cube: record 1 is zeros: 3 colours" in result.output
    assert "2 corrupt frames gathered light, 3 legal frames gathered light" in result.output
    assert json.loads(file.read_text())["disagreements"][0]["seed"] == 7


@pytest.mark.parametrize(
    ("arguments", "advice"),
    [
        (("--kind", "weather"), "no kind of case weather: choose from records, "),
        (("--axi", "16"), "give --refit, too"),
        (("--refit", "--axi", "24"), "give a power of two from 4 to 64"),
    ],
)
def test_wrong_options_are_refused(arguments: tuple[str, ...], advice: str) -> None:
    result = CliRunner().invoke(cli, ["fuzz", *arguments])
    assert result.exit_code == 2 and advice in result.output and result.output.count("\n") == 1


def test_a_kind_that_a_design_lacks_is_refused() -> None:
    with pytest.raises(UserError, match="has no maps to corrupt"):
        campaign.fuzz(manifest_for("tiny"), 1, kinds=("maps",))
