"""Illegal maps and room registers: RTL and model render the same frames, and the model is defined on all inputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from colonnade import _core
from colonnade.design.generator import design_for, manifest_for
from colonnade.design.manifest import Manifest, field_places, value_range
from colonnade.device.bit_exact import loaded_model, model_frame
from colonnade.scene_image.environment import map_memories
from colonnade.scene_image.file import LoadSection

from colonnade_lab.evaluation.fuzz.campaign import fuzz
from colonnade_lab.evaluation.fuzz.corruption import KINDS, corrupt_case
from colonnade_lab.evaluation.fuzz.environments import environment_cases

FRAMES = 8
SLIC = ("physicalAttributeMemory.encoding=slic",)


@pytest.fixture(scope="module")
def manifest() -> Manifest:
    return manifest_for("small").manifest


@pytest.mark.verilator
@pytest.mark.parametrize("options", [(), pytest.param(SLIC, marks=pytest.mark.matrix)], ids=["two-level", "SLIC"])
def test_hardware_and_model_agree_on_corrupt_maps(options: tuple[str, ...]) -> None:
    """Pixels, ratios, counters and error bits, and the legal frame after each. Long version:
    ``colonnade fuzz --config small --kind maps --cases 700``.
    """
    report = fuzz(design_for("small", options), FRAMES, seed=1, kinds=("maps",))
    assert report["disagreements"] == []
    assert report["legal_failures"] == 0
    outcomes = report["kinds"]["maps"]
    assert outcomes["flagged"] > 0 and outcomes["changed"] > 0


def test_a_seed_always_makes_the_same_corrupt_case(manifest: Manifest) -> None:
    cases = environment_cases(manifest)
    (_, first, change), (_, again, same) = (corrupt_case(3, KINDS["maps"], cases, manifest) for _ in range(2))
    assert change == same and first.registers == again.registers
    for one, other in zip(first.image.attributes, again.image.attributes, strict=True):
        np.testing.assert_array_equal(one.words, other.words)


def test_pointers_beyond_the_heap_set_the_error_and_read_zeros(manifest: Manifest) -> None:
    """A tile with its mask beyond the heap gets its first entry and an error; a mask inside the heap is no error."""
    case = environment_cases(manifest)[0]
    depth = int(manifest.memories["albedo.heap"]["depth"])
    frames = {}
    for pointer in (depth - 1, depth):
        sections = []
        for section in case.image.attributes:
            words = section.words
            if section.memory == "albedo.descriptors":
                # Mode 1: the pointer addresses the mask
                word = (5 << 24) | (9 << 16) | (pointer << 3) | 1
                words = np.tile(np.frombuffer(word.to_bytes(4, "little"), dtype=np.uint8), (len(words), 1))
            if section.memory == "albedo.heap":
                words = np.zeros_like(words)
            sections.append(LoadSection(section.memory, words))
        image = replace(case.image, attributes=tuple(sections))
        frames[pointer] = model_frame(loaded_model(manifest, image), case.registers)
    assert frames[depth - 1].errors == [] and frames[depth].errors == ["illegalRecord"]
    np.testing.assert_array_equal(frames[depth - 1].colour, frames[depth].colour)


@pytest.mark.parametrize("options", [(), SLIC], ids=["two-level", "SLIC"])
def test_the_model_of_a_room_is_defined_on_all_words_and_registers(options: tuple[str, ...]) -> None:
    """Loads beyond a memory are ignored, short words are rejected, and the march terminates."""
    manifest = manifest_for("small", options).manifest
    assert manifest.attributes is not None
    random = np.random.default_rng(7)
    numbers = dict(manifest.numbers) | dict.fromkeys(("stackDepth", "bvh"), 0)
    model = _core.EnvironmentModel(numbers, dict(manifest.attributes.sizes), field_places(manifest.attributes.layouts))
    for name in map_memories(manifest):
        place = manifest.memories[name]
        size = -(-int(place["bits"]) // 8)
        model.load(name, random.integers(0, 256, (int(place["depth"]) + 9, size), dtype=np.uint8))
        with pytest.raises(ValueError, match="words"):
            model.load(name, np.zeros((4, size - 1), dtype=np.uint8))
    rays = 400
    for _ in range(20):
        registers = {}
        for register in manifest.registers.values():
            if register.name.startswith("environment."):
                least, greatest = value_range(register.width, register.signed)
                registers[register.name.removeprefix("environment.")] = int(
                    random.integers(least, greatest, endpoint=True)
                )
        scene, direction = manifest.numbers["sceneBits"] - 1, manifest.numbers["shadeBits"]
        origins = random.integers(-(1 << scene), 1 << scene, (rays, 3))
        ways = random.integers(-(1 << direction), 1 << direction, (rays, 3))
        met = model.march(registers, origins, ways)
        assert met["steps"].max() <= 512 and met["entry"].max() < manifest.attributes.sizes["boundingPlanes"]
