"""Reads mesh files of the formats that trimesh reads and that have no reader here: 3MF, COLLADA, 3DXML, XAML.

`colonnade.mesh.files.trimesh_program` runs in a process of its own and writes a file as binary glTF, which `read_gltf`
reads with its materials and its limits. Pictures of COLLADA are read here: those beside a file by the rules of all
references, those of an archive one after the other.
"""

from __future__ import annotations

import json
import re
from pathlib import Path

from colonnade.common.decoder_process import decode, last_line
from colonnade.common.errors import UserError
from colonnade.mesh.files.gltf import read_gltf
from colonnade.mesh.files.mesh_archive import ArchivePictures
from colonnade.mesh.files.resolver import References
from colonnade.mesh.losses import Loss, Losses
from colonnade.mesh.materials.surface import RawSurface

#: Memory of the process beside its libraries, bytes, more for each byte of the file, and the most. Archives hold text
#: at a tenth of its size, of which the tree of XML has ten times.
_MEMORY, _MEMORY_OF_A_BYTE, _MOST_MEMORY = 1 << 30, 200, 1 << 33
#: Its processor time, seconds, and bytes of the file for one more. Counts of what a file asks for are reached before.
_SECONDS, _BYTES_OF_A_SECOND = 60, 1 << 16


def read_by_trimesh(data: bytes, path: Path, references: References, losses: Losses) -> RawSurface:
    """Read a file as trimesh does, in metres if it states a unit, and with y up if it states an axis.

    Raises:
        UserError: The file is invalid, or asks for more memory or time than the limits.
    """
    memory = min(_MEMORY + _MEMORY_OF_A_BYTE * len(data), _MOST_MEMORY)
    seconds = _SECONDS + len(data) // _BYTES_OF_A_SECOND
    program = "colonnade.mesh.files.trimesh_program"
    kind = path.suffix.lower()
    done = decode(program, memory, seconds, kind, data=data)
    reason = last_line(done.stderr)
    if done.returncode < 0 or (done.returncode and re.search("MemoryError|allocat", reason)):
        raise UserError(
            f"{path} cannot be read as a mesh: it takes more than {memory >> 20:,} MiB or {seconds} s:"
            " export it as glTF, or in parts"
        )
    if done.returncode != 0:
        raise UserError(f"{path} cannot be read as a mesh: {reason}")
    found, _, content = done.stdout.partition(b"\n")
    for one, several, instead, count, name in json.loads(found):
        losses.add(Loss(one, several, instead), count, name)
    return read_gltf(content, path, ArchivePictures(path, data) if kind == ".zae" else references, losses)
