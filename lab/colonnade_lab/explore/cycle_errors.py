"""The cycle model against the recorded cycles of the RTL (docs/cycles.md)."""

from __future__ import annotations

import json
import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.design.toolchain import project_root
from colonnade.device.cycle_model import NotedFrame, knows_design
from colonnade.scene.model import Scene
from colonnade.scene.parser import load_scene
from colonnade.scene.prepared.device_scene import DeviceScene

from colonnade_lab.evaluation.room_frames import room_frames
from colonnade_lab.explore.frames import Frame
from colonnade_lab.explore.plan import picture_facts
from colonnade_lab.explore.points import manifests_of, points_of
from colonnade_lab.explore.study_file import load_study
from colonnade_lab.explore.workload import frames_of


@dataclass(frozen=True)
class CountedFrame:
    """Cycles of a frame by the model and by the RTL."""

    design: str
    name: str
    model: int
    rtl: int

    @property
    def error(self) -> float:
        """The model's, relative to the RTL."""
        return self.model / self.rtl - 1.0

    def as_json(self) -> dict[str, Any]:
        """The frame as values that JSON can hold."""
        return asdict(self)


def mean_and_worst(errors: Sequence[float]) -> tuple[float, float]:
    """The mean of the magnitudes, and the largest error with its sign."""
    return statistics.fmean(map(abs, errors)), max(errors, key=abs)


def _recorded(name: str) -> Any:
    return json.loads((project_root() / "docs" / "data" / f"{name}.json").read_text())["result"]


def _noted(scene: Scene, config: str, overrides: Sequence[str], size: tuple[int, int]) -> NotedFrame:
    manifest = manifest_for(config, overrides).manifest
    prepared = DeviceScene.of(scene.with_samples(1), manifest, size=size)
    return NotedFrame.of(manifest, prepared.image, prepared.registers(size))


def _benchmark() -> Scene:
    return load_scene(project_root() / "scenes" / "object.toml")


def _bench(preset: str, mirror: bool = False) -> Iterator[CountedFrame]:
    """Frames of `colonnade bench`; of a preset with figures of two meshes also those of the others."""
    report, others = _recorded(f"bench-{preset}"), _recorded("bench-others").get(preset, {"meshes": {}})
    manifest = manifest_for(preset).manifest
    size = (report["size"][0], report["size"][1])
    for name, mesh in ((report["mirror"] if mirror else report)["meshes"] | others["meshes"]).items():
        scene = _benchmark().with_mesh(name)
        if mirror:
            scene = replace(
                scene, material=replace(scene.material, kind="mirror"), paths=replace(scene.paths, bounces=1)
            )
        cycles = _noted(scene, preset, (), size).cycles(manifest)["cycles"]
        yield CountedFrame(f"{preset}, mirrors" if mirror else preset, name, cycles, mesh["cycles"])


def _study(name: str) -> Iterator[CountedFrame]:
    """Frames of a study, on designs that the cycle model knows. Frames of equal work are rendered once."""
    recorded = {point["name"]: point["workloads"] for point in _recorded(name)["points"]}
    file = load_study(project_root() / "scenes" / "studies" / f"{name}.toml")
    points, size = points_of(file), file.study.workload.size
    manifests = manifests_of(file, points)
    for frame in frames_of(file):
        noted: dict[str, NotedFrame] = {}
        for point in points:
            manifest, rtl = manifests[point.name], recorded[point.name].get(frame.name, {}).get("cycles")
            if rtl is None or not knows_design(manifest):
                continue
            own = frame.with_children(point.children)
            work = json.dumps([own.identity, picture_facts(manifest)])
            if work not in noted:
                noted[work] = _noted_of(own, manifest, size)
            yield CountedFrame(point.name, frame.name, noted[work].cycles(manifest)["cycles"], rtl)


def _noted_of(frame: Frame, manifest: Manifest, size: tuple[int, int]) -> NotedFrame:
    prepared = DeviceScene.of(frame.scene.with_samples(1), manifest, frame.mesh, size=size)
    return NotedFrame.of(manifest, prepared.image, prepared.registers(size))


def _rooms() -> Iterator[CountedFrame]:
    """Frames of tools/room-frames."""
    report, manifest = _recorded("rooms"), manifest_for("edge").manifest
    size = (report["size"][0], report["size"][1])
    for frame, recorded in zip(room_frames(manifest, size), report["frames"], strict=True):
        assert (frame.room, frame.name) == (recorded["room"], recorded["object"])
        cycles = NotedFrame.of(manifest, frame.image, frame.registers).cycles(manifest)["cycles"]
        yield CountedFrame("edge, rooms", f"{frame.room}, {frame.name}", cycles, recorded["cycles"])


def _gather() -> Iterator[CountedFrame]:
    """Passes that gather light."""
    report, manifest = _recorded("gather"), manifest_for("edge").manifest
    scene = load_scene(project_root() / "scenes" / "gathered.toml").with_samples(1)
    for part, relit in (("pass", False), ("whole", True)):
        size = (report[part]["size"][0], report[part]["size"][1])
        prepared = DeviceScene.of(scene, manifest, size=size, relit=relit)
        noted = NotedFrame.of(manifest, prepared.image, prepared.registers(size, composited=not relit))
        yield CountedFrame("edge, gathered light", part, noted.cycles(manifest)["cycles"], report[part]["cycles"])


#: Frames by the part of docs/data that they are from.
PARTS: Mapping[str, Callable[[], Iterator[CountedFrame]]] = {
    "edge": lambda: _bench("edge"),
    "mirrors": lambda: _bench("edge", mirror=True),
    "lean": lambda: _bench("lean"),
    "small": lambda: _bench("small"),
    "tiny": lambda: _bench("tiny"),
    "scaling": lambda: _study("scaling"),
    "ablation": lambda: _study("ablation"),
    "features": lambda: _study("features"),
    "precisions": lambda: _study("energy-area"),
    "trees": lambda: _study("bvh-cycles"),
    "rooms": _rooms,
    "gather": _gather,
}
