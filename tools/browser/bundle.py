"""Puts modules, styles and data into one file, which a browser opens without a server."""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SITE = ROOT / "site"
#: Modules after the modules that they import.
WORKER = (
    *("design", "library", "corners", "photo", "surfaces", "coverage", "polygons", "gltfdocument", "gltfmaterials"),
    *("gltfclip", "gltf", "meshes", "sums", "depth", "encoder", "room", "rtl", "worker"),
)
PAGE = (
    *("camera", "design", "photo", "surfaces", "roomview", "path", "panels", "orbit", "queue", "renderer", "state"),
    *("moves", "recording", "view", "notes", "picture", "player", "raypanel", "files", "visitor", "rtlpanel", "page"),
)

_IMPORT = re.compile(r'^import [^;]*? from "\./(\w+)\.js";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=async |function |class |const |let )", re.MULTILINE)


def joined(names: Sequence[str]) -> str:
    """The text of modules as one, without their imports and exports.

    Raises:
        ValueError: A module imports one that is not before it, or two have the same name at their top level.
    """
    parts: list[str] = []
    owners: dict[str, str] = {}
    for index, name in enumerate(names):
        text = (SITE / f"{name}.js").read_text(encoding="utf-8")
        if missing := set(_IMPORT.findall(text)) - set(names[:index]):
            raise ValueError(f"site/{name}.js imports {', '.join(sorted(missing))}, which is not before it")
        text = _EXPORT.sub("", _IMPORT.sub("", text))
        tops = re.findall(r"^(?:async )?(?:function|class|const|let) (\w+|\[[^\]]*\])", text, re.MULTILINE)
        for top in re.findall(r"\w+", " ".join(tops)):
            if top in owners:
                raise ValueError(f"site/{name}.js and site/{owners[top]}.js both define {top}")
            owners[top] = name
        parts.append(text)
    return "\n".join(parts)


def page(contents: Mapping[str, bytes]) -> str:
    """The page with its contents, each compressed."""
    data = {name: base64_text(gzip.compress(content, 9, mtime=0)) for name, content in contents.items()}
    texts = {
        "/* style.css */": (SITE / "style.css").read_text(encoding="utf-8"),
        "/* data */": json.dumps(data),
        "/* worker */": joined(WORKER) + "\nserve(self);\n",
        "/* page */": joined(PAGE),
    }
    html = (SITE / "index.html").read_text(encoding="utf-8")
    for mark, text in texts.items():
        if "</script" in text or html.count(mark) != 1:
            raise ValueError(f"{mark} is not once in site/index.html, or its text ends a script")
        html = html.replace(mark, text)
    return html


def ray_module(code: bytes) -> str:
    """An ES module that exports `MeshBVH`, with its WebAssembly."""
    inflated = "new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'))).arrayBuffer()"
    return f"""{joined(("design", "library", "raycast"))}
const bytes = Uint8Array.from(atob("{base64_text(gzip.compress(code, 9, mtime=0))}"), (each) => each.charCodeAt(0));
export const MeshBVH = await meshTrees(await {inflated});
"""


def base64_text(content: bytes) -> str:
    """Bytes as base64."""
    return base64.b64encode(content).decode()
