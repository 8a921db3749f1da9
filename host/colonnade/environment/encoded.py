"""An environment together with its maps as the physical-attribute memory holds them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from colonnade.common.errors import UserError
from colonnade.design.manifest import Manifest
from colonnade.environment.encoding.cache import encoded_environment
from colonnade.environment.encoding.image import AttributeImage
from colonnade.environment.encoding.layout import AttributeLayout
from colonnade.environment.load import load_environment
from colonnade.environment.model import Environment


@dataclass(frozen=True)
class EncodedEnvironment:
    """A room, and its maps as the physical-attribute memory holds them."""

    environment: Environment
    image: AttributeImage

    @staticmethod
    def load(folder: Path, manifest: Manifest) -> EncodedEnvironment:
        """A room's folder, for the hardware of a manifest.

        Raises:
            UserError: The folder is no room, the hardware holds none, or maps of another size.
        """
        layout, environment = layout_of(manifest), load_environment(folder)
        if (environment.width, environment.height) != (layout.width, layout.height):
            raise UserError(
                f"the maps of {folder} are {environment.width}x{environment.height}, physicalAttributeMemory holds"
                f" {layout.width}x{layout.height}: set its width and height"
            )
        return EncodedEnvironment(environment, encoded_environment(environment, layout))


def layout_of(manifest: Manifest) -> AttributeLayout:
    """What the hardware's physical-attribute memory holds.

    Raises:
        UserError: It has none.
    """
    sizes = manifest.config["physicalAttributeMemory"]
    if sizes is None:
        raise UserError("the hardware has no memory for a room: set physicalAttributeMemory, as in the preset small")
    return AttributeLayout.from_config(sizes)
