"""A room's maps by the encoder of a moving camera: in less than a second, where the offline encoder needs 20."""

from __future__ import annotations

from pathlib import Path

from colonnade.design.manifest import Manifest
from colonnade.environment.load import load_environment
from colonnade.maps.encoded import EncodedEnvironment


def live_maps(room: Path, manifest: Manifest) -> EncodedEnvironment:
    """The maps of the room in a folder, for a design."""
    return EncodedEnvironment.of(load_environment(room), manifest, "live")
