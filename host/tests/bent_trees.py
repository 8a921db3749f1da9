"""Trees over the leaves of a clip, and what their records hold, read bit by bit (docs/formats.md)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from colonnade.scene_image.clip_file import ClipTree

BOX_BITS, ADDRESS_BITS = 7, 22
Places = dict[str, dict[str, tuple[int, int, bool]]]


def delta_bits(vertex_bits: int) -> int:
    """Bits of a near pair's deltas."""
    return (157 - 3 * vertex_bits) // 9


def places_of(vertex_bits: int) -> Places:
    """The fields of nodes and leaves of 256 bits, as a design has them: the last part of a vector is lowest."""
    v, d = vertex_bits, delta_bits(vertex_bits)
    body, low = 3 * v + 9 * d, 3 * v + 9 * d + 80

    def vectors(name: str, count: int, start: int, width: int, signed: bool, parts: str = "xyz") -> dict[str, Any]:
        return {
            f"{name}[{i}].{part}": (start + width * (len(parts) * i + k), width, signed)
            for i in range(count)
            for k, part in enumerate(reversed(parts))
        }

    node = vectors("corner", 1, 168, v + 1, False)
    node = {name.replace("[0]", ""): place for name, place in node.items()}
    for child in range(4):
        planes = vectors("low", 2, 42 * child, 7, False)
        for name, place in planes.items():
            node[f"children[{child}].{name.replace('low[1]', 'high').replace('[0]', '')}"] = place
    counts = 168 + 3 * (v + 1) + ADDRESS_BITS
    node |= {"first": (counts - ADDRESS_BITS, ADDRESS_BITS, False)}
    node |= {"leaves": (counts, 3, False), "nodes": (counts + 3, 3, False)}
    head = {"material": (245, 8, False), "isClear": (253, 1, False), "format": (254, 2, False)}
    near = vectors("body.deltas", 3, 3 * v, d, True) | vectors("body.normals", 4, body, 10, True, "uv")
    return {
        "node": node,
        "nearPair": head | near | vectors("body.lowBits", 4, low, 1, False, "uv"),
        "farPair": head | vectors("body.signs", 3, low, 1, False),
        "flatPair": head | vectors("body.vertices", 4, 0, v, False),
        "triangle": head | vectors("body.normals", 3, 9 * v, 11, True, "uv"),
    }


def pairs(faces: Any) -> Any:
    """Leaves of four vertices: faces (a, b, c) and (b, a, d); a fourth of -1 for those alone."""
    edges, left, leaves = {}, [], []
    for face in faces.tolist():
        found = None
        for k in range(3):
            a, b, c = face[k], face[(k + 1) % 3], face[(k + 2) % 3]
            if (other := edges.get((b, a))) is not None and other[0] in left:
                # The other face is (b, a, d)
                found = other[0]
                leaves.append((a, b, c, other[1]))
                break
        if found is not None:
            left.remove(found)
            continue
        left.append(tuple(face))
        for k in range(3):
            edges[face[k], face[(k + 1) % 3]] = (tuple(face), face[(k + 2) % 3])
    return np.array(leaves + [(*face, -1) for face in left], dtype=np.int64)


@dataclass
class Tree:
    """Records of a tree over leaves, in which only what stays when a mesh bends is written."""

    places: Places
    records: Any
    depth: int
    leaf_records: int

    def clip_tree(self, vertex_bits: int, leaves: Any) -> ClipTree:
        """The tree as a clip file has it."""
        numbers = (vertex_bits, delta_bits(vertex_bits), BOX_BITS, ADDRESS_BITS, self.leaf_records)
        return ClipTree(numbers, len(self.records), self.depth, leaves)


def put(record: Any, place: tuple[int, int, bool], value: int) -> None:
    """Write a field."""
    whole = int.from_bytes(record.tobytes(), "little") & ~(((1 << place[1]) - 1) << place[0])
    record[:] = np.frombuffer((whole | value << place[0]).to_bytes(32, "little"), dtype=np.uint8)


def get(record: Any, place: tuple[int, int, bool]) -> int:
    """Read a field."""
    value = int.from_bytes(record.tobytes(), "little") >> place[0] & ((1 << place[1]) - 1)
    return value - (1 << place[1]) if place[2] and value >> (place[1] - 1) else value


def random_tree(leaves: int, vertex_bits: int, root: int, leaf_records: int, random: np.random.Generator) -> Tree:
    """A tree of random shape over so many leaves, in their order, at an address."""
    places = places_of(vertex_bits)
    found: list[Any] = [np.zeros(32, dtype=np.uint8)]
    depths = []

    def build(address: int, count: int, depth: int) -> None:
        depths.append(depth)
        children = int(random.integers(min(2, count), min(4, count) + 1))
        own = int(random.choice([n for n in range(children + 1) if n < children or n == count]))
        below, rest = children - own, count - own
        first = len(found)
        put(found[address], places["node"]["first"], root + first)
        put(found[address], places["node"]["nodes"], below)
        put(found[address], places["node"]["leaves"], own)
        for _ in range(below):
            found.append(np.zeros(32, dtype=np.uint8))
        for _ in range(own):
            record = np.zeros(32, dtype=np.uint8)
            put(record, places["nearPair"]["material"], int(random.integers(256)))
            put(record, places["nearPair"]["isClear"], int(random.integers(2)))
            found.append(record)
            found.extend(random.integers(0, 256, (leaf_records - 1, 32), dtype=np.uint8))
        sizes = random.multinomial(rest - below, np.full(below, 1 / below)) + 1 if below else []
        for child, size in enumerate(sizes):
            build(first + child, int(size), depth + 1)

    build(0, leaves, 1)
    return Tree(places, np.array(found), max(depths), leaf_records)


@dataclass
class ReadLeaf:
    """A leaf: the address of its record, its format, vertices, codes of normals."""

    address: int
    format: int
    vertices: list[list[int]]
    codes: list[tuple[int, int]]


def read_leaf(record: Any, address: int, places: Places, vertex_bits: int) -> ReadLeaf:
    """Decode a leaf."""
    kind = get(record, places["nearPair"]["format"])
    count, codes = 3 if kind == 1 else 4, []
    mask, bits = (1 << vertex_bits) - 1, delta_bits(vertex_bits)

    def vector(layout: str, name: str) -> list[int]:
        return [get(record, places[layout][f"{name}.{axis}"]) for axis in "xyz"]

    vertices = [vector("flatPair", f"body.vertices[{i}]") for i in range(count if kind in (1, 2) else 1)]
    for i in range(3 if kind in (0, 3) else 0):
        delta = vector("nearPair", f"body.deltas[{i}]")
        if kind == 3:
            signs = vector("farPair", f"body.signs[{i}]")
            delta = [(low & ((1 << bits) - 1)) - (sign << bits) for low, sign in zip(delta, signs, strict=True)]
        vertices.append([(a + b) & mask for a, b in zip(vertices[0], delta, strict=True)])
    for i in range(0 if kind == 2 else count):
        layout = "triangle" if kind == 1 else "nearPair"
        code = [get(record, places[layout][f"body.normals[{i}].{c}"]) for c in "uv"]
        if kind != 1:
            lows = [get(record, places["nearPair"][f"body.lowBits[{i}].{c}"]) if kind == 0 else 0 for c in "uv"]
            code = [2 * high + low for high, low in zip(code, lows, strict=True)]
        codes.append((code[0], code[1]))
    return ReadLeaf(address, kind, vertices, codes)


@dataclass
class ReadNode:
    """A node: its address, its children's addresses with whether they are nodes, and their boxes."""

    address: int
    children: list[tuple[int, bool]]
    boxes: list[tuple[list[int], list[int]]]
    corner: list[tuple[int, int]]


def read_node(record: Any, address: int, tree: Tree) -> ReadNode:
    """Decode a node: of its corner the origin and the exponent."""
    places, children, boxes, corner = tree.places["node"], [], [], []
    first, nodes, leaves = (get(record, places[name]) for name in ("first", "nodes", "leaves"))
    for axis in "xyz":
        value = get(record, places[f"corner.{axis}"])
        exponent = (value & -value).bit_length() - 1
        corner.append(((value - (1 << exponent)) // 2, exponent))
    for i in range(nodes + leaves):
        children.append((first + min(i, nodes) + max(0, i - nodes) * tree.leaf_records, i < nodes))
        planes = []
        for plane in ("low", "high"):
            steps = [get(record, places[f"children[{i}].{plane}.{axis}"]) for axis in "xyz"]
            planes.append([origin + (step << exponent) for step, (origin, exponent) in zip(steps, corner, strict=True)])
        boxes.append((planes[0], planes[1]))
    return ReadNode(address, children, boxes, corner)


def walk(records: Any, root: int, tree: Tree) -> Iterator[ReadNode]:
    """The nodes of a tree depth first, each before its children."""
    node = read_node(records[0], root, tree)
    pending = [node]
    while pending:
        node = pending.pop()
        yield node
        below = [address for address, is_node in node.children if is_node]
        pending += [read_node(records[address - root], address, tree) for address in reversed(below)]


def swept(records: Any, root: int, tree: Tree, vertex_bits: int) -> Any:
    """The records of nodes from their children's alone, from the last to the first."""
    result, boxes = records.copy(), {}
    for node in reversed(list(walk(records, root, tree))):
        found = []
        for address, is_node in node.children:
            if is_node:
                found.append(boxes[address])
            else:
                vertices = np.array(read_leaf(records[address - root], address, tree.places, vertex_bits).vertices)
                found.append((vertices.min(axis=0).tolist(), vertices.max(axis=0).tolist()))
        rounded: tuple[list[int], list[int]] = ([], [])
        for a, axis in enumerate("xyz"):
            low, high = min(box[0][a] for box in found), max(box[1][a] for box in found)
            exponent = 0
            while -(-high >> exponent) - (low >> exponent) > 127:
                exponent += 1
            origin = low >> exponent
            put(result[node.address - root], tree.places["node"][f"corner.{axis}"], (2 * origin + 1) << exponent)
            for i, box in enumerate(found):
                places = [tree.places["node"][f"children[{i}].{plane}.{axis}"] for plane in ("low", "high")]
                put(result[node.address - root], places[0], (box[0][a] >> exponent) - origin)
                put(result[node.address - root], places[1], -(-box[1][a] >> exponent) - origin)
            rounded[0].append(origin << exponent)
            rounded[1].append(-(-high >> exponent) << exponent)
        boxes[node.address] = rounded
    return result
