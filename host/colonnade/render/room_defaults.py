"""What a frame in the photo of a room has where the scene leaves it open: gathered light, and the filter of noise."""

from __future__ import annotations

from dataclasses import replace

from colonnade.common import notes
from colonnade.design.manifest import Manifest
from colonnade.environment.load import has_photo
from colonnade.scene.model import Scene


def with_room_defaults(
    scene: Scene, config: str, manifest: Manifest, in_sequence: bool = False
) -> tuple[Scene, str | None]:
    """The scene with gathered light and its filter, and a line that names them; itself where it does not leave it open.

    Args:
        scene: The scene.
        config: The name of the design.
        manifest: The design's manifest; a design that gathers no light changes nothing.
        in_sequence: Its room is a view of a sequence, which has photos.
    """
    if not (manifest.gathers and _is_open(scene, in_sequence)):
        return scene, None
    denoise = scene.frame.denoise
    if denoise is None and manifest.config["frame"]["hits"]:
        denoise = True
    gathering = replace(scene, paths=replace(scene.paths, gather=1), frame=replace(scene.frame, denoise=denoise))
    filtered, keys = (" and noise filtered", ", --denoise") if denoise else ("", "")
    return gathering, f"light gathered{filtered} by {config} (paths.gather{keys})"


def tell_without_defaults(scene: Scene, config: str, manifest: Manifest) -> None:
    """Tell that a packed scene does not gather light where `with_room_defaults` does."""
    if manifest.gathers and _is_open(scene, False):
        line = f"the packed scene does not gather the room's light, as colonnade render does by {config}"
        notes.tell(f"{line}: set paths.gather = 1")


def _is_open(scene: Scene, in_sequence: bool) -> bool:
    """Whether the scene is in the photo of a room, which it reflects, and does not say whether it gathers light."""
    room = scene.background.room
    if scene.names_gather or room is None or scene.background.colours == "albedo":
        return False
    return in_sequence or has_photo(room)
