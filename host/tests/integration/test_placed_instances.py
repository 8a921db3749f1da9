"""The C that places objects on a target: the same words on every processor, and what they cost."""

from __future__ import annotations

from pathlib import Path

import pytest
from c_programs import NEEDS_RISCV, RISCV, SANITIZERS
from target_programs import MACHINE, NEEDS_QEMU, QEMU, build, executed, hash_of

FRAMES, OBJECTS = 500, 16
OF_THE_TEST = {"result", "_start", "make_transform", "next", "number", "add"}
#: Most for an object.
MAX_INSTRUCTIONS = 9000


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("instances")


@pytest.fixture(scope="module")
def expected(folder: Path) -> str:
    """The hash of objects at random places on this machine, optimised."""
    return hash_of(build("gcc", folder, "optimised", "instances", "-O2", f"-DFRAMES={FRAMES}"))


@pytest.mark.matrix
def test_words_without_optimisation_and_with_sanitizers_are_the_same(folder: Path, expected: str) -> None:
    assert hash_of(build("gcc", folder, "checked", "instances", "-O0", *SANITIZERS, f"-DFRAMES={FRAMES}")) == expected


@NEEDS_RISCV
@NEEDS_QEMU
def test_words_of_a_riscv_are_the_same(folder: Path, expected: str) -> None:
    assert hash_of(QEMU, build(RISCV, folder, "riscv", "instances", "-Os", *MACHINE, f"-DFRAMES={FRAMES}")) == expected


@NEEDS_RISCV
@NEEDS_QEMU
def test_an_object_takes_few_instructions(folder: Path, tmp_path: Path) -> None:
    counts = []
    for frames in (1, 6):
        program = build(RISCV, folder, f"counted{frames}", "instances", "-O2", *MACHINE, f"-DFRAMES={frames}")
        counts.append(sum(name not in OF_THE_TEST for name in executed(program, tmp_path)))
    each = (counts[1] - counts[0]) / 5 / OBJECTS
    print(f"{each:.0f} instructions an object")
    assert 1000 < each <= MAX_INSTRUCTIONS
