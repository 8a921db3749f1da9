"""The DRAM with banks and rows of the simulator's harness: the cycle of the first data of each read."""

from __future__ import annotations

import shutil
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest

from colonnade.device import simulator_build
from colonnade.device.compiler import require_compiler

pytestmark = pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")

#: Prints when the data of a read leave, for each line: cycle, address, bytes.
PROGRAM = """#include <iostream>
#include "dram_timing.hpp"
int main(int, char** arguments) {
    const auto timing = dramTiming(std::stoul(arguments[1]), 20);
    for (std::uint64_t now, address, bytes; std::cin >> now >> address >> bytes;)
        std::cout << timing->due(now, address, bytes) << ' ';
}
"""
ROW, BANKS = 8192, 8


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dram")
    (folder / "main.cpp").write_text(PROGRAM)
    compiler, _ = require_compiler("a test")
    include = f"-I{Path(simulator_build.__file__).parent / 'harness'}"
    subprocess.run([compiler, "-std=c++17", "-Wall", include, "main.cpp", "-o", "dram"], cwd=folder, check=True)
    return folder / "dram"


def due(program: Path, banks: int, *reads: tuple[int, int, int]) -> list[int]:
    lines = "\n".join(" ".join(map(str, read)) for read in reads)
    ran = subprocess.run([program, str(banks)], input=lines, capture_output=True, text=True, check=True)
    return [int(word) for word in ran.stdout.split()]


def test_without_banks_the_latency_is_constant(program: Path) -> None:
    assert due(program, 0, (0, 0, 160), (1, 5 * ROW, 160), (2000, 0, 160)) == [20, 21, 2020]


def test_rows_banks_and_the_bus_of_data(program: Path) -> None:
    hit, opened, conflict = 20, 3 + 20, 2 + 3 + 3 + 20
    # A closed row is opened, an open one read; three bursts of 64 bytes keep the bus until the next read's
    assert due(program, BANKS, (100, 0, 160), (101, 256, 160), (200, 512, 160)) == [
        100 + opened,
        103 + opened,
        200 + hit,
    ]
    # Another row of the bank waits for the last burst of the row before; another bank only for the bus
    two = (BANKS * ROW, ROW)
    assert due(program, BANKS, (100, 0, 64), (300, 256, 64), (300, two[0], 64))[2] == 300 + conflict
    assert due(program, BANKS, (100, 0, 64), (300, 256, 64), (300, two[1], 64))[2] == 300 + opened
    # A row stays open for its least time
    assert due(program, BANKS, (100, 0, 64), (100, two[0], 64))[1] == 100 + 7 + 3 + 3 + 20
    # Four rows at most are opened in six cycles, two cycles apart
    assert due(program, BANKS, *((100, bank * ROW, 64) for bank in range(5))) == [
        100 + opened + 2 * n for n in range(5)
    ]


def test_refresh_closes_the_rows_and_blocks_the_banks(program: Path) -> None:
    first, second = due(program, BANKS, (1500, 0, 64), (1560, 0, 64))
    assert (first, second) == (1500 + 3 + 20, 1560 + 3 + 52 + 3 + 20)
    # In the order of the reads no data overtake others, however they are addressed
    reads = [(n, (n * 7919 * 256) % (1 << 24), 160) for n in range(0, 6000, 2)]
    times = due(program, BANKS, *reads)
    assert all(later - earlier >= 3 for earlier, later in pairwise(times))
