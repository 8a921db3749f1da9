"""Rays of applications: the hits of model and Embree, and what the design's caches read."""

from __future__ import annotations

import pytest
from colonnade.mesh.load import load_mesh

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
