"""The measurements of a study. Each function fills a folder with ``result.json`` and its other files.

They run in a process of their own (`colonnade_lab.explore.worker`), on this or another machine, and get everything they
need as arguments: the text of the configuration, scene and mesh, and the content of the libraries.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from colonnade.common.frame_size import Size
from colonnade.common.image_io import read_picture, write_png
from colonnade.common.temporary import temporary_folder
from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.mesh.materials.mesh import Mesh
from colonnade.scene.model import Scene

from colonnade_lab.explore.result import Content, write_result

#: The picture of a result.
PICTURE = "picture.png"


def reference(folder: Path, *, scene: Scene, mesh: Mesh, size: Size) -> None:
    """Render a frame with Embree."""
    from colonnade.environment.light_fit import DEFAULT_LIGHTS
    from colonnade.render.reference_frames import traced_frames
    from colonnade.scene.lit_room import scene_room

    (rendered,) = traced_frames([scene], mesh, scene_room(scene), size, DEFAULT_LIGHTS)
    write_png(folder / PICTURE, rendered.image)
    write_result(folder, {"rays": rendered.rays})


def picture(folder: Path, *, config: str, overrides: Sequence[str], scene: Scene, mesh: Mesh, size: Size) -> None:
    """Render a frame with the bit-exact model. Error bits, counters and the records of the scene are in the result."""
    from colonnade.render.device_frames import render_model
    from colonnade.scene.prepared.device_scene import DeviceScene
    from colonnade.scene_image.packer import memory_use

    with _configuration(config) as path:
        manifest: Manifest = manifest_for(str(path), overrides).manifest
    rendered = render_model(scene, mesh, manifest, size)
    write_png(folder / PICTURE, rendered.image)
    header = DeviceScene.of(scene.with_samples(1), manifest, mesh).image.header
    report = {"error_bits": list(rendered.report.errors), "counters": dict(rendered.report.counters)}
    write_result(folder, {**report, "records": memory_use(header, manifest)["columnBvhMemory"]})


def comparison(folder: Path, first: Content, second: Content, *, with_dists: bool) -> None:
    """Compare the pictures of two results, the reference first."""
    from colonnade.quality.dists import dists
    from colonnade.quality.image_metrics import compare_pictures

    pictures = []
    with temporary_folder() as place:
        for name, content in (("first", first), ("second", second)):
            (place / f"{name}.png").write_bytes(content[PICTURE])
            pictures.append(read_picture(place / f"{name}.png"))
    found = compare_pictures(pictures[0], pictures[1])
    distance = dists(pictures[0], pictures[1]) if with_dists else None
    write_result(
        folder,
        {
            "differing_pixels": found.differing_pixels,
            "psnr": found.psnr,
            "ssim": found.ssim,
            "flip": found.flip,
            "dists": distance,
        },
    )


def cycles(
    folder: Path,
    *,
    config: str,
    overrides: Sequence[str],
    scene: Scene,
    mesh: Mesh,
    size: Size,
    reuse: bool,
    dram: Mapping[str, int],
) -> None:
    """Render a frame with the RTL and take its counters."""
    from colonnade_lab.evaluation.bench import mesh_result
    from colonnade_lab.evaluation.measure import measure_frame

    with _configuration(config) as path:
        report = measure_frame(str(path), overrides, scene, mesh, size, reuse=reuse, dram=dram)
    write_result(folder, mesh_result(report))


def counted(folder: Path, *, config: str, overrides: Sequence[str], scene: Scene, mesh: Mesh, size: Size) -> None:
    """Count the cycles of a frame with the cycle model."""
    from colonnade.scene.prepared.device_scene import DeviceScene

    from colonnade_lab.evaluation.bench import mesh_result
    from colonnade_lab.evaluation.cycles import frame_cycles

    with _configuration(config) as path:
        manifest = manifest_for(str(path), overrides).manifest
    report = frame_cycles(DeviceScene.of(scene.with_samples(1), manifest, mesh), size)
    write_result(folder, mesh_result({**report, "cycles_per_second": None, "seconds": {}}))


def area(folder: Path, *, config: str, overrides: Sequence[str], library: Mapping[str, bytes]) -> None:
    """Synthesise a configuration."""
    from colonnade_lab.ppa.measure import measure

    with _configuration(config) as path, _files(library) as files:
        write_result(folder, measure(str(path), overrides, files))


def power(
    folder: Path,
    *,
    config: str,
    overrides: Sequence[str],
    library: Mapping[str, bytes],
    scene: Scene,
    mesh: Mesh,
    size: Size | None,
    window: int,
    clock: float,
) -> None:
    """Estimate the power of a row that renders a frame."""
    from colonnade_lab.ppa.measure import measure
    from colonnade_lab.ppa.power.frame import FrameWorkload
    from colonnade_lab.ppa.power.report import Operation

    operation = Operation(clock, (FrameWorkload(scene, mesh, size, window),))
    with _configuration(config) as path, _files(library) as files:
        report = measure(str(path), overrides, files, operation=operation)
    of_units = {name: unit.get("power_mw") for name, unit in report["units"].items()}
    write_result(folder, {**report["power"], "units": of_units})


@contextlib.contextmanager
def _configuration(text: str) -> Iterator[Path]:
    """A temporary file with the text of a configuration."""
    with _files({"config.json": text.encode()}) as (file,):
        yield Path(file)


@contextlib.contextmanager
def _files(contents: Mapping[str, bytes]) -> Iterator[list[str]]:
    """Temporary files with these contents."""
    with temporary_folder() as place:
        for name, data in contents.items():
            (place / Path(name).name).write_bytes(data)
        yield [str(place / Path(name).name) for name in contents]
