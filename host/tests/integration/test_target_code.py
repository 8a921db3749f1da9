"""The C that computes on a target uses neither memory of its own nor floats."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest
from c_programs import DRIVER, DRIVER_FOLDER, NEEDS_RISCV, RISCV, WARNINGS
from target_programs import MACHINE

SOURCES = [source for source in DRIVER if re.match("colonnade_(mesh|view)", source.stem)]
#: What a C compiler may call for 64-bit integers and structures.
ALLOWED = re.compile(r"colonnade_\w+|__(u?div|u?mod|mul|ashl|ashr|lshr)di3|mem(cpy|set|move|cmp)|__stack_chk_fail")


@pytest.mark.parametrize("compiler", ["gcc", pytest.param(RISCV, marks=NEEDS_RISCV)], ids=["this machine", "RV32IM"])
def test_nothing_is_allocated_and_no_float_is_used(tmp_path: Path, compiler: str) -> None:
    """Undefined symbols are for 64-bit integers, and no instruction is one of the floating-point unit."""
    machine = MACHINE if compiler == RISCV else ["-mno-sse", "-mno-80387", "-mno-mmx"]
    for source in SOURCES:
        target = tmp_path / f"{source.stem}.o"
        subprocess.run(
            [compiler, *WARNINGS, "-O2", *machine, f"-I{DRIVER_FOLDER / 'include'}", "-c", source, "-o", target],
            check=True,
        )
        nm = compiler.replace("gcc", "nm")
        symbols = subprocess.run([nm, "-u", target], capture_output=True, text=True, check=True).stdout.split()
        assert [name for name in symbols if name != "U" and ALLOWED.fullmatch(name) is None] == []
        text = source.read_text() + (DRIVER_FOLDER / "src" / "colonnade_integers.h").read_text()
        assert re.search(r"\b(float|double|malloc|__int128)\b", text) is None
