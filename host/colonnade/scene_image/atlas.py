"""The atlas: the base-colour textures of a mesh in one square picture, for the texture memory (docs/textures.md).

Each textured material has a region of the atlas: the part of its texture that faces use, with repeats, resampled and
multiplied by the material's albedo. Regions begin at tiles and share one scale. Where there is space it is above 1, and
small regions are enlarged further: a tile holds two or four colours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.mesh.materials.materials import MeshMaterial
from colonnade.mesh.materials.mesh import Mesh
from colonnade.mesh.materials.texture import Texture

#: Edge of a tile, texels.
TILE = 16
#: Samples of the texture along each axis of a texel, at most.
_MAX_SAMPLES = 8
#: Samples that are taken at a time.
_SAMPLES = 1 << 16
#: Texels around the faces that count as shown: texture coordinates are rounded.
_MARGIN = 2
#: Scales that are tried first. Above 1 the filter of the texture smooths it, and a tile holds fewer colours.
_SCALES = (16.0, 8.0, 4.0, 2.0, 1.0)
#: Regions of fewer pixels along both axes are enlarged further, if the scale of the others stays so large.
_SMALL, _LEAST = 64, 0.9
#: Steps in the search for the scale.
_STEPS = 24


@dataclass(frozen=True)
class Region:
    """A material's part of the atlas.

    Attributes:
        low, high: The part of the texture, (u, v), float64 [2] each.
        corner: Its upper left texel.
        size: Its width and height, texels.
    """

    low: Floats
    high: Floats
    corner: tuple[int, int]
    size: tuple[int, int]


@dataclass(frozen=True)
class Atlas:
    """The atlas of a mesh.

    Attributes:
        colours: Linear, float64 [edge, edge, 3].
        uvs: Texture coordinates of the corners of the mesh's faces, texels from the upper left corner, 0 on faces
            without a texture, float64 [m, 3, 2].
        scale: Texels of the atlas for each pixel of a texture that is not enlarged, along an axis.
        source_bytes: Size of the textures, three bytes a pixel.
    """

    colours: Floats
    uvs: Floats
    scale: float
    source_bytes: int


def make_atlas(mesh: Mesh, materials: Sequence[MeshMaterial], headroom: float, edge: int) -> Atlas | None:
    """The atlas of the textured materials; None if there are none.

    Args:
        mesh: The mesh.
        materials: Its materials, in place of its own.
        headroom: Factor of the scene's lights, by which the colours of diffuse faces are darker.
        edge: Edge of the atlas, texels.

    Raises:
        UserError: There are more textured materials than tiles.
    """
    used = np.unique(mesh.face_materials)
    textured = [int(number) for number in used if materials[number].texture is not None]
    if mesh.corner_uvs is None or not textured:
        return None
    # Materials that differ in nothing but their surface share a region
    sharing: dict[tuple[int, tuple[float, ...]], list[int]] = {}
    for number in textured:
        index, albedo = materials[number].texture, np.array(materials[number].albedo)
        assert index is not None
        factor = albedo / (headroom if materials[number].kind == "diffuse" else 1.0)
        sharing.setdefault((index, tuple(factor.tolist())), []).append(number)
    parts = [np.isin(mesh.face_materials, numbers) for numbers in sharing.values()]
    textures = [mesh.textures[index] for index, _ in sharing]
    unwrapped = [_unwrapped(mesh.corner_uvs[part], texture) for part, texture in zip(parts, textures, strict=True)]
    lows = [uvs.min(axis=(0, 1)) for uvs in unwrapped]
    highs = [
        np.maximum(uvs.max(axis=(0, 1)), low + 1.0 / np.array(texture.size))
        for uvs, low, texture in zip(unwrapped, lows, textures, strict=True)
    ]
    pixels = [(high - low) * texture.size for high, low, texture in zip(highs, lows, textures, strict=True)]
    if len(sharing) > (edge // TILE) ** 2:
        raise UserError(
            f"mesh {mesh.name} has {len(sharing):,} textured materials: use at most {(edge // TILE) ** 2:,}"
        )
    scale, corners, gains = _enlarged(np.array(pixels), edge)
    colours = np.zeros((edge, edge, 3))
    uvs = np.zeros_like(mesh.corner_uvs)
    for index, (_, colour) in enumerate(sharing):
        size = _size(pixels[index] * gains[index] * scale, edge)
        region = Region(lows[index], highs[index], corners[index], (int(size[0]), int(size[1])))
        tile = _resampled(textures[index], region, pixels[index]) * np.array(colour)
        (x, y), (width, height) = region.corner, region.size
        right, bottom = x + _tiles(width), y + _tiles(height)
        padding = ((0, bottom - y - height), (0, right - x - width), (0, 0))
        colours[y:bottom, x:right] = np.pad(tile, padding, mode="edge")
        share = (unwrapped[index] - region.low) / (region.high - region.low)
        uvs[parts[index]] = np.array(region.corner) + share * region.size
    is_textured = np.isin(mesh.face_materials, textured)
    colours = _simplified(colours, _covered(uvs[is_textured], edge))
    sources = {id(texture): 3 * texture.size[0] * texture.size[1] for texture in textures}
    return Atlas(colours, uvs, scale, sum(sources.values()))


def uv_codes(atlas: Atlas, fraction_bits: int) -> npt.NDArray[np.int64]:
    """The texture coordinates of an atlas as the hardware holds them, int64 [m, 3, 2]: texels with fraction bits."""
    largest = (len(atlas.colours) << fraction_bits) - 1
    return np.clip(np.rint(atlas.uvs * (1 << fraction_bits)), 0, largest).astype(np.int64)


def _unwrapped(uvs: Floats, texture: Texture) -> Floats:
    """Positions of the corners of faces, float64 [k, 3, 2], moved by whole periods so that they cover a small part."""
    moved = uvs.copy()
    for axis, wrap in enumerate(texture.wrap):
        if wrap == "clamp":
            continue
        period = 1.0 if wrap == "repeat" else 2.0
        along = uvs[..., axis]
        each = along - period * np.floor(along.min(axis=1, keepdims=True) / period)
        whole = along - period * np.floor(along.min() / period)
        moved[..., axis] = each if np.ptp(each) < np.ptp(whole) else whole
    return moved


def _covered(uvs: Floats, edge: int) -> npt.NDArray[np.bool_]:
    """The texels that faces with such texture coordinates, [k, 3, 2], show, with a margin, bool [edge, edge]."""
    from PIL import Image, ImageDraw
    from scipy.ndimage import binary_dilation

    mask = Image.new("1", (edge, edge))
    draw = ImageDraw.Draw(mask)
    for corners in uvs.reshape(-1, 6).tolist():
        draw.polygon(corners, fill=1)
        draw.line([*corners, *corners[:2]], fill=1)  # a polygon of less than a texel has gaps, with or without outline
    covered: npt.NDArray[np.bool_] = binary_dilation(np.asarray(mask), np.ones((3, 3)), _MARGIN)
    return covered


def _simplified(colours: Floats, covered: npt.NDArray[np.bool_]) -> Floats:
    """The atlas with simple colours where no face shows them, so that the encoder spends no bytes there.

    A texel takes the colour of the nearest covered one; tiles without any take the mean colour.
    """
    from scipy.ndimage import distance_transform_edt

    rows, columns = distance_transform_edt(~covered, return_distances=False, return_indices=True)
    count = len(colours) // TILE
    is_used = covered.reshape(count, TILE, count, TILE).any(axis=(1, 3)).repeat(TILE, axis=0).repeat(TILE, axis=1)
    found: Floats = np.where(is_used[..., None], colours[rows, columns], colours[covered].mean(axis=0))
    return found


def _tiles(length: int) -> int:
    """A length rounded up to whole tiles."""
    return -(-length // TILE) * TILE


def _size(pixels: Floats, edge: int) -> npt.NDArray[np.int64]:
    """Whole texels of a region, at least one and at most the atlas along each axis."""
    return np.clip(np.ceil(pixels - 1e-6), 1, edge).astype(np.int64)


def _enlarged(pixels: Floats, edge: int) -> tuple[float, list[tuple[int, int]], Floats]:
    """As `_placed`, with small regions enlarged where that costs the others little, and by how much each is."""
    scale, corners = _placed(pixels, edge)
    is_small = (pixels <= _SMALL).all(axis=1)
    for whole in _SCALES if is_small.any() else ():
        gains = np.where(is_small, max(whole / scale, 1.0), 1.0)
        found, places = _placed(pixels * gains[:, None], edge)
        if found >= _LEAST * scale:
            return found, places, gains
    return scale, corners, np.ones(len(pixels))


def _placed(pixels: Floats, edge: int) -> tuple[float, list[tuple[int, int]]]:
    """The largest of scales up to `_SCALES` at which regions of pixels, float64 [n, 2], fit; and their corners."""
    low, high, best = 0.0, 1.0, _shelves(pixels * 0.0, edge)
    for whole in _SCALES:
        corners = _shelves(pixels * whole, edge)
        if corners is not None:
            low, high, best = whole, 2 * whole, corners
            break
    for _ in range(_STEPS if low < _SCALES[0] else 0):
        middle = (low + high) / 2
        corners = _shelves(pixels * middle, edge)
        if corners is None:
            high = middle
        else:
            low, best = middle, corners
    assert best is not None, "a tile for each region"
    return low, best


def _shelves(pixels: Floats, edge: int) -> list[tuple[int, int]] | None:
    """Corners of regions in rows, the highest first; None if they do not fit."""
    if (pixels > edge + 1e-6).any():
        return None
    sizes = [(_tiles(int(width)), _tiles(int(height))) for width, height in (_size(row, edge) for row in pixels)]
    corners = [(0, 0)] * len(sizes)
    x, y, shelf = 0, 0, 0
    for index in sorted(range(len(sizes)), key=lambda index: (-sizes[index][1], -sizes[index][0])):
        width, height = sizes[index]
        if x + width > edge:
            x, y, shelf = 0, y + shelf, 0
        if y + height > edge:
            return None
        corners[index] = (x, y)
        x, shelf = x + width, max(shelf, height)
    return corners


def _resampled(texture: Texture, region: Region, pixels: Floats) -> Floats:
    """The linear colours of a region, float64 [height, width, 3]: means of samples of the texture."""
    width, height = region.size
    samples = int(np.clip(np.ceil(max(pixels / region.size)), 1, _MAX_SAMPLES))
    along = [(np.arange(length * samples) + 0.5) / samples / length for length in region.size]
    u, v = (low + at * (high - low) for low, high, at in zip(region.low, region.high, along, strict=True))
    grid = np.zeros((height, width, 3))
    rows = max(1, _SAMPLES // (len(u) * samples))
    for first in range(0, height, rows):
        band = grid[first : first + rows]
        at = np.stack(np.meshgrid(u, v[first * samples : (first + len(band)) * samples]), axis=-1).reshape(-1, 2)
        colours = texture.colours(at).reshape(len(band), samples, width, samples, 3)
        for down in range(samples):
            for right in range(samples):
                band += colours[:, down, :, right]
    return grid / samples**2
