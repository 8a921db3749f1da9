"""The real room that a virtual object stands in: its maps, seen from one camera."""

from colonnade.room.load import load_room
from colonnade.room.room import Room

__all__ = ["Room", "load_room"]
