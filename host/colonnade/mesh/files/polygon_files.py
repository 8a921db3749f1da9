"""Reads OBJ files with their MTL files, PLY, STL and OFF by ``cpp/mesh/files``, which the browser tab shares.

These are our own because trimesh splits concave polygons wrongly, reads neither strips nor the normals of all files,
and does not say what it leaves out. The readers take the bytes of a file, ask for those of its materials and for the
pictures of its textures, and give triangles, what is lost, or a refusal of one line.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from colonnade.common.errors import UserError
from colonnade.mesh.files.resolver import References
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.materials import KINDS, Alpha, MeshMaterial
from colonnade.mesh.materials.surface import RawSurface
from colonnade.mesh.materials.texture import Texture, Wrap
from colonnade.mesh.materials.texture_reader import TextureReader

SUFFIXES = (".obj", ".ply", ".stl", ".off")


def read_polygons(data: bytes, path: Path, references: References, losses: Losses) -> RawSurface:
    """Read a file of one of `SUFFIXES`.

    Raises:
        UserError: The file, or one of its materials, is invalid or truncated.
    """
    from colonnade import _core

    file = _core.MeshFile(path.suffix.lower().removeprefix("."), os.fsencode(path))
    textures = TextureReader(losses)
    try:
        file.begin(data)
        while (name := file.next_library()) is not None:
            library = references.materials(os.fsdecode(name))
            file.give_library(*((None, b"") if library is None else (library[0], os.fsencode(library[1]))))
        pictures = file.pictures()
        losses.take(file.losses())
        read = [_read(textures, references, losses, os.fsdecode(name), clamped) for name, clamped in pictures]
        textures.count_losses()
        found = file.finish(read)
    except ValueError:
        raise UserError(file.refusal().decode("utf-8", "surrogateescape")) from None
    losses.take(file.losses())
    faces = found.pop("faces")
    own = {name: found[name] for name in ("normals", "colours", "uvs")}
    of_faces = found["face_materials"]
    return RawSurface(
        vertices=np.zeros((0, 3)) if found["vertices"] is None else found["vertices"],
        faces=np.zeros((0, 3), np.int64) if faces is None else faces.astype(np.int64),
        materials=tuple(_material(*values) for values in found["materials"]),
        face_materials=None if of_faces is None else of_faces.astype(np.int64),
        textures=tuple(_texture(textures.textures, *values) for values in found["textures"]),
        **own,
    )


def _read(textures: TextureReader, references: References, losses: Losses, name: str, is_clamped: bool) -> int:
    """The number of a picture among the textures that are read; -1, and a loss, if it is not."""
    data = references.picture(name, losses)
    wrap: Wrap = "clamp" if is_clamped else "repeat"
    number = None if data is None else textures.read(data, name, (wrap, wrap))
    return -1 if number is None else number


def _material(
    kind: int,
    albedo: list[float],
    ior: float,
    roughness: float,
    emission: list[float],
    alpha: float | None,
    texture: int,
) -> MeshMaterial:
    """A material of ``FileMaterial``."""
    (red, green, blue), (glow_red, glow_green, glow_blue) = albedo, emission
    return MeshMaterial(
        KINDS[kind],
        (red, green, blue),
        ior,
        texture=None if texture < 0 else texture,
        emission=(glow_red, glow_green, glow_blue),
        alpha=None if alpha is None else Alpha(alpha),
        roughness=roughness,
    )


def _texture(read: list[Texture], picture: int, mask: int, is_white: bool) -> Texture:
    """A texture of ``FileTexture``."""
    from colonnade import _core

    own = read[picture]
    alpha = None if mask < 0 else _core.mask_of(read[mask].pixels, read[mask].alpha, *own.pixels.shape[:2])
    return replace(own, pixels=np.full_like(own.pixels, 255) if is_white else own.pixels, alpha=alpha)
