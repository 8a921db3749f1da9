"""Bakes ambient occlusion into the vertices of a mesh by `colonnade.rays`, and draws it (docs/rays.md).

Usage: python examples/rays/occlusion.py MESH [--output PICTURE] [--gltf FILE] [--rays N] [--traffic] [--embree]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from colonnade.common.atomic_files import replacing
from colonnade.common.processes import tool
from colonnade.mesh.load import load_mesh
from colonnade.rays import Scene
from numpy.typing import NDArray
from PIL import Image

Floats, Faces = NDArray[np.float64], NDArray[np.int32]
#: Rays begin so many longest edges of the box above the surface.
OFFSET = 1e-3
#: Rays that are traced at a time, and rays of a vertex whose traffic is counted.
BATCH, COUNTED = 1 << 20, 4
#: The picture: direction from the mesh to the eye, pixels, and what they show without a mesh.
VIEW, SIZE, BACKGROUND = (0.35, 0.25, 1.0), (640, 640), (0.15, 0.16, 0.19)


def hemisphere(vertices: Floats, faces: Faces, count: int) -> Floats:
    """Rays [vertices · count, 8] around the normals of vertices, as dense as the cosine; float32 values."""
    corners = vertices[faces]
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], areas)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    # A golden spiral, turned at each vertex by another angle
    index, turn = np.arange(count), np.random.default_rng(1).random(len(vertices))
    angle = 2 * np.pi * (turn[:, None] + index * (np.sqrt(5) - 1) / 2)
    height = np.sqrt(1 - (index + 0.5) / count)
    side = np.cross(normals, np.where(np.abs(normals[:, :1]) < 0.6, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-300)
    other, radius = np.cross(normals, side), np.sqrt(1 - height**2)
    rays = np.zeros((len(vertices), count, 8))
    rays[..., :3] = (vertices + OFFSET * np.ptp(vertices, axis=0).max() * normals)[:, None]
    around = np.cos(angle)[..., None] * side[:, None] + np.sin(angle)[..., None] * other[:, None]
    rays[..., 4:7], rays[..., 7] = radius[:, None] * around + height[:, None] * normals[:, None], np.inf
    return rays.reshape(-1, 8).astype(np.float32).astype(np.float64)


def baked(occluded: Callable[[Floats], NDArray[np.bool_]], rays: Floats, count: int) -> Floats:
    """The share of free rays of each vertex, float64 [vertices]."""
    found = [occluded(rays[first : first + BATCH]) for first in range(0, len(rays), BATCH)]
    return 1 - np.concatenate(found).reshape(-1, count).mean(axis=1)


def ordered(scene: Scene) -> Callable[[Floats], NDArray[np.bool_]]:
    """The scene's occlusion of rays in an order in which near ones follow each other."""

    def occluded(rays: Floats) -> NDArray[np.bool_]:
        order, result = scene.order(rays), np.zeros(len(rays), dtype=bool)
        result[order] = scene.occluded(rays[order])
        return result

    return occluded


def embree(vertices: Floats, faces: Faces) -> Callable[[Floats], NDArray[np.bool_]]:
    """The same by Embree, of the package embreex."""
    from embreex import rtcore_scene
    from embreex.mesh_construction import TriangleMesh

    scene = rtcore_scene.EmbreeScene()
    TriangleMesh(scene=scene, vertices=vertices.astype(np.float32), indices=faces.astype(np.int32))
    return lambda rays: scene.run(rays[:, :3].astype(np.float32), rays[:, 4:7].astype(np.float32)) >= 0


def picture(scene: Scene, faces: Faces, shares: Floats) -> NDArray[np.uint8]:
    """The mesh with the light that reaches it: uint8 [height, width, 3]. Its rays are parallel."""
    low, high = scene.bounds
    back = np.array(VIEW) / np.linalg.norm(VIEW)
    right = np.cross((0, 1, 0), back) / np.linalg.norm(np.cross((0, 1, 0), back))
    half = 0.52 * (high - low).max()
    x, y = ((np.arange(size) + 0.5) / size * 2 - 1 for size in SIZE)
    x, y = (half * axis.ravel() for axis in np.meshgrid(x, -y))
    start = (low + high) / 2 + x[:, None] * right + y[:, None] * np.cross(back, right) + 2 * half * back
    rays = np.hstack([start, np.zeros((len(x), 1)), np.tile(-back, (len(x), 1)), np.full((len(x), 1), np.inf)])
    hits = scene.closest(rays)
    weights = np.column_stack([1 - hits.uv.sum(axis=1), hits.uv])
    light = (shares[faces[hits.face]] * weights).sum(axis=1)[:, None]
    colours = np.where((hits.face >= 0)[:, None], light, BACKGROUND)
    return np.rint(255 * colours).astype(np.uint8).reshape(SIZE[1], SIZE[0], 3)


def main() -> None:
    """Bake, count, compare, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh")
    parser.add_argument("--output", type=Path, default=Path("occlusion.png"))
    parser.add_argument("--gltf", type=Path, help="GLB with the shares as vertex colours")
    parser.add_argument("--rays", type=int, default=64, help="of a vertex")
    parser.add_argument("--traffic", action="store_true", help="count what rays in order and shuffled read")
    parser.add_argument("--embree", action="store_true", help="compare with Embree's shares by the same rays")
    options = parser.parse_args()
    mesh = load_mesh(options.mesh)
    scene, rays = Scene(mesh.vertices, mesh.faces), hemisphere(mesh.vertices, mesh.faces, options.rays)
    shares = baked(ordered(scene), rays, options.rays)
    print(f"{len(rays):,} rays; {shares.mean():.1%} of the light reaches the vertices")
    if options.traffic:
        some = rays[:: max(1, options.rays // COUNTED)]
        orders = {"in order": scene.order(some), "shuffled": np.random.default_rng(2).permutation(len(some))}
        for name, order in orders.items():
            found = scene.traffic(some[order], is_occlusion=True)
            print(f"{name}: {found.records / len(some):.1f} records, {found.bytes / len(some):.0f} B of DRAM a ray")
    if options.embree:
        error = np.mean((shares - baked(embree(mesh.vertices, mesh.faces), rays, options.rays)) ** 2)
        print(f"against Embree: {-10 * np.log10(max(error, 1e-12)):.1f} dB")
    with replacing(options.output) as stream:
        Image.fromarray(picture(scene, mesh.faces, shares)).save(stream, format="png")
    if options.gltf:
        colours = np.rint(255 * shares).astype(np.uint8)[:, None].repeat(3, axis=1)
        baked_mesh = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=colours, process=False)
        with replacing(options.gltf) as stream:
            stream.write(baked_mesh.export(file_type="glb"))


if __name__ == "__main__":
    tool(main)
