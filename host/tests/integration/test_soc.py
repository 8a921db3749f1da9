"""The comparison of rays in the LiteX SoC, by memories made up here; `tools/soc rays` makes a real one."""

from __future__ import annotations

import importlib
import json
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest

from colonnade.design.toolchain import project_root

FOLDER = project_root() / "soc" / "litex"
TAGS, HITS = [0x5000, 0x80005001], 64


class Run:
    """What a simulation of two batches leaves in a folder, the second one refused."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.syspath_prepend(str(FOLDER))
        layouts = importlib.import_module("layouts")
        self.folder = folder
        random = np.random.default_rng(1)
        results = struct.pack("<2I", *TAGS).ljust(HITS, b"\xa5") + random.bytes(60) + b"\xa5" * 68
        self.files = {"dram": random.bytes(640), "results": results}
        self.files["batches"] = bytes(60) + struct.pack("<2I", len(TAGS), len(results)) + random.bytes(1000)
        self.layout = layouts.memory_layout("rays", {"scene": self.files["dram"], "batches": self.files["batches"]})
        self.memory = bytearray([layouts.UNWRITTEN]) * layouts.MAIN_RAM_BYTES
        self.places = {name: self.layout[name] - layouts.MAIN_RAM for name in ("scene", "batches", "ring", "results")}
        for name, file in (("scene", "dram"), ("batches", "batches"), ("results", "results")):
            self.put(name, 0, self.files[file])
        self.put("ring", 0, bytes(128))
        batches = [f"batch {i}: 4 rays, tag {tag:08x}, {100 + i} cycles, queued" for i, tag in enumerate(TAGS)]
        self.console = "\n".join([*batches, f"results: crc32 {zlib.crc32(results):08x}"])

    def put(self, name: str, offset: int, content: bytes) -> None:
        at = self.places[name] + offset
        self.memory[at : at + len(content)] = content

    def compare(self) -> tuple[int, str]:
        (self.folder / "gateware").mkdir(exist_ok=True)
        words = np.frombuffer(self.memory, dtype="<u4")
        (self.folder / "gateware" / "memory.hex").write_text("\n".join(f"{word:08x}" for word in words))
        (self.folder / "layout.json").write_text(json.dumps(self.layout))
        (self.folder / "console.log").write_text(self.console)
        for suffix, content in self.files.items():
            (self.folder / f"rays.{suffix}").write_bytes(content)
        command = [
            sys.executable,
            FOLDER / "compare_rays.py",
            self.folder / "rays",
            self.folder,
            self.folder / "console.log",
        ]
        done = subprocess.run(command, capture_output=True, text=True)
        return done.returncode, done.stdout + done.stderr


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    return Run(tmp_path, monkeypatch)


def test_equal_results_pass(run: Run) -> None:
    status, text = run.compare()
    assert status == 0 and "0 of 192 bytes of the results of 2 batches differ" in text
    assert "1 of these failed, as intended" in text


@pytest.mark.parametrize("offset", (0, HITS + 5, HITS + 60), ids=("a tag", "a hit", "a byte behind the hits"))
def test_a_byte_that_differs_fails(run: Run, offset: int) -> None:
    run.put("results", offset, bytes([run.files["results"][offset] ^ 1]))
    run.console = run.console.replace(
        f"{zlib.crc32(run.files['results']):08x}",
        f"{zlib.crc32(bytes(run.memory[run.places['results'] :][:192])):08x}",
    )
    status, text = run.compare()
    assert status == 1 and "1 of 192 bytes" in text


@pytest.mark.parametrize(
    ("name", "offset", "expected"),
    [
        ("scene", 10, "the file scene has changed"),
        ("batches", 10, "the file batches has changed"),
        ("results", 192, "1 byte outside the ring and the results changed"),
        ("results", 70, "the processor does not see the results as in memory"),
    ],
)
def test_other_bytes_that_change_fail(run: Run, name: str, offset: int, expected: str) -> None:
    at = run.places[name] + offset
    run.put(name, offset, bytes([run.memory[at] ^ 1]))
    status, text = run.compare()
    assert status == 1 and expected in text


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        ("batch 1", "", "the program has ended 1 of 2 batches"),
        (", queued", "", "no batch was queued while another ran"),
    ],
)
def test_a_console_that_lacks_something_fails(run: Run, before: str, after: str, expected: str) -> None:
    run.console = run.console.replace(before, after)
    status, text = run.compare()
    assert status == 1 and expected in text
