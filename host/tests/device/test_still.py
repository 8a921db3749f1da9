"""Models that stand still are not evaluated: exactly as if they were. One that is not told of its inputs is found."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from colonnade.design.generator import design_for
from colonnade.device import simulator_build
from colonnade.device.compiler import require_compiler
from colonnade.device.harness_job import FrameOutput, parse_output
from colonnade.device.verilator import run_program, write_job
from colonnade.mesh.load import load_mesh
from colonnade.registers.frame import frame_registers
from colonnade.scene.model import MeshSource, Scene
from colonnade.scene_image.packer import pack

HARNESS = Path(simulator_build.__file__).parent / "harness"

#: A model with an input, its sum, a counter modulo `beats`, and one that counts for a while after each new input.
PROGRAM = r"""
#include "still.hpp"
#include <cstdio>
#include <random>
struct Root {
    unsigned char clock = 0, before = 0;
    unsigned in = 0, old = 0, sum = 0, beat = 0, left = 0, beats = 1;
};
struct Model {
    Root root;
    Root* rootp = &root;
    unsigned char& clock = root.clock;
    void eval() {
        if (root.clock == root.before) return;
        root.before = root.clock;
        if (root.in != root.old) root.left = 9;
        else if (root.left != 0) --root.left;
        root.sum = root.sum * 5 + root.in * (root.left != 0) * (1 + root.beat);
        if (root.left == 0) root.sum = 7 * root.in;
        root.beat = (root.beat + 1) % root.beats;
        root.old = root.in;
    }
};
int main(int, char** argv) try {
    const unsigned beats = std::stoul(argv[1]), isDeaf = std::stoul(argv[2]), cycles = 20000;
    Still<Model> still;
    Model plain;
    still->root.beats = plain.root.beats = beats;
    std::mt19937 random(beats);
    unsigned in = 0, until = 0, out = 0, slept = 0;
    for (unsigned cycle = 0; cycle < cycles; ++cycle) {
        if (cycle == until) {
            in = random() % 4;
            until += 1 + random() % (random() % 2 ? 5 : 100);
        }
        plain.root.in = in;
        if (!still.isStill() && out != still->root.sum) {
            out = still->root.sum;
            still.changed();
        }
        if (still->root.in != in && !(isDeaf && still.isStill())) { still.wake(); still->root.in = in; }
        if (cycle % 64 == 0) {
            if (still->root.in != in) throw std::runtime_error("the input differs");
            still.check("it");
        }
        if ((still.isStill() ? out : still->root.sum) != plain.root.sum) throw std::runtime_error("the output differs");
        slept += still.isStill();
        plain.clock = !plain.clock;
        plain.eval();
        still.edge();
    }
    still.wake();
    const bool isEqual = still->root.beat == plain.root.beat && still->root.sum == plain.root.sum;
    if (!isEqual) throw std::runtime_error("it did not catch up");
    std::printf("%u\n", 100 * slept / cycles);
} catch (const std::exception& problem) {
    std::printf("%s\n", problem.what());
}
"""


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("still")
    (folder / "still.cpp").write_text(PROGRAM)
    compiler, _ = require_compiler("this test")
    command = [compiler, "-std=c++17", "-O1", f"-I{HARNESS}", "-o", folder / "still", folder / "still.cpp"]
    subprocess.run(command, check=True)
    return folder / "still"


def said(program: Path, beats: int, is_deaf: int = 0) -> str:
    return subprocess.run(
        [program, str(beats), str(is_deaf)], capture_output=True, text=True, check=True
    ).stdout.strip()


@pytest.mark.parametrize(("beats", "sleeps"), [(1, True), (2, True), (3, True), (4, True), (6, True), (840, False)])
def test_a_model_that_sleeps_equals_one_that_does_not(program: Path, beats: int, sleeps: bool) -> None:
    """Whatever the period of its free-running counter; one that is too long is never skipped."""
    share = int(said(program, beats))
    assert share > 40 if sleeps else share == 0


def test_a_sleeping_model_that_hears_no_input_is_found(program: Path) -> None:
    assert said(program, 1, is_deaf=1) in ("the input differs", "the output differs")


@pytest.mark.verilator
def test_the_check_of_a_simulator_finds_a_unit_that_hears_no_input(tmp_path: Path) -> None:
    design = design_for("tiny", ())
    image = pack(load_mesh("teapot:4"), design.manifest)
    scene = Scene(MeshSource(name="teapot:4"))
    registers = frame_registers(scene, image.header, design.manifest, 32, 25)
    job, _ = write_job(tmp_path, design.manifest, image, [registers])
    program = str(simulator_build.build_simulator(design))

    def simulated(*options: str) -> FrameOutput:
        lines = run_program([program, "--check", "64", *options, job.name], tmp_path, lambda _: None)
        return parse_output(lines)[0]

    with pytest.raises(RuntimeError, match="the simulator's models disagree on port"):
        simulated("--deaf", "1")
    asleep, awake = simulated("--deaf", "0"), simulated("--awake", "1")
    assert (asleep.cycles, asleep.values) == (awake.cycles, awake.values)
