"""The render request: scene, backend, configuration and options."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from colonnade.common.arguments import check_types
from colonnade.common.errors import UserError
from colonnade.common.frame_size import Size
from colonnade.common.limits import MAX_FRAMES, MAX_SAMPLES
from colonnade.common.types import Floats
from colonnade.design.config_name import Overrides
from colonnade.environment.sequence import Sequence as RoomSequence
from colonnade.maps.encoders import Encoder
from colonnade.mesh.materials.mesh import Mesh
from colonnade.scene.model import Denoiser, Scene

Backend = Literal["rtl", "model", "reference"]


@dataclass(frozen=True)
class RenderRequest:
    """A request for one frame of a scene, or for the frames of its motion.

    Attributes:
        scene: A scene, or its file, TOML or a mesh.
        config: Preset, path, or precision such as ``32b32s64d``.
        overrides: Changes to the configuration, ``key=value``.
        backend: ``rtl``: the generated Verilog in a simulator; ``model``: its bit-exact model; ``reference``: Embree.
        size: (width, height), pixels; None: the scene's.
        frames: Number of frames, from 1. The first shows the scene at rest. Of a sequence its first ones.
        samples: Samples of a pixel, from 1; None: the scene's, or a default.
        mesh: A mesh that replaces the scene's, or its name or file.
        simplify: Number of triangles to which a named mesh of more is simplified; None: the scene's.
        background: Folder of a room that replaces the scene's background.
        animation: Name or number of an animation in place of the scene file's.
        sequence: Views of a room, one for each frame, which replace the scene's background and motion.
        keyframes: Of a sequence, every so many frames have maps; None: as its file says.
        hits: Whether the caller needs hit triangles; the configuration must then have them.
        relit: Whether the scene's lights shade the room even if it has a photo.
        truth: Mesh file of the room's real geometry, in its world space; for the reference.
        waveform: VCD file for the signals of one small RTL frame.
        encoder: Of the room's maps and of textures; None: as `Encoder` says.
        denoise: Filter the noise of gathered light, of the model and the RTL, as `FrameSize.denoise`; None: as there.
        preview: Takes the picture of the first of several samples, linear, float64 [height, width, 3], not filtered,
            before the other samples are traced; of a single frame by the model or the RTL.

    Raises:
        UserError: A value is none of these.
    """

    scene: Path | Scene
    config: str
    overrides: Overrides = ()
    backend: Backend = "rtl"
    size: Size | None = None
    frames: int = 1
    samples: int | None = None
    mesh: str | Mesh | None = None
    simplify: int | None = None
    background: Path | None = None
    animation: str | None = None
    sequence: RoomSequence | None = None
    keyframes: int | None = None
    hits: bool = False
    relit: bool = False
    truth: Path | None = None
    waveform: Path | None = None
    encoder: Encoder | None = None
    denoise: bool | Denoiser | None = None
    preview: Callable[[Floats], None] | None = None

    def __post_init__(self) -> None:
        check_types(vars(self), type(self))
        for name, maximum in (("frames", MAX_FRAMES), ("samples", MAX_SAMPLES)):
            count = getattr(self, name)
            if count is not None and not 1 <= count <= maximum:
                raise UserError(f"{name} is {count!r}: it must be a whole number from 1 to {maximum:,}")
