"""The browser tab's animations of glTF files, beside the host's: records of all poses, and what both refuse."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from animated_documents import HOSTILE, Document, arm, changed, grid, swaying
from built_page import MODULE, NEEDS_MODULE, ROOT, run_node

from colonnade.common.errors import UserError
from colonnade.design.manifest import Manifest
from colonnade.mesh.load import load_mesh
from colonnade.scene_image.bending import Bending
from colonnade.scene_image.packer import pack

pytestmark = NEEDS_MODULE
#: Of a clip's duration.
PARTS = (0.0, 0.1, 0.37, 0.625, 0.99, 1.0)


def by_the_tab(
    folder: Path, documents: dict[str, Document], design: str, times: list[int], **job: Any
) -> dict[str, Any]:
    """What the tab makes of an animation of documents, by name; unless the job has its number the first that moves."""
    for name, document in documents.items():
        document.write(folder / name)
    manifest = json.loads((ROOT / "configs" / "golden" / f"{design}.json").read_text())
    job |= {"module": str(MODULE), "manifest": manifest, "files": [*documents], "times": times}
    run_node("clips.mjs", folder, job)
    return dict(json.loads((folder / "result.json").read_text()))


def coloured() -> Document:
    """Strips with colours and normals, one of them mirrored, moved by steps and splines."""
    document = Document(scene=0, scenes=[{"nodes": [0, 1]}])
    points, faces = grid(4, 3)
    random = np.random.default_rng(1)
    attributes = {
        "POSITION": document.add(points),
        "NORMAL": document.add(np.tile([0.1, 1.0, 0.0], (len(points), 1))),
        "COLOR_0": document.add(random.random((len(points), 3))),
    }
    document.json["meshes"] = [
        {"primitives": [{"attributes": attributes, "indices": document.add(faces.ravel(), "u2")}]}
    ]
    document.json["nodes"] = [{"mesh": 0}, {"mesh": 0, "scale": [-1.0, 1.0, 1.0], "translation": [3.0, 0.0, 0.0]}]
    document.animate(
        "hop",
        (0, "translation", "STEP", [0.0, 0.5, 1.0], [[0, 0, 0], [0, 1, 0], [0, 0, 1]]),
        (1, "translation", "CUBICSPLINE", [0.25, 2.0], random.normal(size=(6, 3))),
    )
    return document


@pytest.mark.parametrize("design", ["small", "edge", "lean"])
def test_every_pose_has_the_records_of_the_host(tmp_path: Path, design: str) -> None:
    """Skins, morph targets and nodes, moved by lines, arcs, steps and cubic splines."""
    documents = {"arm.gltf": arm(), "hop.gltf": coloured(), "sway.gltf": swaying(3)}
    manifest = Manifest.load(ROOT / "configs" / "golden" / f"{design}.json")
    for name, document in documents.items():
        mesh = load_mesh(document.write(tmp_path / name), corner_colours=manifest.corner_colours, animation="0")
        image = pack(mesh, manifest)
        assert isinstance(image.moves, Bending)
        times = [round(part * image.moves.duration) for part in PARTS]
        found = by_the_tab(tmp_path, {name: document}, design, times)[name]
        assert "error" not in found, found
        assert found["packed"]["duration"] == image.moves.duration
        assert (tmp_path / f"{name}.clip").read_bytes() == image.moves.file
        assert (tmp_path / f"{name}.rest").read_bytes() == image.records.tobytes()
        posed = {time: (tmp_path / f"{name}.{time}").read_bytes() for time in times}
        for part, time in zip(PARTS, times, strict=True):
            assert posed[time] == image.posed(part).records.tobytes(), (name, time)
        assert len(set(posed.values())) > 3
        bounds = [[found["packed"][f"{side}{axis}"] for axis in "XYZ"] for side in ("low", "high")]
        assert bounds == [list(image.header.bounds_low), list(image.header.bounds_high)]


def test_hostile_animations_are_refused_in_the_words_of_the_host(tmp_path: Path) -> None:
    documents = {f"{number}.gltf": changed(places, value) for number, (places, value, _) in enumerate(HOSTILE)}
    heavy, long = arm(), arm()
    heavy.animate("heavy", (6, "weights", "LINEAR", [0.0, 1.0], [0.0, 1e6, 0.0, 0.0]))
    long.animate("long", (5, "scale", "LINEAR", [0.0, 1e6], [[1, 1, 1], [2, 1, 1]]))
    for document in (heavy, long):
        document.json["animations"].reverse()
    documents |= {"heavy.gltf": heavy, "long.gltf": long}
    manifest = Manifest.load(ROOT / "configs" / "golden" / "small.json")
    found = by_the_tab(tmp_path, documents, "small", [0], animation=0)
    for name, document in documents.items():
        animations = document.json["animations"]
        animation = str(animations[0]["name"])
        with pytest.raises(UserError) as caught:
            pack(load_mesh(tmp_path / name, animation=animation), manifest)
        words = str(caught.value).replace(str(tmp_path / name), name)
        # Of numbers on the grid the host names the mesh, the tab the file
        words = words.replace(f"mesh {Path(name).stem}: ", f"mesh {name}: ")
        assert found[name].get("error", "it was read") == words and "\n" not in words, name


def test_what_an_animation_does_not_show_is_noted(tmp_path: Path) -> None:
    document = arm()
    shifts = document.add([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]])
    document.json["nodes"][5]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": shifts}}}
    document.json["animations"][0]["channels"].append({"sampler": 0, "target": {"path": "pointer"}})
    found = by_the_tab(tmp_path, {"a.gltf": document}, "small", [0])["a.gltf"]
    assert found["animations"] == ["bend"]
    for words in ("1 copy of an animated mesh is not shown", "only channels of nodes and morph"):
        assert any(words in note for note in found["notes"]), words


def test_an_animation_that_moves_nothing_is_not_the_first_one(tmp_path: Path) -> None:
    blinks = {"name": "blink", "samplers": [{}], "channels": [{"sampler": 0, "target": {"path": "pointer"}}]}
    documents = {"moves.gltf": arm(), "stands.gltf": arm()}
    for document in documents.values():
        document.json["animations"].insert(0, blinks)
    documents["stands.gltf"].json["animations"].pop()
    found = by_the_tab(tmp_path, documents, "small", [0])
    assert found["moves.gltf"]["animations"] == ["blink", "bend"] and found["moves.gltf"]["animation"] == 1
    assert found["stands.gltf"]["animation"] is None and found["stands.gltf"]["packed"]["duration"] == 0
    found = by_the_tab(tmp_path, documents, "small", [0], animation=0)
    assert "its animation blink moves no node and no morph target" in found["moves.gltf"]["error"]
