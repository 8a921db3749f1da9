"""Frames of instances, in campaigns of designs that have them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from colonnade.common.framebuffer import Frame
from colonnade.design.generator import design_for, manifest_for
from colonnade.device.bit_exact import loaded_model, model_frame
from equal_frames import PIPELINED

from colonnade_lab.evaluation.fuzz import frames
from colonnade_lab.evaluation.fuzz.campaign import fuzz
from colonnade_lab.evaluation.fuzz.corruption import KINDS, corrupt_case
from colonnade_lab.evaluation.fuzz.environments import environment_cases
from colonnade_lab.evaluation.fuzz.instances import instance_cases


def test_legal_frames_have_two_to_sixteen_instances_of_one_mesh_or_several() -> None:
    """Objects of equal meshes share a root; scales differ by a hundred."""
    manifest = manifest_for("small", ("frame.instances=16", "physicalAttributeMemory=null")).manifest
    cases = instance_cases(manifest)
    assert {case.registers["scene.instances"] for case in cases} == {2, 3, 5, 8, 16}
    roots = [{one.root for one in case.image.header.instances} for case in cases]
    assert {len(of_case) == 1 for of_case in roots} == {True, False}
    sizes = np.array([np.linalg.norm(one.transform[0][:3]) for case in cases for one in case.image.header.instances])
    assert sizes.min() == pytest.approx(0.02) and sizes.max() == pytest.approx(2.0)
    assert any(case.gathers for case in cases)
    seen = []
    for case in cases:
        frame = model_frame(loaded_model(manifest, case.image), case.registers)
        assert frame.errors == []
        seen.append(len(np.unique(frame.instance[frame.is_object])))
    assert min(seen) >= 1 and max(seen) >= 2


def test_a_room_shows_two_instances() -> None:
    manifest = manifest_for("small", ("frame.instances=2",)).manifest
    *_, case = environment_cases(manifest)
    frame = model_frame(loaded_model(manifest, case.image), case.registers)
    assert frame.errors == [] and case.image.header.room is not None
    assert set(frame.instance[frame.is_object].tolist()) == {0, 1}


def test_the_kind_reaches_all_registers_of_instances() -> None:
    manifest = manifest_for("tiny", PIPELINED).manifest
    cases, reached = instance_cases(manifest), set[str]()
    for seed in range(600):
        legal, corrupt, change = corrupt_case(seed, KINDS["instances"], cases, manifest)
        assert corrupt_case(seed, KINDS["instances"], cases, manifest)[1:] == (corrupt, change)
        reached |= {name for name, value in corrupt.registers.items() if value != legal.registers[name]}
    parts = ("instances[", "scene.", "bounds.", "materials[", "camera.", "lights[", "shading.")
    asked = {name for name, one in manifest.registers.items() if one.access == "rw" and name.startswith(parts)}
    assert asked - reached == {name for name in asked if name.endswith(".hasTexture")}


@pytest.mark.verilator
def test_hardware_and_model_agree_on_corrupt_frames_of_instances() -> None:
    """Long version: ``colonnade fuzz --config small --set frame.instances=16 --kind instances --cases 1000``."""
    report = fuzz(design_for("tiny", PIPELINED), 24, seed=1, kinds=("instances",))
    assert report["disagreements"] == [] and report["legal_failures"] == 0
    assert report["kinds"]["instances"]["changed"] > 8
    assert report["sums"] == {"corrupt frames had instances": 24, "legal frames had instances": 24}


@pytest.mark.verilator
def test_a_wrong_instance_in_the_model_is_found_and_its_frame_is_reproducible(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = frames.model_frame

    def wrong(model: Any, registers: dict[str, int]) -> Frame:
        frame = honest(model, registers)
        moved = registers["scene.instances"] == 3 and registers["frame.width"] == 12
        return replace(frame, instance=frame.instance + frame.is_object) if moved else frame

    monkeypatch.setattr(frames, "model_frame", wrong)
    design = design_for("tiny", PIPELINED)
    found = fuzz(design, 24, seed=100, kinds=("instances",))["disagreements"]
    assert 0 < len(found) < 24 and all(" instances" in " ".join(one["differences"]) for one in found)
    assert fuzz(design, 1, seed=found[-1]["seed"], kinds=("instances",))["disagreements"] == found[-1:]
