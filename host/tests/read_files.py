"""Mesh files as host and browser tab read and pack them, side by side."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from built_page import MODULE, ROOT, run_node
from PIL import Image

from colonnade.common import notes
from colonnade.common.errors import UserError
from colonnade.common.image_io import FORMATS
from colonnade.design.manifest import Manifest
from colonnade.mesh.files.formats import read_surface
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared.device_scene import DeviceScene

#: Formats of the readers that both share.
SUFFIXES = (".obj", ".ply", ".stl", ".off")
SMALL = ROOT / "configs" / "golden" / "small.json"


@dataclass(frozen=True)
class Reading:
    """What one reader makes of a file: a refusal, or digests of the packed image, and the notes of the file."""

    refusal: str | None
    image: dict[str, str]
    notes: tuple[str, ...] = ()
    triangles: int = 0


def by_host(file: Path, folder: Path) -> Reading:
    """The reading of the host, whose scene is written into a folder; without the path in its words."""
    (folder / "scene.toml").write_text(f"[mesh]\npath = {json.dumps(str(file))}\n")
    try:
        with notes.opened(lambda _: None), np.errstate(all="ignore"):
            scene = DeviceScene.of(load_scene(folder / "scene.toml"), Manifest.load(SMALL), encoder="live")
            found = read_surface(file)
    except UserError as error:
        return Reading(str(error).replace(f"{file.parent}/", ""), {})
    image = {one.memory: one.words.tobytes() for one in scene.image.attributes if one.memory.startswith("texture.")}
    image["records"] = scene.image.records.tobytes()
    digests = {name: hashlib.sha256(words).hexdigest() for name, words in image.items()}
    return Reading(None, digests, found.losses.lines(), len(found.surface.faces))


def by_tab(files: Sequence[Path], folder: Path, has_others: bool = True) -> list[Reading]:
    """The readings of the tab; its pictures are decoded by Pillow."""
    of_files = [{"path": str(file), "folder": str(file.parent) if has_others else None} for file in files]
    job = {"module": str(MODULE), "manifest": json.loads(SMALL.read_text()), "files": of_files}
    run_node("files.mjs", folder, job)
    pictures = list(folder.glob("*.picture"))
    for picture in pictures:
        found: dict[str, Any] = {"width": 0}
        try:
            with Image.open(picture, formats=[*FORMATS]) as opened:
                rgba = np.asarray(opened.convert("RGBA"))
            rgba.tofile(picture.with_suffix(".bin"))
            found = {"width": rgba.shape[1], "height": rgba.shape[0], "hasAlpha": bool((rgba[..., 3] < 255).any())}
        except OSError:
            pass
        picture.with_suffix(".json").write_text(json.dumps(found))
    if pictures:
        run_node("files.mjs", folder, job)
    results = json.loads((folder / "result.json").read_text())
    return [_reading(results[str(file)]) for file in files]


def _reading(result: dict[str, Any]) -> Reading:
    if "error" in result:
        return Reading(result["error"], {})
    image = {**result["memories"], "records": result["records"]}
    return Reading(None, image, tuple(result["notes"]), result["triangles"])
