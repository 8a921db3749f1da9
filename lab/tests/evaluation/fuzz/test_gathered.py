"""Frames that gather light, in campaigns of designs that can."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from colonnade.design.generator import design_for, manifest_for
from colonnade.design.manifest import Manifest
from colonnade.device.bit_exact import loaded_model, model_frame

from colonnade_lab.evaluation.fuzz.campaign import fuzz
from colonnade_lab.evaluation.fuzz.cases import Case, legal_cases
from colonnade_lab.evaluation.fuzz.corruption import KINDS, corrupt_case
from colonnade_lab.evaluation.fuzz.environments import environment_cases
from colonnade_lab.evaluation.fuzz.gathered import with_any_light

#: A design of `test_gather.py`.
OPTIONS = ("physicalAttributeMemory=null", "array.columns=1")
#: Kinds of frames without instances.
ALONE = [kind for kind in KINDS if kind != "instances"]


@pytest.fixture(scope="module")
def manifest() -> Manifest:
    return manifest_for("small").manifest


@pytest.fixture(scope="module")
def cases(manifest: Manifest) -> tuple[Case, ...]:
    return legal_cases(manifest) + environment_cases(manifest)


def gathered_rays(case: Case, manifest: Manifest) -> int:
    frame = model_frame(loaded_model(manifest, case.image), case.registers)
    assert frame.errors == []
    return frame.counters["raysGather"]


@pytest.mark.parametrize("kind", ALONE)
def test_half_of_the_legal_frames_gather_light(kind: str, manifest: Manifest, cases: tuple[Case, ...]) -> None:
    rays = {case.name: gathered_rays(case, manifest) for case in cases}
    legal = [corrupt_case(seed, KINDS[kind], cases, manifest)[0] for seed in range(100)]
    gathering = [case for case in legal if rays[case.name] > 20]
    assert len(gathering) >= 40
    assert {case.image.header.room is None for case in gathering} == {True, False}
    for case in gathering:
        assert {case.registers[f"materials[{index}].kind"] for index in range(4)} == {0, 1, 2, 3}


def test_gathering_frames_have_any_cube_at_each_distance(manifest: Manifest, cases: tuple[Case, ...]) -> None:
    added = with_any_light(cases, manifest)[len(cases) :]
    assert len(added) == 3 * sum(case.gathers for case in cases) == 6
    assert Counter(case.registers["gather.parallax"] for case in added) == {1: 2, 2: 2, 3: 2}
    assert len({case.image.attributes[-1].words.tobytes() for case in added}) == 6
    assert all(gathered_rays(case, manifest) > 20 for case in added)


def test_no_corrupt_frame_gathers_the_light_of_a_cube_that_is_not_loaded(
    manifest: Manifest, cases: tuple[Case, ...]
) -> None:
    """It would see the cube of an earlier frame."""
    for seed in range(800):
        legal, corrupt, change = corrupt_case(seed, KINDS["registers"], cases, manifest)
        assert legal.registers["gather.bounces"] > 0 or corrupt.registers["gather.bounces"] == 0, change


def test_the_kind_reaches_registers_and_cube(manifest: Manifest, cases: tuple[Case, ...]) -> None:
    reached = set[str]()
    for seed in range(200):
        legal, corrupt, _ = corrupt_case(seed, KINDS["gather"], cases, manifest)
        reached |= {name for name, value in corrupt.registers.items() if value != legal.registers[name]}
        for before, after in zip(legal.image.attributes, corrupt.image.attributes, strict=True):
            reached |= set() if np.array_equal(before.words, after.words) else {before.memory}
    assert reached == {"light.cube"} | {
        name
        for name in manifest.registers
        if name.startswith("gather.")
        or (name.startswith(tuple(f"materials[{i}]." for i in range(4))) and (".lobe." in name or "].kind" in name))
    }


@pytest.mark.verilator
def test_hardware_and_model_agree_on_corrupt_frames_that_gather() -> None:
    """The campaign counts them. Long version: ``colonnade fuzz --config small --cases 1000``."""
    report = fuzz(design_for("small", OPTIONS), 24, seed=1)
    assert report["disagreements"] == [] and report["legal_failures"] == 0
    assert report["kinds"]["gather"]["changed"] > 2 and list(report["kinds"]) == ALONE
    assert list(report["sums"]) == ["corrupt frames gathered light", "legal frames gathered light"]
    assert all(8 < number < 24 for number in report["sums"].values())
