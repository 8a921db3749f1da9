"""Trees that a target builds over meshes of its own: triangles, nodes, and what rays read."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bent_trees import ADDRESS_BITS, BOX_BITS, Tree, delta_bits, places_of, read_leaf, swept, walk
from c_programs import DRIVER_FOLDER, SANITIZERS, compile_c
from leaves import leaves_of
from target_programs import build

from colonnade import _core
from colonnade.design import toolchain
from colonnade.design.manifest import Manifest, field_places
from colonnade.mesh.load import load_mesh
from colonnade.scene_image.packer import pack

VERTEX_BITS, ROOT = 16, 3
PLACES = places_of(VERTEX_BITS)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build("gcc", tmp_path_factory.mktemp("built"), "built", "build", "-O1", *SANITIZERS)


@dataclass
class Built:
    """A tree, vertices of its leaves, the cost of its first pose; for each other one both trees' costs."""

    tree: Tree
    leaves: Any
    cost: int
    others: Any


def built(program: Path, triangles: Any, materials: Any, *poses: Any) -> Built:
    numbers = [VERTEX_BITS, delta_bits(VERTEX_BITS), BOX_BITS, ADDRESS_BITS, *_core.field_lows(PLACES)]
    numbers += [len(poses[0]), len(triangles), len(poses)]
    rows = [np.array(numbers), np.column_stack([triangles, materials]).reshape(-1)]
    rows += [np.column_stack([pose, np.zeros((len(pose), 2), dtype=np.int64)]).reshape(-1) for pose in poses]
    text = " ".join(map(str, np.concatenate(rows).tolist()))
    done = subprocess.run([program], input=text, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    found = np.array(done.stdout.split(), dtype=np.int64)
    leaves, records, depth = found[:3].tolist()
    words, own, rest = np.split(found[3:], [4 * leaves, 4 * leaves + 8 * records])
    tree = Tree(PLACES, own.astype("<u4").view(np.uint8).reshape(-1, 32), depth, 1)
    return Built(tree, words.reshape(-1, 4), int(rest[0]), rest[1:].reshape(-1, 2))


def reads(records: Any, root: int, tree: Tree) -> float:
    """Nodes that a ray through the bounds reads on average: the areas of their boxes by the root's."""

    def half_area(low: Any, high: Any) -> float:
        x, y, z = np.array(high) - np.array(low)
        return float(x * y + y * z + z * x)

    nodes = list(walk(records, root, tree))
    boxes = [box for node in nodes for (_, is_node), box in zip(node.children, node.boxes, strict=True) if is_node]
    lows, highs = zip(*nodes[0].boxes, strict=True)
    whole = half_area(np.min(lows, axis=0), np.max(highs, axis=0))
    return 1 + sum(half_area(*box) for box in boxes) / whole


def grid(edge: int) -> tuple[Any, Any]:
    """Vertices of a sheet, and its triangles."""
    at = np.arange((edge + 1) ** 2).reshape(edge + 1, edge + 1)
    a, b, c, d = (part.reshape(-1) for part in (at[:-1, :-1], at[1:, :-1], at[:-1, 1:], at[1:, 1:]))
    x, y = (axis.reshape(-1) for axis in np.meshgrid(*[np.linspace(0, 1, edge + 1)] * 2, indexing="ij"))
    return np.stack([x, y], axis=1), np.concatenate([np.stack([a, b, c], axis=1), np.stack([d, c, b], axis=1)])


def twisted(sheet: Any, degrees: float) -> Any:
    angle = np.radians(degrees) * (sheet[:, 0] - 0.5)
    across = sheet[:, 1] - 0.5
    points = np.stack([sheet[:, 0], 0.5 + across * np.cos(angle), 0.5 + across * np.sin(angle)], axis=1)
    return np.rint(points * 65000 + 200).astype(np.int64)


def triangles_of(leaves: Any) -> list[tuple[int, ...]]:
    faces = [leaves[:, (0, 1, 2)], leaves[leaves[:, 3] >= 0][:, (1, 0, 3)]]
    return sorted(turned(face) for face in np.concatenate(faces).tolist())


def turned(face: list[int]) -> tuple[int, ...]:
    """From its least vertex on."""
    at = face.index(min(face))
    return (*face[at:], *face[:at])


@pytest.mark.parametrize("count", [1, 2, 3, 40, 700])
def test_each_triangle_has_one_leaf_and_each_node_the_boxes_of_its_children(program: Path, count: int) -> None:
    random = np.random.default_rng(count)
    vertices = random.integers(0, 1 << VERTEX_BITS, (3 * count, 3)) >> random.integers(0, 12, (3 * count, 1))
    faces = np.array([random.choice(3 * count, 3, replace=False) for _ in range(count)])
    found = built(program, faces, random.integers(0, 2, count), vertices)
    assert triangles_of(found.leaves) == sorted(turned(face) for face in faces.tolist())
    np.testing.assert_array_equal(swept(found.tree.records, ROOT, found.tree, VERTEX_BITS), found.tree.records)
    nodes = list(walk(found.tree.records, ROOT, found.tree))
    addresses = sorted([ROOT, *(address for node in nodes for address, _ in node.children)])
    assert addresses == list(range(ROOT, ROOT + len(found.tree.records)))
    held = [address for node in nodes for address, is_node in node.children if not is_node]
    for address, leaf in zip(held, found.leaves, strict=True):
        record = read_leaf(found.tree.records[address - ROOT], address, PLACES, VERTEX_BITS)
        assert record.vertices == vertices[leaf[leaf >= 0]].tolist()


@pytest.mark.parametrize("name", ["teapot:4", "sphere:2000", "torus", "rock", "cylinder"])
def test_rays_read_few_more_nodes_than_in_the_tree_of_the_packer(program: Path, name: str) -> None:
    manifest = Manifest.load(toolchain.project_root() / "configs" / "golden" / "edge.json")
    image = pack(load_mesh(name), manifest)
    _, leaves = leaves_of(image, manifest)
    vertices, corners = np.unique(leaves["vertices"].reshape(-1, 3), axis=0, return_inverse=True)
    found = built(program, corners.reshape(-1, 3), np.zeros(len(corners) // 3, dtype=np.int64), vertices)
    tree = replace(found.tree, places=field_places(manifest.layouts))
    own, packed = reads(found.tree.records, ROOT, found.tree), reads(image.records, 0, tree)
    print(f"{name}: {own:.2f} nodes, {packed:.2f} of the packer, {found.cost / 256:.2f} by the target")
    assert own <= 1.5 * packed and abs(found.cost / 256 - own) <= 0.1 * own


def test_a_tree_wears_as_its_mesh_bends_until_a_new_one_is_better(program: Path) -> None:
    sheet, faces = grid(48)
    found = built(program, faces, np.zeros(len(faces), dtype=np.int64), *(twisted(sheet, d) for d in (0, 20, 360, 720)))
    print(found.cost, found.others.tolist())
    bent, new = (found.others / found.cost).T
    assert bent[0] < 5 / 4 < bent[1:].min() and new[0] > 0.95 * bent[0] and (new[1:] < 0.95 * bent[1:]).all()
    assert np.mean(found.leaves[:, 3] >= 0) > 0.9


def test_pairs_take_steps_in_proportion_to_triangles_however_many_meet_at_a_vertex_or_an_edge(tmp_path: Path) -> None:
    source, counted = DRIVER_FOLDER / "src" / "colonnade_mesh_build.c", tmp_path / "counted.o"
    compile_c([source], counted, "-c", "-fsanitize-coverage=trace-pc")
    fan = compile_c([DRIVER_FOLDER / "tests" / "fan.c", counted], tmp_path / "fan")
    for place, share in (("vertex", 0.5), ("edge", 1.0)):
        (few, short), (many, long) = (
            map(int, subprocess.run([fan, str(count), place], capture_output=True, check=True).stdout.split())
            for count in (1_000, 16_000)
        )
        assert (few, many) == (1_000 * share, 16_000 * share)
        assert long < 1.5 * 16 * short
