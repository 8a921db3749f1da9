"""Builds Colonnade in a browser tab: out/browser/index.html, one file that works from a folder (docs/browser.md), and
out/browser/rays.js, an ES module for rays of other pages (docs/rays.md).

Usage: tools/browser; run it with the Python of .venv, after tools/environment zig.
"""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import bundle
import colonnade
import designs
import module
import rooms
import rtl
import studies
from colonnade.common.atomic_files import replacing
from colonnade.design.manifest import Manifest

ROOT = Path(__file__).resolve().parents[2]
OUTPUT = ROOT / "out" / "browser"
#: The design whose RTL the page has.
RTL = "tiny"


def main() -> None:
    """Compile, collect, write."""
    OUTPUT.mkdir(parents=True, exist_ok=True)
    code, ray_code = module.OBJECTS / "colonnade.wasm", module.OBJECTS / "rays.wasm"
    module.compile_modules(code, ray_code)
    rtl_code = module.OBJECTS / f"{RTL}.wasm"
    rtl.compile_rtl(RTL, rtl_code)
    texts = {
        name: json.loads((ROOT / "configs" / "golden" / f"{name}.json").read_text("utf-8")) for name in designs.DESIGNS
    }
    points, found, sliders = studies.studies(texts)
    presets = {name: Manifest.from_dict(text) for name, text in texts.items()}
    texts |= points
    manifests = {name: Manifest.from_dict(text) for name, text in texts.items()}
    views = {name: designs.view_file(manifest) for name, manifest in manifests.items()}
    data = {
        "version": colonnade.__version__,
        "manifests": texts,
        "presets": list(presets),
        "studies": found,
        "sliders": sliders,
        "rooms": {name: rooms.room_data(name, presets) for name in rooms.PLACEMENTS},
        "samples": rooms.samples(),
        "cycles": designs.recorded(texts),
        "views": {name: bundle.base64_text(view) for name, view in views.items()},
    }
    contents = {
        "module": code.read_bytes(),
        "data": json.dumps(data, separators=(",", ":")).encode(),
        "rtl": rtl_code.read_bytes(),
    }
    for name, text in (
        ("index.html", bundle.page(contents)),
        ("rays.js", bundle.ray_module(ray_code.read_bytes())),
    ):
        with replacing(OUTPUT / name) as stream:
            stream.write(text.encode())
        size = len(gzip.compress(text.encode(), 9))
        print(f"colonnade: out/browser/{name}, {len(text.encode()):,} bytes, {size:,} compressed")


if __name__ == "__main__":
    main()
