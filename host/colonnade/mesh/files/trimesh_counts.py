"""Bounds what the files of `colonnade.mesh.files.trimesh_program` ask of trimesh: counted before it is made."""

from __future__ import annotations

from typing import Any

import networkx
import trimesh.exchange.dae
import trimesh.exchange.threedxml
import trimesh.exchange.threemf
import trimesh.graph
from collada.polylist import Polylist
from collada.triangleset import TriangleSet

from colonnade.common.errors import UserError

#: Parts of a file, each with those that it consists of: objects in their places, nodes.
MAX_PARTS = 1 << 14

_multigraph_paths, _all_simple_paths = trimesh.graph.multigraph_paths, networkx.all_simple_paths
_unique_name = trimesh.exchange.threemf.unique_name
_parse_node, _ROOT = trimesh.exchange.dae._parse_node, trimesh.exchange.dae._EYE


def bound_parts(most_triangles: int) -> None:
    """Change trimesh in this process: it raises a `UserError` for too many parts, and for triangles of COLLADA."""
    nodes = _Nodes(most_triangles)

    def multigraph_paths(G: Any, source: Any) -> Any:
        _require_few(G, source)
        return _multigraph_paths(G, source)

    def all_simple_paths(graph: Any, source: Any, target: Any) -> Any:
        _require_few(graph, source)
        return _all_simple_paths(graph, source, target)

    def parse_node(node: Any, **others: Any) -> None:
        if others["parent_matrix"] is _ROOT:
            nodes.add(node)
        _parse_node(node=node, **others)

    # Without counts it tries all numbers that a name has had before
    counts: dict[str, int] = {}
    trimesh.exchange.threemf.unique_name = lambda name, taken, known=None: _unique_name(
        name, taken, counts if known is None else known
    )
    trimesh.graph.multigraph_paths = multigraph_paths
    networkx.all_simple_paths = all_simple_paths
    trimesh.exchange.dae._parse_node = parse_node


def too_many_triangles(limit: int) -> UserError:
    """The error of parts with more triangles than a mesh may have."""
    return UserError(f"its parts have more than {limit:,} triangles, the most of a mesh: leave some out")


def no_vertex(number: int) -> UserError:
    """The error of a face that names no vertex: numpy would count a negative number from the last one."""
    return UserError(f"a face names vertex {number}, which does not exist: export it again")


def _too_many() -> UserError:
    return UserError(f"it has more than {MAX_PARTS:,} parts and copies of parts: join them, or export it as glTF")


def _require_few(graph: Any, source: Any) -> None:
    """Refuse a graph in which a part contains itself, or whose paths from a source are too many or too long."""
    reached = graph.subgraph({source, *networkx.descendants(graph, source)})
    try:
        order = list(networkx.topological_sort(reached))
    except networkx.NetworkXUnfeasible:
        raise UserError("a part of it contains itself: export it again") from None
    # Of the paths below each part: their number, and the sum of their lengths
    paths: dict[Any, int] = {}
    lengths: dict[Any, int] = {}
    for part in reversed(order):
        below = [(one, reached.number_of_edges(part, one)) for one in reached[part]]
        paths[part] = sum(count * paths[one] for one, count in below) or 1
        lengths[part] = sum(count * (lengths[one] + paths[one]) for one, count in below)
    if lengths[source] > MAX_PARTS:
        raise _too_many()


class _Nodes:
    """Counts the nodes of COLLADA scenes, with all copies of those that stand in several places."""

    def __init__(self, most_triangles: int) -> None:
        self._most, self._parts, self._triangles = most_triangles, 0, 0
        self._known: dict[int, tuple[int, int]] = {}

    def add(self, node: Any) -> None:
        """Add a node of a scene, and refuse too many of them, or triangles."""
        parts, triangles = self._counts(node)
        self._parts, self._triangles = self._parts + parts, self._triangles + triangles
        if self._parts > MAX_PARTS:
            raise _too_many()
        if self._triangles > self._most:
            raise too_many_triangles(self._most)

    def _counts(self, node: Any) -> tuple[int, int]:
        """The nodes below a node, with itself, and their triangles."""
        if id(node) not in self._known:
            below = [self._counts(child) for child in getattr(node, "children", None) or ()]
            geometry = getattr(node, "geometry", None)
            own = 0 if geometry is None else sum(map(_triangles_of, geometry.primitives))
            parts, triangles = (sum(counts) for counts in zip((1, own), *below, strict=True))
            self._known[id(node)] = parts, triangles
        return self._known[id(node)]


def _triangles_of(primitive: Any) -> int:
    """The triangles of a set, which names vertices from 0 on."""
    if not isinstance(primitive, TriangleSet | Polylist):
        return 0
    if len(primitive.index) and (least := int(primitive.index.min())) < 0:
        raise no_vertex(least)
    return len(primitive) if isinstance(primitive, TriangleSet) else primitive.nvertices - 2 * primitive.npolygons
