"""The hardware against its model, bit for bit, and the model against the float scene: one row of figures a mesh."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from colonnade.common.image_io import encode_srgb
from colonnade.common.progress import QUIET, Progress
from colonnade.quality.image_metrics import compare_hits, psnr
from colonnade.render.frames import render
from colonnade.render.request import Backend, RenderRequest
from colonnade.render.result import RenderResult


@dataclass(frozen=True)
class Equality:
    """The RTL's frame against the model's; zero everywhere, or the hardware is wrong.

    Attributes:
        pixels: Pixels whose 12-bit colours differ, or the parts of the light that are left to the room.
        triangles: Pixels whose hit triangles or distances differ.
        counters: Counters independent of timing that differ.
    """

    pixels: int
    triangles: int
    counters: int

    @property
    def holds(self) -> bool:
        """Nothing differs."""
        return self.pixels == self.triangles == self.counters == 0


@dataclass(frozen=True)
class Fidelity:
    """The model's frame against the float reference's.

    Attributes:
        hit_disagreement: Share of the pixels that hit in one and miss in the other.
        triangle_disagreement: Share of the common hits that meet another triangle.
        psnr: Of the sRGB pictures, decibels.
    """

    hit_disagreement: float
    triangle_disagreement: float
    psnr: float


def equality(rtl: RenderResult, model: RenderResult) -> Equality:
    """How the RTL's frame differs from the model's."""
    same_t = (rtl.t == model.t) | (np.isnan(rtl.t) & np.isnan(model.t))
    theirs = model.report.counters
    differs = (rtl.image != model.image).any(axis=2)
    if model.ratio is not None:
        assert rtl.ratio is not None
        differs |= (rtl.ratio != model.ratio).any(axis=2)
    return Equality(
        pixels=int(differs.sum()),
        triangles=int(((rtl.hit_triangles != model.hit_triangles) | ~same_t).sum()),
        counters=sum(rtl.report.counters[name] != value for name, value in theirs.items()),
    )


def fidelity(model: RenderResult, reference: RenderResult) -> Fidelity:
    """How the model's frame differs from the reference's."""
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
    meshes: Iterable[str],
    size: tuple[int, int] | None,
    with_rtl: bool = True,
    with_reference: bool = True,
    progress: Progress = QUIET,
    finished: Callable[[str, dict[str, Any]], None] = lambda name, result: None,
) -> dict[str, Any]:
    """Renders every mesh through the backends and compares them.

    Returns:
        ``{"config", "equal", "meshes": {name: {"triangles", "rtl", "reference"}}}``; a comparison that was not asked
        for is None.
    """
    results: dict[str, dict[str, Any]] = {}
    equal = True
    for name in meshes:

        def frame(backend: Backend, mesh: str = name) -> RenderResult:
            hits = backend == "rtl"
            request = RenderRequest(scene, config, overrides, backend, size, mesh=mesh, hits=hits, relit=True)
            return render(request, progress)

        model = frame("model")
        result: dict[str, Any] = {"triangles": model.report.mesh.triangles, "rtl": None, "reference": None}
        if with_rtl:
            found = equality(frame("rtl"), model)
            equal = equal and found.holds
            result["rtl"] = asdict(found)
        if with_reference:
            result["reference"] = asdict(fidelity(model, frame("reference")))
        results[name] = result
        finished(name, result)
    return {"config": config, "overrides": list(overrides), "equal": equal, "meshes": results}
