"""Writes a camera into a scene file, whose other lines stay as they are."""

from __future__ import annotations

import math
from collections.abc import Callable, MutableMapping, Sequence
from pathlib import Path

import tomlkit
from tomlkit.exceptions import TOMLKitError

from colonnade.common.atomic_files import replacing
from colonnade.common.errors import UserError
from colonnade.common.input_files import read_input
from colonnade.common.toml_files import parse_toml
from colonnade.scene.model import Scene
from colonnade.scene.parser import scene_of

#: Digits of the distance from camera to target that are kept: a tenth of a millimetre of some metres.
_DIGITS = 5


def save_camera(file: Path, position: Sequence[float], target: Sequence[float], check: Callable[[Scene], None]) -> None:
    """Set ``camera.position`` and ``camera.target`` of a scene file; what frames the object instead leaves it.

    Args:
        file: The scene file.
        position: World position, 3 numbers; it is rounded by its distance from the target.
        target: World point at the picture's centre, 3 numbers; it is rounded likewise.
        check: Raises a `UserError` if the scene with this camera cannot be shown. The file then stays as it is.

    Raises:
        UserError: The file cannot be read or replaced, or has another camera that forbids this one.
    """
    data = read_input(file, "the scene")
    parse_toml(data, f"scene {file}")
    try:
        document = tomlkit.parse(data.decode("utf-8-sig"))
    except TOMLKitError as error:
        raise UserError(f"scene {file} is not TOML: {error}") from None
    if "camera" not in document:
        document["camera"] = tomlkit.table()
    camera = document["camera"]
    if not isinstance(camera, MutableMapping):
        raise UserError(f"scene {file}: camera must be a table: [camera]")
    for name in ("direction", "framing"):
        if name in camera:
            del camera[name]
    distance = math.dist(position, target) or 1.0
    digits = _DIGITS - 1 - math.floor(math.log10(distance))
    for name, values in (("position", position), ("target", target)):
        camera[name] = [round(float(value), digits) + 0.0 for value in values]
    check(scene_of(document.unwrap(), f"scene {file}", file.parent))
    with replacing(file, is_edited=True) as stream:
        stream.write(tomlkit.dumps(document).encode("utf-8"))
