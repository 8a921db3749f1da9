"""Rays of applications: the hits of model and Embree, and what the design's caches read."""

from __future__ import annotations

from dataclasses import astuple

import pytest
from colonnade.mesh.load import load_mesh
from colonnade.rays import Scene

from colonnade_lab.evaluation import ray_calls
from colonnade_lab.evaluation.ray_bench import batches_of
from colonnade_lab.evaluation.rays import KINDS, measured


def test_hits_are_those_of_embree() -> None:
    pytest.importorskip("embreex")
    rates = {each.kind: each for each in measured(load_mesh("torus"), "edge", (), 2000)}
    assert tuple(rates) == KINDS
    for kind, each in rates.items():
        assert each.embree_hits is not None and each.dram_bytes is not None and each.embree is not None
        # A ray within two units of a silhouette may differ
        assert abs(each.hits - each.embree_hits) <= 2 and 150 < each.hits < 2000, kind
        assert each.model > 0 and each.embree > 0 and each.node_reads > 1 and each.dram_bytes > 0


def test_a_design_without_caches_has_no_traffic() -> None:
    assert [each.dram_bytes for each in measured(load_mesh("cube"), "small", (), 10)] == [None] * len(KINDS)


@pytest.mark.matrix
def test_calls_are_measured_beside_those_of_embree() -> None:
    pytest.importorskip("embreex")
    times = [*ray_calls.measured(load_mesh("torus"), 160)]
    assert [each.kind for each in times] == [*KINDS]
    for each in times:
        assert all(isinstance(value, float) and value > 0 for value in astuple(each)[1:])


#: Designs for rays beside the preset: one traversal unit, and two columns of two rows whose scene is in DRAM, of 16
#: bits and of 24.
_TINY = ('queries={"contexts":256}', "units.rayInterval=1")
_SMALL = ("array.rows=2", "array.columns=2", "units.triangleRows=2")
_EXACT = ("geometry.vertexBits=24", "geometry.triangleBits=32")


@pytest.mark.matrix
@pytest.mark.parametrize(
    ("config", "overrides"),
    (("tiny", _TINY), ("traversal", _SMALL), ("traversal", (*_SMALL, *_EXACT)), ("traversal", ())),
    ids=("tiny", "small", "24 bits", "traversal"),
)
def test_the_device_gives_the_hits_of_the_model_in_a_million_rays(config: str, overrides: tuple[str, ...]) -> None:
    mesh = load_mesh("bunny")
    model = Scene(mesh.vertices, mesh.faces, config, overrides)
    device = Scene(mesh.vertices, mesh.faces, config, overrides, backend="rtl")
    for kind, (run, rays) in batches_of(mesh, model, 200_000).items():
        wanted = run(model)
        assert rays >= 200_000 and wanted.any() and (run(device) == wanted).all(), kind
