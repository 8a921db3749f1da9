"""What to render, and through which backend."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

Backend = Literal["rtl", "model", "reference"]
BACKENDS: tuple[Backend, ...] = get_args(Backend)


@dataclass(frozen=True)
class RenderRequest:
    """One frame of a scene, or the frames of its motion.

    Attributes:
        scene: TOML file.
        config: Preset, path, or precision such as ``32b32s64d``.
        overrides: Changes of the configuration, ``key=value``.
        backend: The generated hardware in a simulator, its bit-exact model, or the unquantised scene.
        size: (width, height), pixels; the scene's where None.
        frames: How many, from 1: the first is the scene as it stands.
        mesh: Replaces the scene's mesh: a name or a file.
        background: The folder of a room, in place of the scene's background.
        hits: The hit triangles are wanted: the hardware must be configured to deliver them.
        relit: Show the room in the scene's lights even if there is a photo of it.
        waveform: A VCD file for the hardware's signals during the frame; of the RTL, one small frame.
    """

    scene: Path
    config: str
    overrides: Sequence[str] = ()
    backend: Backend = "rtl"
    size: tuple[int, int] | None = None
    frames: int = 1
    mesh: str | None = None
    background: Path | None = None
    hits: bool = False
    relit: bool = False
    waveform: Path | None = None
