"""The library's header: C11 without warnings, and the bits that Python repeats."""

from __future__ import annotations

import re
import subprocess

from c_programs import DRIVER_FOLDER, WARNINGS

from colonnade.rays import scene

HEADER = DRIVER_FOLDER / "include/colonnade_rays.h"


def test_the_header_is_c11() -> None:
    command = ["gcc", *WARNINGS, "-fsyntax-only", "-x", "c", str(HEADER)]
    assert subprocess.run(command, capture_output=True, text=True).stderr == ""


def test_modes_are_those_of_the_header() -> None:
    bits = dict(re.findall(r"COLONNADE_RAYS_(CULL_FRONT|CULL_BACK|OPAQUE_ONLY) = 1 << (\d+)", HEADER.read_text()))
    assert {name: 1 << int(bit) for name, bit in bits.items()} == {name: getattr(scene, name) for name in bits}
    assert len(bits) == 3
