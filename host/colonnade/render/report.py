"""The report of a frame or of a sequence of frames, which ``--json`` writes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from colonnade.common.framebuffer import Frame
from colonnade.design.manifest import Manifest
from colonnade.scene_image.header import ImageHeader

#: Kinds of rays. ``in_box`` counts again rays that enter the object's bounding box.
RAY_KINDS = ("primary", "shadow", "reflection", "refraction")

#: Keys that all frames of a sequence share: its report has them once.
_COMMON = ("backend", "config", "mesh", "size", "samples", "bytes")


@dataclass(frozen=True)
class MeshReport:
    """The mesh of a frame, with its triangle counts after packing and in the source file."""

    name: str
    triangles: int
    source_triangles: int


@dataclass(frozen=True)
class EnvironmentReport:
    """The environment lookups of a frame in the RTL.

    Attributes:
        look_ups: Number of lookups.
        steps: Mean march steps per lookup.
        busy: Utilisation of a ray march, 0.0 to 1.0.
    """

    look_ups: int
    steps: float
    busy: float


@dataclass(frozen=True)
class FrameReport:
    """The report of a frame, or of all frames of a sequence. Counts and seconds are sums over the samples.

    Attributes:
        backend: rtl, model or reference.
        config: The configuration, as in the manifest.
        mesh: The mesh.
        size: Width and height, pixels.
        rays: Ray count by kind; None where the backend does not count it.
        cycles: Cycles of the RTL; None from other backends.
        counters: All counters of the device.
        errors: Names of the error bits that are set.
        room: Environment lookups; None without a room, and from backends that do not count cycles.
        share: Position along the scene's motion, 0.0 to 1.0.
        time: Of a sequence's frame, seconds.
        seconds: Seconds of packing, building the simulator, and rendering.
        simulated_cycles_per_second: Simulation speed of the RTL, by a CPU second.
        bytes: Sizes of the encoded maps.
        frames: Reports of a sequence's frames; empty in the report of one frame.
        samples: Samples of a pixel.
    """

    backend: str
    config: Mapping[str, Any]
    mesh: MeshReport
    size: tuple[int, int]
    rays: Mapping[str, int | None]
    cycles: int | None = None
    counters: Mapping[str, int] = field(default_factory=dict)
    errors: Sequence[str] = ()
    room: EnvironmentReport | None = None
    share: float | None = None
    time: float | None = None
    seconds: Mapping[str, float | None] = field(default_factory=dict)
    simulated_cycles_per_second: float | None = None
    bytes: Mapping[str, int] | None = None
    frames: tuple[FrameReport, ...] = ()
    samples: int = 1

    @property
    def cycles_per_sample(self) -> float | None:
        """Cycles of a pass over a frame."""
        return None if self.cycles is None else self.cycles / self.samples / max(len(self.frames), 1)

    @property
    def all_rays(self) -> int:
        """Number of rays of all kinds."""
        return sum(self.rays.get(kind) or 0 for kind in RAY_KINDS)

    @property
    def rays_per_cycle(self) -> float | None:
        """All rays per cycle, including rays that miss the object's bounding box."""
        return self.all_rays / self.cycles if self.cycles else None

    @property
    def rays_per_cycle_in_box(self) -> float | None:
        """Rays per cycle that enter the object's bounding box."""
        return (self.rays.get("in_box") or 0) / self.cycles if self.cycles else None

    def as_json(self) -> dict[str, Any]:
        """The report as values that JSON can hold."""
        values: dict[str, Any] = {
            "backend": self.backend,
            "config": self.config,
            "mesh": asdict(self.mesh),
            "size": list(self.size),
            "samples": self.samples,
            "cycles": self.cycles,
            "cycles_per_sample": self.cycles_per_sample,
            "rays": dict(self.rays),
            "rays_per_cycle": self.rays_per_cycle,
            "rays_per_cycle_in_box": self.rays_per_cycle_in_box,
        }
        if self.frames:
            values |= {"errors": list(self.errors), "seconds": dict(self.seconds)}
            of_frames = [frame.as_json() for frame in self.frames]
            values["frames"] = [
                {key: value for key, value in frame.items() if key not in _COMMON} for frame in of_frames
            ]
        else:
            values |= {"counters": dict(self.counters), "errors": list(self.errors)}
            values["room"] = None if self.room is None else asdict(self.room)
            optional = {
                "share": self.share,
                "time": self.time,
                "simulated_cycles_per_second": self.simulated_cycles_per_second,
                "seconds": dict(self.seconds) or None,
            }
            values |= {key: value for key, value in optional.items() if value is not None}
        return values if self.bytes is None else values | {"bytes": dict(self.bytes)}


def frame_report(backend: str, manifest: Manifest, header: ImageHeader, frame: Frame) -> FrameReport:
    """The report of a frame of the model or the RTL, without its seconds."""
    height, width = frame.is_object.shape
    return counted_report(backend, manifest, header, (width, height), frame.counters, frame.errors)


def counted_report(
    backend: str,
    manifest: Manifest,
    header: ImageHeader,
    size: tuple[int, int],
    counters: Mapping[str, int],
    errors: Sequence[str],
) -> FrameReport:
    """The report of a frame of which counters and error bits are known."""
    rays = {kind: counters[f"rays{kind.capitalize()}"] for kind in RAY_KINDS} | {"in_box": counters["raysInBox"]}
    return FrameReport(
        backend=backend,
        config=manifest.config,
        mesh=mesh_report(header),
        size=size,
        rays=rays,
        cycles=counters.get("cycles"),
        counters=counters,
        errors=errors,
        room=_environment_report(manifest, counters),
    )


def mesh_report(header: ImageHeader) -> MeshReport:
    """The mesh of a scene image."""
    return MeshReport(header.mesh, header.triangles, header.source_triangles)


def _environment_report(manifest: Manifest, counters: Mapping[str, int]) -> EnvironmentReport | None:
    look_ups, busy = counters.get("raysEnvironment", 0), counters.get("busyEnvironment")
    if look_ups == 0 or busy is None:
        return None
    marches = int(manifest.config["units"]["marches"]) * int(manifest.config["array"]["columns"])
    return EnvironmentReport(look_ups, counters["marchSteps"] / look_ups, busy / (marches * counters["cycles"]))


def sequence_report(frames: Sequence[FrameReport]) -> FrameReport:
    """The report of a sequence: sums over its frames."""
    first = frames[0]
    sums = {
        step: sum(frame.seconds[step] or 0.0 for frame in frames) for step in ("maps", "run") if step in first.seconds
    }
    return FrameReport(
        backend=first.backend,
        config=first.config,
        mesh=first.mesh,
        size=first.size,
        rays={kind: sum(frame.rays.get(kind) or 0 for frame in frames) for kind in first.rays},
        cycles=None if first.cycles is None else sum(frame.cycles or 0 for frame in frames),
        seconds=dict(first.seconds) | sums,
        bytes=first.bytes,
        frames=tuple(frames),
        samples=first.samples,
    )
