"""Verification of whole frames: the RTL against its bit-exact model, and the model against the float reference."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from colonnade.common.image_io import encode_srgb
from colonnade.common.progress import QUIET, Progress
from colonnade.design.generator import manifest_for
from colonnade.device.verilator import require_hits
from colonnade.quality.image_metrics import compare_hits, psnr
from colonnade.render.frames import render
from colonnade.render.request import Backend, RenderRequest
from colonnade.render.result import RenderResult
from colonnade.scene.parser import load_scene

from colonnade_lab.evaluation.bench import MESHES


@dataclass(frozen=True)
class Equality:
    """Differences between a frame of the RTL and one of the model. Correct hardware has none.

    Attributes:
        pixels: Pixels with different 12-bit colours or shadow ratios, or sums of them over the samples.
        triangles: Pixels with different hit triangles or distances, in the first pass.
        counters: Timing-independent counters that differ.
    """

    pixels: int
    triangles: int
    counters: int

    @property
    def holds(self) -> bool:
        """Whether nothing differs."""
        return self.pixels == self.triangles == self.counters == 0


@dataclass(frozen=True)
class Fidelity:
    """Differences between a frame of the model and one of the float reference.

    Attributes:
        hit_disagreement: Share of pixels that hit in one frame and miss in the other.
        triangle_disagreement: Share of common hits with different triangles.
        psnr: PSNR of the sRGB pictures, decibels.
    """

    hit_disagreement: float
    triangle_disagreement: float
    psnr: float


def equality(rtl: RenderResult, model: RenderResult) -> Equality:
    """Compare a frame of the RTL with one of the model."""
    same_t = (rtl.t == model.t) | (np.isnan(rtl.t) & np.isnan(model.t))
    differs = (rtl.image != model.image).any(axis=2) | ~rtl.sums.same_as(model.sums)
    if model.ratio is not None:
        assert rtl.ratio is not None
        differs |= (rtl.ratio != model.ratio).any(axis=2)
    return Equality(
        pixels=int(differs.sum()),
        triangles=int(((rtl.hit_triangles != model.hit_triangles) | ~same_t).sum()),
        counters=sum(rtl.report.counters[name] != value for name, value in model.report.counters.items()),
    )


def fidelity(model: RenderResult, reference: RenderResult) -> Fidelity:
    """Compare a frame of the model with one of the reference."""
    hits = compare_hits(reference.hit_triangles, model.hit_triangles)
    return Fidelity(
        hit_disagreement=hits.hit_disagreement,
        triangle_disagreement=hits.triangle_disagreement,
        psnr=psnr(encode_srgb(reference.image), encode_srgb(model.image)),
    )


def verify(
    scene: Path,
    config: str,
    overrides: Sequence[str],
    meshes: Sequence[str],
    size: tuple[int, int] | None,
    with_rtl: bool = True,
    with_reference: bool = True,
    progress: Progress = QUIET,
    finished: Callable[[str, dict[str, Any]], None] = lambda name, result: None,
) -> dict[str, Any]:
    """Render each mesh with the backends and compare the frames; of a scene of several objects, these objects.

    Args:
        scene: Scene file; its mesh is replaced, unless it has several objects.
        config: Configuration, before `overrides`.
        overrides: Changes to the configuration, ``key.path=value``.
        meshes: Names or files; if empty, the benchmark's, or the scene's several objects.
        size: Width and height, pixels; None: the scene's.
        with_rtl: Compare the RTL with the model.
        with_reference: Compare the model with the reference.
        progress: Shows the steps.
        finished: Called after each mesh with its name and result.

    Returns:
        ``{"config", "equal", "meshes": {name: {"triangles", "rtl", "reference"}}}``; a skipped comparison is None. The
        name of several objects is the scene file's.
    """
    frames: dict[str, str | None] = {name: name for name in meshes or MESHES}
    if not meshes and load_scene(scene).objects:
        frames = {scene.stem: None}
    if with_rtl:
        require_hits(manifest_for(config, overrides, progress).manifest)
    results: dict[str, dict[str, Any]] = {}
    equal = True
    for name, replacement in frames.items():

        def frame(backend: Backend, mesh: str | None = replacement) -> RenderResult:
            request = RenderRequest(scene, config, overrides, backend, size, mesh=mesh, relit=True)
            return render(request, progress)

        model = frame("model")
        result: dict[str, Any] = {"triangles": model.report.mesh.triangles, "rtl": None, "reference": None}
        if with_rtl:
            differences = equality(frame("rtl"), model)
            equal = equal and differences.holds
            result["rtl"] = asdict(differences)
        if with_reference:
            result["reference"] = asdict(fidelity(model, frame("reference")))
        results[name] = result
        finished(name, result)
    return {"config": config, "overrides": list(overrides), "equal": equal, "meshes": results}
