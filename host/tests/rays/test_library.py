"""The library's header: C11 without warnings, and the bits that Python repeats."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from c_programs import DRIVER_FOLDER, WARNINGS
from rays_library import preloaded

from colonnade import _core
from colonnade.design.generator import manifest_for
from colonnade.rays import scene

HEADER = DRIVER_FOLDER / "include/colonnade_rays.h"


def test_the_header_is_c11() -> None:
    command = ["gcc", *WARNINGS, "-fsyntax-only", "-x", "c", str(HEADER)]
    assert subprocess.run(command, capture_output=True, text=True).stderr == ""


def test_modes_are_those_of_the_header() -> None:
    bits = dict(re.findall(r"COLONNADE_RAYS_(CULL_FRONT|CULL_BACK|OPAQUE_ONLY) = 1 << (\d+)", HEADER.read_text()))
    assert {name: 1 << int(bit) for name, bit in bits.items()} == {name: getattr(scene, name) for name in bits}
    assert len(bits) == 3


#: A library in which no thread starts.
_NO_THREADS = """
#include <errno.h>
#include <pthread.h>
int pthread_create(pthread_t *t, const pthread_attr_t *a, void *(*f)(void *), void *x) { return EAGAIN; }
"""

#: Hits of thousands of rays, and of each of them alone.
_MANY_RAYS = """
import numpy as np
from colonnade.rays import Scene
scene = Scene([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
rays = np.tile([0.0, 0, 1, 0, 0, 0, -1, np.inf], (5000, 1))
rays[:, :2] = np.random.default_rng(1).random((5000, 2))
print((scene.closest(rays).t == [scene.closest([ray]).t[0] for ray in rays]).all(), scene.occluded(rays).sum())
"""


def test_rays_are_traced_where_no_thread_starts(tmp_path: Path) -> None:
    (tmp_path / "none.c").write_text(_NO_THREADS)
    shim = tmp_path / "none.so"
    subprocess.run(["gcc", "-shared", "-fPIC", tmp_path / "none.c", "-o", shim], check=True)
    outputs = []
    for more in (preloaded(), preloaded(shim)):
        variables = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"} | more
        command = [sys.executable, "-c", _MANY_RAYS]
        outputs.append(subprocess.run(command, env=variables, cwd=tmp_path, stdout=subprocess.PIPE, check=True).stdout)
    assert outputs[0] == outputs[1] and outputs[0].startswith(b"True ")


@pytest.mark.parametrize(
    ("line", "message"),
    (
        ("number recordBits 0", "recordBits is 0: a device has 64 to 4096"),
        ("number recordBits -1", "recordBits is -1"),
        ("number recordBits 64", "is beyond its record"),
        ("number boxBits -1", "boxBits is -1: a device has 4 to 7"),
        ("number boxBits 9223372036854775807", "boxBits is 9223372036854775807"),
        ("number vertexBits 99999999999999999999", "a line that is not complete"),
        ("number stackDepth 1000000", "stackDepth is 1000000"),
        ("number gridBits 99999999", "gridBits is 99999999, which no device has"),
        ("layout node first -8 21 0", "field node first is none"),
        ("layout node first 8 70 0", "is beyond its record"),
        ("depth 3", "a line of the unknown kind 'depth'"),
    ),
)
def test_designs_of_no_device_are_refused(line: str, message: str) -> None:
    """The last line of a name counts."""
    text = scene.design_text(manifest_for("edge").manifest)
    with pytest.raises(ValueError, match=message):
        _core.Rays(f"{text}\n{line}")
