"""The compiler and Verilator: ignored flags of the user, miscompilation, old versions."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from colonnade.common.errors import UserError
from colonnade.device import simulator_build
from colonnade.device.compiler import (
    SAFE,
    clean_environment,
    require_compiler,
    require_right_compiler,
    require_verilator,
)

needs_compiler = pytest.mark.skipif(shutil.which("g++") is None, reason="g++ is not installed")


def program(folder: Path, name: str, text: str) -> Path:
    """An executable shell script."""
    path = folder / name
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path


@needs_compiler
@pytest.mark.parametrize("level", ["-O1", "-O2", "-O3"])
def test_the_compiler_is_right_with_the_flags_of_simulators(level: str) -> None:
    compiler, _ = require_compiler("a test")
    require_right_compiler(compiler, (level, *SAFE))


@needs_compiler
def test_a_compiler_with_the_bug_is_refused() -> None:
    """g++ 12.2 without the flag that avoids the bug."""
    compiler, version = require_compiler("a test")
    if re.search(r" 12\.2\.\d+$", version) is None:
        pytest.skip(f"only g++ 12.2 is known to have the bug: {version}")
    with pytest.raises(UserError, match=r"miscompiles population counts with -O2: the simulator would be wrong"):
        require_right_compiler(compiler, ("-O2",))


def test_a_compiler_whose_program_counts_wrongly_is_refused(tmp_path: Path) -> None:
    wrong = 'while [ "$1" != -o ]; do [ "$1" = --version ] && { echo "fake 1.0"; exit; }; shift; done\n'
    wrong += 'printf \'#!/bin/sh\\nexit 1\\n\' >"$2"; chmod +x "$2"'
    with pytest.raises(UserError, match=r"\(fake 1.0\) miscompiles population counts with -O2"):
        require_right_compiler(program(tmp_path, "g++", wrong), ("-O2",))


def test_a_compiler_that_fails_is_refused_with_its_first_line(tmp_path: Path) -> None:
    fails = program(tmp_path, "g++", "echo 'cannot execute cc1plus' >&2; echo more >&2; exit 1")
    with pytest.raises(UserError, match=r"does not compile C\+\+: cannot execute cc1plus$"):
        require_right_compiler(fails, ())


def test_the_compiler_ignores_flags_of_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    names = (
        "CFLAGS CXXFLAGS CPPFLAGS LDFLAGS MAKEFLAGS MFLAGS GNUMAKEFLAGS OPT OPT_FAST CXX CPATH OBJCACHE USER_CPPFLAGS"
    )
    for name in names.split():
        monkeypatch.setenv(name, "-ftree-vectorize")
    assert not set(names.split()) & set(clean_environment())
    assert "PATH" in clean_environment()


@pytest.mark.parametrize("version", ["Verilator 4.038 2020-07-11 rev v4.036", "Verilator 5.004 devel", "?"])
def test_an_old_verilator_is_refused(version: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program(tmp_path, "verilator", f"echo '{version}'")
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    with pytest.raises(UserError, match=r"rendering needs Verilator 5.006 or newer; use Debian 12"):
        require_verilator("rendering")


@pytest.mark.parametrize("version", ["Verilator 5.006 2023-01-22 rev (Debian 5.006-3)", "Verilator 5.048 2026-04-26"])
def test_a_newer_verilator_is_accepted(version: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program(tmp_path, "verilator", f"echo '{version}'")
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    assert require_verilator("rendering") == (tmp_path / "verilator", version)


def test_every_model_is_compiled_safely(tmp_path: Path) -> None:
    tools = simulator_build.Tools(tmp_path / "verilator", tmp_path / "g++", ("", ""))
    command = simulator_build._verilate(tools, "Column", [Path("Column/Column.sv")])
    assert command[command.index("-CFLAGS") + 1] == "-fno-tree-slp-vectorize"
    assert f"CXX={tmp_path / 'g++'}" in command
