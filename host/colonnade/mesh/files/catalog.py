"""Finds well-known meshes by name, in the user's folders or as downloads from their publishers.

The folders are those of the environment variable COLONNADE_MESHES. None of these meshes is part of Colonnade; their
publishers' pages state the terms of use.
"""

from __future__ import annotations

import errno
import os
from dataclasses import dataclass
from pathlib import Path

from colonnade.common.errors import UserError, reason_of
from colonnade.mesh.files.formats import SUFFIXES
from colonnade.mesh.geometry import primitives

VARIABLE = "COLONNADE_MESHES"

#: Longest file name, bytes.
_MAX_NAME = 255


@dataclass(frozen=True)
class Download:
    """A published archive.

    Attributes:
        member: Path of the mesh in a tar archive; None for a compressed PLY file.
    """

    url: str
    sha256: str
    member: str | None


@dataclass(frozen=True)
class KnownMesh:
    """A well-known mesh: its file names without suffix, in order of preference, and its subdivisions."""

    stems: tuple[str, ...]
    download: Download | None = None
    subdivisions: int = 0


@dataclass(frozen=True)
class Found:
    """A mesh file on this machine."""

    path: Path
    subdivisions: int


_STANFORD = "http://graphics.stanford.edu/pub/3Dscanrep"

KNOWN: dict[str, KnownMesh] = {
    "bunny": KnownMesh(
        ("bunny", "stanford-bunny", "bun_zipper"),
        Download(
            f"{_STANFORD}/bunny.tar.gz",
            "a5720bd96d158df403d153381b8411a727a1d73cff2f33dc9b212d6f75455b84",
            "bunny/reconstruction/bun_zipper.ply",
        ),
    ),
    # The download has all 345,944 triangles; the reduced mesh of 86,482 must be in a folder
    "armadillo": KnownMesh(
        ("armadillo", "Armadillo"),
        Download(
            f"{_STANFORD}/armadillo/Armadillo.ply.gz",
            "8b9b56cc36e66d54429b1e1e75bd89e833645bfe0dc7c1afd1205877a7356a3f",
            None,
        ),
    ),
    "dragon": KnownMesh(
        ("dragon", "dragon_vrip_res3"),
        Download(
            f"{_STANFORD}/dragon/dragon_recon.tar.gz",
            "74ac1d90989c9b1732edee82d57e9ce71452144cf4355f108d8c9c616d28d02f",
            "dragon_recon/dragon_vrip_res3.ply",
        ),
    ),
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
    if known.download is None:
        raise UserError(f"mesh {name} is not in the folders of {VARIABLE}: {_advice(stems[0])}")
    return Found(_fetch(name, known.download), known.subdivisions)


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG and len(os.fsencode(path.name)) > _MAX_NAME:
            return False  # no file can have such a long name
        raise UserError(f"cannot search {path.parent}, a folder of {VARIABLE}: {reason_of(error)}") from None
    except ValueError:
        return False


def _advice(stem: str) -> str:
    return f"put {stem}.ply, .obj or .stl into a folder and name that folder in {VARIABLE}"


def _fetch(name: str, download: Download) -> Path:
    """Download a mesh file, or take it from the user's cache."""
    import pooch

    processor: pooch.Decompress | pooch.Untar
    if download.member is None:
        processor = pooch.Decompress(name=f"{name}.ply")
    else:
        processor = pooch.Untar(members=[download.member])
    pooch.get_logger().setLevel("ERROR")
    try:
        result = pooch.retrieve(
            url=download.url,
            known_hash=f"sha256:{download.sha256}",
            path=Path(pooch.os_cache("colonnade")) / "meshes",
            processor=processor,
            downloader=pooch.HTTPDownloader(timeout=30),
        )
    except Exception as error:  # network, disk, hash: the advice is the same
        raise UserError(
            f"mesh {name} could not be downloaded from {download.url} ({type(error).__name__}): {_advice(name)}"
        ) from None
    return Path(result[0] if isinstance(result, list) else result)
