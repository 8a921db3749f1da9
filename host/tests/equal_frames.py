"""Frames of the RTL equal the bit-exact model's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from colonnade.common.framebuffer import Frame
from colonnade.design.generator import GeneratedDesign
from colonnade.device.bit_exact import render_model
from colonnade.device.verilator import Stalls, render_rtl
from colonnade.scene_image.file import SceneImage

_LIMITS = ("frame.maxBounces=4", "frame.lights=2")
#: Limits of the frames, and banks that can be stalled.
HELD = ("columnBvhMemory.holdable=true", *_LIMITS)
#: Beside `tiny`: three units, sequential parts.
HOLDABLE = ("array.rows=3", *HELD)
#: Beside `tiny`: the narrowest arithmetic.
NARROW = ("precision=16b16s32d", "geometry.triangleBits=null", *_LIMITS)
#: Beside `tiny`: three units, two of which share two triangle units, pipelines for all rays of a column, and instances.
PIPELINED = (
    *("array.rows=3", "units.pathContexts=24", "units.rayInterval=1", "units.shadeInterval=3"),
    *("units.triangleRows=2", "units.triangleLanes=2", "frame.instances=8", *HELD),
)
#: Beside `small`: one column without maps of a room, with gathered light, textures, colours and emission.
ALONE = ("physicalAttributeMemory=null", "array.columns=1")
#: Beside `small`, for frames in a room, so that their tests have one simulator: pipelines, two marches of maps that two
#: columns share.
IN_ROOM = (
    *("array.rows=3", "units.pathContexts=24", "units.rayInterval=1", "units.shadeInterval=3"),
    *("units.marches=2", "physicalAttributeMemory.columnsPerCopy=2"),
)


def assert_equal(rtl: Frame, model: Frame) -> None:
    """Neither has errors; pixels, hits and the counters that do not depend on timing are the same."""
    assert rtl.errors == model.errors == []
    np.testing.assert_array_equal(rtl.colour, model.colour)
    np.testing.assert_array_equal(rtl.ratio, model.ratio)
    np.testing.assert_array_equal(rtl.triangle, model.triangle)
    np.testing.assert_array_equal(rtl.instance, model.instance)
    np.testing.assert_array_equal(rtl.distance, model.distance)
    assert {name: rtl.counters[name] for name in model.counters} == model.counters


def equal_frames(
    design: GeneratedDesign, image: SceneImage, registers: Sequence[Mapping[str, int]], stalls: Stalls
) -> list[Frame]:
    """The frames of the RTL, each of which equals the model's."""
    frames = list(render_rtl(design, image, list(registers), stalls).frames)
    for frame, settings in zip(frames, registers, strict=True):
        assert_equal(frame, render_model(design.manifest, image, settings))
    return frames
