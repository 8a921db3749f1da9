"""Records where the RTL of presets spends the cycles of single pixels of the page's first view: site/cycles.json.

Usage: tools/browser/record.py; run it with the Python of .venv, after tools/browser. It builds simulators.
"""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import designs
import module
import playwright
from colonnade.common.progress import for_terminal
from colonnade.design.generator import design_for
from colonnade.device.verilator import render_rtl
from colonnade.mesh.load import load_mesh
from colonnade.scene_image.packer import pack

PRESETS = ("tiny", "small", "edge")
#: A frame, and its pixels that are recorded.
SIZE, COLUMNS, ROWS = (64, 48), range(20, 45, 2), range(16, 31, 2)
COUNTERS = ("cycles", *"contextsRaySetup waitRecord waitUnit contextsBox contextsTriangles contextsShading".split())
NODE = Path(playwright.__file__).parent / "driver" / "node"


def record(name: str) -> dict[str, Any]:
    """The counters of a preset."""
    design = design_for(name, (), for_terminal())
    manifest, mesh = design.manifest, load_mesh("teapot")
    pixels = [[x, y] for y in ROWS for x in COLUMNS]
    frame = {"width": SIZE[0], "height": SIZE[1], "pixels": pixels}
    with tempfile.TemporaryDirectory() as text:
        folder = Path(text)
        (folder / "view").write_bytes(designs.view_file(manifest))
        mesh.vertices.astype("<f8").tofile(folder / "vertices")
        mesh.faces.astype("<i4").tofile(folder / "faces")
        files = {part: str(folder / part) for part in ("view", "vertices", "faces")}
        job: dict[str, Any] = {"module": str(module.OBJECTS / "colonnade.wasm"), "design": name, **frame, **files}
        job["manifest"] = json.loads((designs.ROOT / "configs" / "golden" / f"{name}.json").read_text("utf-8"))
        (folder / "job").write_text(json.dumps(job))
        command = [str(NODE), str(Path(__file__).with_suffix(".mjs")), str(folder / "job")]
        frames = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    registers: list[Mapping[str, int]] = []
    for writes in frames:
        words = dict(writes)
        fields = [field for field in manifest.registers.values() if field.access == "rw"]
        registers.append(
            {
                field.name: field.decode([words.get(field.address + word, 0) for word in range(field.words)])
                for field in fields
            }
        )
    image = pack(mesh, manifest)
    # From reset, as in the page: a frame leaves arbiters and caches in another state
    rendered = [render_rtl(design, image, [each]).frames[0] for each in registers]
    values = [[int(each.counters[counter]) for counter in COUNTERS] for each in rendered]
    return {"formatHash": job["manifest"]["formatHash"], **frame, "counters": COUNTERS, "values": values}


if __name__ == "__main__":
    found = json.loads(designs.RECORDINGS.read_text("utf-8"))
    for preset in PRESETS:  # one that is recorded stays, where a later one is stopped
        found[preset] = record(preset)
        designs.RECORDINGS.write_text(json.dumps(found, separators=(",", ":")) + "\n", "utf-8")
        print(f"colonnade: {preset} in {designs.RECORDINGS.relative_to(designs.ROOT)}")
