"""The designs of the page, their view files, and recordings of their RTL."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from colonnade.design.manifest import Manifest
from colonnade.mesh.load import load_mesh
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared.device_scene import DeviceScene

ROOT = Path(__file__).resolve().parents[2]
DESIGNS = ("small", "edge", "lean", "tiny")
#: What record.py writes.
RECORDINGS = ROOT / "site" / "cycles.json"
#: Its view file is every mesh's, but for the registers that the page sets: its edge is the cube's.
SCENE, MESH, SIZE = "object.toml", "cube", (640, 480)


def view_file(manifest: Manifest) -> bytes:
    """The view file of a cube for a design."""
    scene = load_scene(ROOT / "scenes" / SCENE)
    return DeviceScene.of(scene, manifest, load_mesh(MESH), size=SIZE).view_file(SIZE)


def recorded(manifests: Mapping[str, Any]) -> dict[str, Any]:
    """The recordings of designs that are today's, by name."""
    recordings = json.loads(RECORDINGS.read_text(encoding="utf-8"))
    found = {}
    for name, recording in recordings.items():
        if recording["formatHash"] == manifests[name]["formatHash"]:
            found[name] = {key: value for key, value in recording.items() if key != "formatHash"}
        else:
            print(f"colonnade: the recorded cycles of {name} are of another design: run tools/browser/record.py")
    return found
