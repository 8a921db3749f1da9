"""Cost of the BVH in records: each mesh packed with and without nodes.

``python -m colonnade.lab.ppa.studies.tree_records CONFIG FILE`` writes the figures of the benchmark meshes.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from colonnade.common.atomic_files import write_json
from colonnade.design.generator import manifest_for
from colonnade.lab.evaluation.bench import MESHES
from colonnade.mesh.load import load_mesh
from colonnade.scene_image.packer import memory_use, pack


def records(config: str, meshes: Sequence[str]) -> dict[str, Any]:
    """Records of each mesh by section, with and without a BVH."""
    kinds = {"tree": manifest_for(config).manifest, "none": manifest_for(config, ("geometry.bvh=false",)).manifest}
    found: dict[str, Any] = {}
    for name in meshes:
        mesh = load_mesh(name)
        found[name] = {"triangles": len(mesh.faces)}
        for kind, manifest in kinds.items():
            found[name][kind] = memory_use(pack(mesh, manifest).header, manifest)["columnBvhMemory"]
    return {"config": kinds["tree"].config, "meshes": found}


if __name__ == "__main__":
    write_json(Path(sys.argv[2]), records(sys.argv[1], MESHES))
