"""An environment with its encoded maps, the contents of the physical-attribute memory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.design.manifest import Manifest
from colonnade.environment.model import Environment
from colonnade.maps.cache import encoded_environment
from colonnade.maps.encoders import Encoder
from colonnade.maps.image import AttributeImage
from colonnade.maps.layout import AttributeLayout
from colonnade.maps.planes import PlaneProjection

#: Encodes the maps of a room.
Encode = Callable[[Environment], AttributeImage]


@dataclass(frozen=True, eq=False)
class EncodedEnvironment:
    """An environment and its encoded maps; compared by identity."""

    environment: Environment
    image: AttributeImage

    @cached_property
    def depth(self) -> Floats:
        """Depth as the device decodes it, metres along z: float64 [height, width]."""
        return self.image.decoded_depth(PlaneProjection.of(self.environment, self.image.depth_unit))

    @staticmethod
    def of(environment: Environment, manifest: Manifest, encoder: Encoder | Encode | None = None) -> EncodedEnvironment:
        """Encode a room's maps for a design; a function is one that encodes a room.

        Raises:
            UserError: The design has no memory for maps of this size.
        """
        check_layout(environment, manifest)
        if callable(encoder):
            return EncodedEnvironment(environment, encoder(environment))
        return EncodedEnvironment(environment, encoded_environment(environment, layout_of(manifest), encoder=encoder))


def check_layout(environment: Environment, manifest: Manifest) -> None:
    """Check that a design can hold maps of a room's size.

    Raises:
        UserError: It cannot.
    """
    layout = layout_of(manifest)
    if (environment.width, environment.height) != (layout.width, layout.height):
        raise UserError(
            f"the maps of room {environment.name} are {environment.width}x{environment.height},"
            f" physicalAttributeMemory holds {layout.width}x{layout.height}: set its width and height"
        )


def layout_of(manifest: Manifest) -> AttributeLayout:
    """The layout of a design's physical-attribute memory.

    Raises:
        UserError: The design has no such memory.
    """
    sizes = manifest.config["physicalAttributeMemory"]
    if sizes is None:
        raise UserError("the hardware has no memory for a room: set physicalAttributeMemory, as in the preset small")
    return AttributeLayout.from_config(sizes)
