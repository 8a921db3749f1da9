"""Reads the textures of a mesh, one picture after the other, within bounds of pixels and memory."""

from __future__ import annotations

from colonnade.common.errors import UserError
from colonnade.common.image_io import (
    FORMATS,
    TARGA,
    TooManyPixels,
    UnknownFormat,
    alpha_pixels,
    opened_bytes,
    rgb_pixels,
)
from colonnade.common.limits import KEPT_TEXTURE_PIXELS, MAX_TEXTURE_PIXELS
from colonnade.mesh import losses as lost
from colonnade.mesh.losses import Losses
from colonnade.mesh.materials.texture import Texture, Wrap


class TextureReader:
    """The textures of a mesh.

    When more than `KEPT_TEXTURE_PIXELS` have been read, all of them are halved along each axis, and so are all later
    ones. Each texel of the texture memory still has many pixels.

    Attributes:
        textures: Those read so far.
    """

    def __init__(self, losses: Losses) -> None:
        self._losses = losses
        self._pixels, self._halvings = 0, 0
        self.textures: list[Texture] = []

    def read(self, data: bytes, name: str, wrap: tuple[Wrap, Wrap], is_nearest: bool = False) -> int | None:
        """Add the texture of a picture's bytes: its index in `textures`; None, and a loss, if it is not readable.

        Raises:
            UserError: The textures have more than `MAX_TEXTURE_PIXELS`.
        """
        formats = [*FORMATS, TARGA] if name.lower().endswith(".tga") else FORMATS
        refused = UserError(
            f"its textures have more than {MAX_TEXTURE_PIXELS:,} pixels, the most of a mesh: make them smaller"
        )
        try:
            with opened_bytes(data, name, formats) as picture:
                self._pixels += picture.width * picture.height
                if self._pixels > MAX_TEXTURE_PIXELS:
                    raise refused
                texture = Texture(name, rgb_pixels(picture), wrap, alpha_pixels(picture), is_nearest)
        except UserError as error:
            if error is refused:
                raise
            kinds = {UnknownFormat: lost.PICTURE_FORMATS, TooManyPixels: lost.LARGE_PICTURES}
            self._losses.add(kinds.get(type(error), lost.DAMAGED_PICTURES), name=name)
            return None
        for _ in range(self._halvings):
            texture = texture.halved()
        self.textures.append(texture)
        while sum(one.size[0] * one.size[1] for one in self.textures) > KEPT_TEXTURE_PIXELS:
            self._halvings += 1
            for number, one in enumerate(self.textures):
                self.textures[number] = one.halved()
        return len(self.textures) - 1

    def count_losses(self) -> None:
        """Count the textures that were halved, after the last one."""
        self._losses.add(lost.shrunk_textures(1 << self._halvings), len(self.textures) if self._halvings else 0)
