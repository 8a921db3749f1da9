"""The readers of OBJ, PLY, STL and OFF over the files of `mesh_cases`."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mesh_cases import ASCII, CASES, POINTS

from colonnade import _core
from colonnade.common.errors import UserError
from colonnade.mesh.files.formats import read_surface
from colonnade.mesh.materials.surface import RawSurface


def digest_of(surface: RawSurface) -> str:
    """Digits of the digest of all arrays of a surface."""
    found = hashlib.sha256()
    for name in ("vertices", "faces", "normals", "colours", "uvs", "face_materials"):
        values = getattr(surface, name)
        found.update(b"none" if values is None else np.ascontiguousarray(values).tobytes())
    return found.hexdigest()[:12]


@pytest.mark.parametrize("name", CASES)
def test_a_file_has_the_surface_the_notes_or_the_refusal_of_the_table(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    file = case.write(tmp_path / "case", name)
    if case.says is not None:
        with pytest.raises(UserError) as caught:
            read_surface(file)
        assert case.says in str(caught.value) and "\n" not in str(caught.value)
        return
    found = read_surface(file)
    assert found.losses.lines() == case.notes
    assert digest_of(found.surface) == case.digest


def test_the_work_for_a_file_grows_with_its_bytes() -> None:
    """Of each name among these once for each other, a reader would work for an hour."""
    points = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    elements = "".join(f"element e{i} 1\nproperty char q\n" for i in range(300_000))
    header = ASCII.replace("end_header\n", f"{elements}end_header\n")
    for kind, content in (
        ("obj", f"mtllib {'a ' * 500_000}\n{points}"),
        ("ply", f"{header}{POINTS}3 0 1 2\n3 0 2 3\n{'1 ' * 300_000}"),
    ):
        file = _core.MeshFile(kind, b"a")
        file.begin(content.encode())
        while file.next_library() is not None:
            file.give_library(None, b"")
        assert file.pictures() == [] and len(file.finish([])["faces"]) == {"obj": 1, "ply": 2}[kind]


def test_rows_that_are_refused_take_no_memory(tmp_path: Path) -> None:
    """A row of two bytes, of a million, that is kept takes 80 bytes."""
    program = (
        "from pathlib import Path\n"
        "from colonnade import _core\n"
        "peak = lambda: int(Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0])\n"
        "data, file = b'OFF\\n1000000 1 0\\n' + 1000000 * b'0\\n', _core.MeshFile('off', b'a')\n"
        "before = peak()\n"
        "try:\n"
        "    file.begin(data)\n"
        "except ValueError:\n"
        "    print(peak() - before)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert int(done.stdout) < 32 << 10  # KiB
