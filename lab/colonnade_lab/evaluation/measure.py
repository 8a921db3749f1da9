"""Measures the counters of a frame of the RTL, with a cache by the content of Verilog and scene image."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from colonnade.common import cache
from colonnade.design.frame_limits import check_size
from colonnade.design.generator import GeneratedDesign, design_for
from colonnade.design.toolchain import cache_directory, project_root
from colonnade.device.device import require_no_errors
from colonnade.device.simulator_build import build_simulator
from colonnade.device.verilator import Stalls, render_rtl
from colonnade.mesh.materials.mesh import Mesh
from colonnade.render.report import frame_report, mesh_report
from colonnade.scene.model import Scene
from colonnade.scene.prepared.device_scene import DeviceScene
from colonnade.scene_image.dram_image import moved_bytes
from colonnade.scene_image.file import SceneImage


def measure_frame(
    config: str,
    overrides: Sequence[str],
    scene: Scene,
    mesh: Mesh,
    size: tuple[int, int],
    *,
    reuse: bool = True,
    dram: Mapping[str, int] | None = None,
) -> dict[str, Any]:
    """Render a frame with the RTL.

    Args:
        config: Configuration, before `overrides`.
        overrides: Changes to the configuration, ``key.path=value``.
        scene: The scene; its own mesh is not read.
        mesh: The mesh.
        size: Width and height, pixels.
        reuse: Use the cached counters of the same Verilog, scene image, registers and memory.
        dram: Fields of `Stalls` about the DRAM of designs with a cache.

    Returns:
        `colonnade.render.report.frame_report` with ``config_hash``, ``cycles_per_second``, ``seconds``, and with a
        cache ``dram_line_bytes``, bytes that the DRAM port moves for a line.
    """
    design = design_for(config, overrides)
    manifest = design.manifest
    check_size(size, manifest)
    begun = time.perf_counter()
    prepared = DeviceScene.of(scene, manifest, mesh)
    image, registers = prepared.image, prepared.registers(size)
    pack_seconds = time.perf_counter() - begun
    stalls = Stalls(**(dram or {}))
    key = _key(design, image, registers)
    of_today: dict[str, Any] = {"config": manifest.config, "config_hash": manifest.config_hash}
    if manifest.config["columnBvhMemory"]["cache"] is not None:
        of_today["dram_line_bytes"] = moved_bytes(manifest)
        key["dramLatency"] = stalls.dram_latency
        if stalls.dram_interval != 1:
            key["dramInterval"] = stalls.dram_interval
        if stalls.dram_banks:
            key["dramBanks"] = stalls.dram_banks
    name = hashlib.sha256(json.dumps(key, sort_keys=True).encode()).hexdigest()[:24]
    file = cache_directory(project_root()) / "measurements" / f"{name}.json"
    cached = cache.stored(file, key) if reuse else None
    if cached is not None:
        return cached | of_today | {"mesh": asdict(mesh_report(image.header))}
    build_simulator(design)
    begun = time.perf_counter()
    simulated = render_rtl(design, image, [registers], stalls)
    run_seconds = time.perf_counter() - begun
    frame = simulated.frames[0]
    require_no_errors(frame.errors)
    report = {
        **frame_report("rtl", manifest, image.header, frame).as_json(),
        **of_today,
        "cycles_per_second": simulated.cycles_per_second,
        "seconds": {"pack": pack_seconds, "run": run_seconds},
    }
    cache.store(file, key, report)
    return report


def _key(design: GeneratedDesign, image: SceneImage, registers: Mapping[str, int]) -> dict[str, Any]:
    """The cache key: all inputs that determine a frame's counters."""
    digest = hashlib.sha256()
    for words in (image.records, *(section.words for section in image.attributes)):
        digest.update(f"{words.shape} {words.dtype}\n".encode() + words.tobytes())
    plain = {name: int(value) for name, value in registers.items()}
    return {"design": design.digest(), "image": digest.hexdigest(), "registers": plain}
