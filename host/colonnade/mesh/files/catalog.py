"""Finds well-known meshes by name, in the user's folders or as downloads from their publishers (`common.published`).

The folders are those of the environment variable COLONNADE_MESHES.
"""

from __future__ import annotations

import errno
import os
from dataclasses import dataclass
from pathlib import Path

from colonnade.common.downloads import fetched
from colonnade.common.errors import UserError, reason_of
from colonnade.common.published import MESHES
from colonnade.mesh.files.formats import SUFFIXES
from colonnade.mesh.geometry import primitives

VARIABLE = "COLONNADE_MESHES"

#: Longest file name, bytes.
_MAX_NAME = 255


@dataclass(frozen=True)
class KnownMesh:
    """A well-known mesh: its file names without suffix, in order of preference, and its subdivisions."""

    stems: tuple[str, ...]
    subdivisions: int = 0


@dataclass(frozen=True)
class Found:
    """A mesh file on this machine."""

    path: Path
    subdivisions: int


KNOWN: dict[str, KnownMesh] = {
    "bunny": KnownMesh(("bunny", "stanford-bunny", "bun_zipper")),
    "armadillo": KnownMesh(("armadillo", "Armadillo")),
    "dragon": KnownMesh(("dragon", "dragon_vrip_res3")),
    "duck": KnownMesh(("duck", "bob_controlmesh"), subdivisions=2),
    "fandisk": KnownMesh(("fandisk",)),
    "cheburashka": KnownMesh(("cheburashka",)),
    "rocker-arm": KnownMesh(("rocker-arm", "rocker_arm", "rockerarm")),
}


def names() -> list[str]:
    """All mesh names without sizes, for messages."""
    return ["teapot", *primitives.SIZED, *primitives.PLAIN, *KNOWN]


def find(name: str) -> Found:
    """Find the file of a named mesh, downloading it if needed.

    Raises:
        UserError: The mesh is in no folder and cannot be downloaded; the message says which file to add.
    """
    known = KNOWN.get(name)
    stems = known.stems if known else (name,)
    folders = [Path(entry) for entry in os.environ.get(VARIABLE, "").split(os.pathsep) if entry]
    for folder in folders:
        for stem in stems:
            for suffix in SUFFIXES:
                if _is_file(path := folder / f"{stem}{suffix}"):
                    return Found(path, known.subdivisions if known else 0)
    if known is None:
        raise UserError(f"no mesh {name}: name a file that exists, or one of {', '.join(names())}")
    return Found(fetched(MESHES[name], f"the mesh {name}"), known.subdivisions)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG and len(os.fsencode(path.name)) > _MAX_NAME:
            return False  # no file can have such a long name
        raise UserError(f"cannot search {path.parent}, a folder of {VARIABLE}: {reason_of(error)}") from None
    except ValueError:
        return False
