"""The physical-attribute memory's contents: a room's maps, clustered to fit on chip."""

from colonnade.attributes.cache import encoded_room
from colonnade.attributes.image import AttributeImage, encode_room
from colonnade.attributes.layout import AttributeLayout

__all__ = ["AttributeImage", "AttributeLayout", "encode_room", "encoded_room"]
