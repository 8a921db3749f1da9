"""The cycle model against the RTL where marches take most of the time."""

from __future__ import annotations

import json

from colonnade.design.generator import manifest_for
from colonnade.design.toolchain import project_root
from colonnade.device.cycle_model import NotedFrame

from colonnade_lab.evaluation.room_frames import room_frames


def test_a_room_with_glass_takes_the_cycles_of_the_rtl() -> None:
    """Its paths march several times, while directly seen pixels ask the same maps for their cells."""
    recorded = json.loads((project_root() / "docs" / "data" / "rooms.json").read_text())["result"]
    manifest = manifest_for("edge").manifest
    size = (recorded["size"][0], recorded["size"][1])
    (frame,) = (one for one in room_frames(manifest, size, objects=("teapot, glass",)) if one.room == "office")
    (rtl,) = (one["cycles"] for one in recorded["frames"] if (one["room"], one["object"]) == (frame.room, frame.name))
    found = NotedFrame.of(manifest, frame.image, frame.registers).cycles(manifest)["cycles"]
    assert abs(found / rtl - 1.0) < 0.03
