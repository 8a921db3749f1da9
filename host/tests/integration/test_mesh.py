"""The C that bends meshes on a target: the same records on every processor, and what they cost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from animated_documents import arm
from bent_trees import pairs, random_tree
from c_programs import NEEDS_RISCV, RISCV, SANITIZERS
from target_programs import MACHINE, NEEDS_QEMU, QEMU, build, executed, hash_of

from colonnade.design.manifest import Manifest
from colonnade.design.toolchain import project_root
from colonnade.mesh.load import load_mesh
from colonnade.scene_image.clip_file import clip_file
from colonnade.scene_image.grid_clip import grid_clip
from colonnade.scene_image.packer import pack

VERTEX_BITS, ROOT, FRAMES = 16, 5, 40
#: Most instructions for a vertex with its bones and normal, for a record, for a triangle of a closed mesh.
VERTEX, RECORD, TRIANGLE = 540, 450, 600


@pytest.fixture(scope="module")
def sizes(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int, int]:
    """The folder of ``mesh_table.h``, the clip's vertices and records."""
    folder = tmp_path_factory.mktemp("table")
    mesh = load_mesh(arm().write(folder / "arm.gltf"), animation="bend")
    clip = grid_clip(mesh, VERTEX_BITS)
    leaves = pairs(clip.corners)
    tree = random_tree(len(leaves), VERTEX_BITS, ROOT, 1, np.random.default_rng(3))
    file = clip_file(clip, tree.clip_tree(VERTEX_BITS, leaves), tree.places, range(8))
    numbers = {"POSE_WORDS": len(clip.rest), "VERTICES": len(clip.vertices), "DEPTH": tree.depth, "ROOT": ROOT}
    (folder / "mesh_table.h").write_text(
        f"enum {{ {', '.join(f'{name} = {value}' for name, value in numbers.items())} }};\n"
        f"static const _Alignas(4) uint8_t clip_table[] = {{{', '.join(map(str, file))}}};\n"
        f"static uint32_t records[] = {{{', '.join(map(str, tree.records.view('<u4').ravel().tolist()))}}};\n"
    )
    return folder, len(clip.vertices), len(tree.records)


@pytest.fixture(scope="module")
def expected(sizes: tuple[Path, int, int]) -> str:
    """The hash of poses on this machine, optimised."""
    return hash_of(build("gcc", sizes[0], "optimised", "mesh", "-O2", f"-DFRAMES={FRAMES}"))


@pytest.mark.matrix
def test_records_without_optimisation_and_with_sanitizers_are_the_same(
    sizes: tuple[Path, int, int], expected: str
) -> None:
    assert hash_of(build("gcc", sizes[0], "checked", "mesh", "-O0", *SANITIZERS, f"-DFRAMES={FRAMES}")) == expected


@NEEDS_RISCV
@NEEDS_QEMU
def test_records_of_a_riscv_are_the_same(sizes: tuple[Path, int, int], expected: str) -> None:
    assert hash_of(QEMU, build(RISCV, sizes[0], "riscv", "mesh", "-Os", *MACHINE, f"-DFRAMES={FRAMES}")) == expected


@NEEDS_RISCV
@NEEDS_QEMU
def test_a_vertex_and_a_record_take_few_instructions(sizes: tuple[Path, int, int], tmp_path: Path) -> None:
    folder, vertices, records = sizes
    names: dict[int, list[str]] = {}
    for frames in (1, 3):
        program = build(RISCV, folder, f"counted{frames}", "mesh", "-O3", *MACHINE, f"-DFRAMES={frames}")
        names[frames] = list(executed(program, tmp_path))

    def each(of: set[str], count: int) -> float:
        return sum(sum(name in of for name in names[frames]) * (frames - 2) for frames in (1, 3)) / 2 / count

    of_pose = {"colonnade_find_pose", "colonnade_mesh_pose", "__udivdi3"}  # of bones
    others = set(names[3]) - of_pose - {"result", "_start", "colonnade_mesh_open"}
    of_refit = {"enter", "head_of", "write_node", "planes", "write_leaf", "put_position", "code_bits"}
    of_refit |= {"colonnade_mesh_refit", "colonnade_mesh_next"}
    refit = others & of_refit
    vertex, record = each(others - refit, vertices), each(refit, records)
    mesh = load_mesh("teapot")
    header = pack(mesh, Manifest.load(project_root() / "configs" / "golden" / "edge.json")).header
    triangle = (vertex * len(mesh.vertices) + record * (header.nodes + header.leaves)) / header.triangles
    print(f"{vertex:.0f} instructions a vertex, {record:.0f} a record, {triangle:.0f} a triangle of the teapot")
    assert 100 < vertex <= VERTEX and 100 < record <= RECORD and 100 < triangle <= TRIANGLE
