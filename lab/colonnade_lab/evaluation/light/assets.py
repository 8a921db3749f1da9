"""glTF files with metallic-roughness materials, by Colonnade and by a path tracer.

Both get a constant environment, one point light and Colonnade's framing camera. The path tracer's meshes and textures
are read by trimesh, not by Colonnade, so errors of its reader count. Occlusion is left out, and emission has no factor
above 1.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from colonnade.common.atomic_files import replacing
from colonnade.common.downloads import fetched
from colonnade.common.errors import UserError
from colonnade.common.image_io import encode_srgb
from colonnade.common.published import github
from colonnade.common.types import Floats
from colonnade.mesh.load import load_mesh
from colonnade.render.frames import render
from colonnade.render.request import RenderRequest
from colonnade.scene.object_pose import Placed
from colonnade.scene.parser import load_scene
from colonnade.scene.view import make_view
from numpy.typing import NDArray

from colonnade_lab.evaluation.region_metrics import compare_regions

#: Size of a picture, pixels, and samples of a pixel.
SIZE, SAMPLES = (320, 240), 64
#: Radiance of the environment, light of the lamp on a surface that faces it, and its place, in edges of the object.
_AROUND, _LAMP, _OFFSET = (0.35, 0.38, 0.42), (0.7, 0.65, 0.6), (1.2, 1.6, 1.5)
#: The preset that renders.
_CONFIG = "small"
#: The repository, its commit and the files that are measured for the pages.
REPOSITORY, COMMIT = "BabylonJS/MeshesLibrary", "1e0c5cdbdfec7b632b9aa1f498f7016b0d210779"
FILES = {
    "Demos/UnderWaterScene/fish/greySnapper_vertColor": (
        "4d81d3846ad368202edfaba094a0302353d8414035b2238a29e8cd1e5717e452"
    ),
    "Demos/weaponsDemo/meshes/runeSword": "6bc75eab6bc24995a1e51b4bf22d57616cd958da2c7dd468b5ea7b3312421986",
    "ExplodingBarrel": "2e46b67ce14853e840d09b612f60920ff30a2719fccb561d7bd641a9054f26eb",
    "PBR_Spheres": "5a9f82359ca247cca3b145dae69e4151486c2f53e8e06e841c624ca6003d8cb8",
    "clothFolds": "324c555fe47670cd822a87e948ed70cbd0f9e1a2896e80211f71ff13119a235b",
    "shaderBall": "f85c3d1a3db3c9b375493ffb6871c9cb7129b64ebe2e62f282a6fcfac20bd8ae",
    "target": "30de81bde77c8061d5975826288d37a614b858c290ce9c95fa38a0de0b46700d",
}


@dataclass(frozen=True)
class AssetResult:
    """The difference of two pictures of a file, where either shows the object.

    Attributes:
        pixels: Number of these.
        psnr: Decibels.
        flip: Mean FLIP.
    """

    pixels: int
    psnr: float
    flip: float


def sample_files() -> list[Path]:
    """The files of `FILES`.

    Raises:
        UserError: One is not at hand and cannot be fetched.
    """
    files = {path: github(REPOSITORY, COMMIT, f"{path}.glb", digest) for path, digest in FILES.items()}
    return [fetched(file, f"the glTF file {path}") for path, file in files.items()]


def write_jobs(folder: Path, files: list[Path]) -> None:
    """Write for each file a folder with Colonnade's scene and the path tracer's arrays.

    Raises:
        UserError: A file is no mesh, or two have one name.
    """
    names = [file.stem for file in files]
    if len(set(names)) < len(names):
        raise UserError("two of the files have one name: compare them one after the other")
    for file in files:
        own = folder / file.stem
        own.mkdir(parents=True)
        scene, extent = own / "scene.toml", load_mesh(file).extent
        falloff = extent.edge * float(np.linalg.norm(_OFFSET))
        lines = ["[mesh]", f"path = {json.dumps(str(file.resolve()))}", "[light]", f"offset = {list(_OFFSET)}"]
        lines += [f"colour = {list(_LAMP)}", f"falloff = {falloff:.6f}", "[ambient]", f"colour = {list(_AROUND)}"]
        lines += ["[background]", f"colour = {list(_AROUND)}", "[paths]", "gather = 1"]
        lines += ["[frame]", f"width = {SIZE[0]}", f"height = {SIZE[1]}", f"samples = {SAMPLES}"]
        scene.write_text("\n".join(lines) + "\n", encoding="utf-8")
        view = make_view(Placed(load_scene(scene), extent), *SIZE)
        plan: dict[str, Any] = {"size": SIZE, "around": _AROUND, "lamp": _LAMP, "falloff": falloff, "parts": []}
        for key in ("origin", "direction", "step_x", "step_y", "light"):
            plan[key] = getattr(view, key).tolist()
        arrays: dict[str, Any] = {}
        for index, (values, material) in enumerate(_parts(file)):
            plan["parts"].append(material)
            arrays |= {f"{index}-{key}": value for key, value in values.items()}
        with replacing(own / "job.npz") as stream:
            np.savez_compressed(stream, plan=np.array(json.dumps(plan)), **arrays)


def _parts(file: Path) -> list[tuple[dict[str, NDArray[Any]], dict[str, Any]]]:
    """Arrays and material of each primitive of a file, in the space of its scene."""
    import trimesh

    parts = []
    scene = trimesh.load_scene(file)
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        mesh = scene.geometry[name].copy(include_cache=True)  # the file's normals are in the cache
        mesh.apply_transform(transform)
        own: Any = getattr(mesh.visual, "material", None)
        values: dict[str, NDArray[Any]] = {
            "vertices": np.asarray(mesh.vertices),
            "faces": np.asarray(mesh.faces),
            "normals": np.asarray(mesh.vertex_normals),
        }
        if getattr(mesh.visual, "uv", None) is not None:
            values["uv"] = np.asarray(mesh.visual.uv)
        material: dict[str, Any] = {"base": [1.0, 1.0, 1.0], "metallic": 1.0, "roughness": 1.0}
        factor = getattr(own, "baseColorFactor", None)
        if factor is not None:
            # trimesh keeps the linear factor as 8 bits
            material["base"] = [float(value) / 255 for value in np.asarray(factor)[:3]]
        for key in ("metallic", "roughness"):
            given = getattr(own, f"{key}Factor", None)
            material[key] = material[key] if given is None else float(given)
        for key in ("baseColorTexture", "metallicRoughnessTexture", "normalTexture"):
            picture = getattr(own, key, None)
            if picture is not None and "uv" in values:
                values[key] = np.asarray(picture.convert("RGB"))
        emitted = getattr(own, "emissiveFactor", None)
        if emitted is not None and np.any(emitted):
            material["emission"] = [float(value) for value in emitted]
            picture = getattr(own, "emissiveTexture", None)
            if picture is not None and "uv" in values:
                values["emissiveTexture"] = np.asarray(picture.convert("RGB"))
        parts.append((values, material))
    return parts


def compare(folder: Path) -> dict[str, AssetResult]:
    """Render the scenes of `write_jobs`, and write beside.png in the folder of each file: truth, Colonnade.

    Returns:
        By the name of the file, without suffix.

    Raises:
        UserError: The path tracer has made no picture.
    """
    from PIL import Image

    results = {}
    for own in sorted(path for path in folder.iterdir() if path.is_dir()):
        result = own / "truth.npz"
        if not result.is_file():
            raise UserError(f"{result} is missing: run tools/light assets")
        truth = encode_srgb(np.load(result)["picture"].astype(np.float64))
        frame = render(RenderRequest(own / "scene.toml", _CONFIG, backend="model"))
        picture = encode_srgb(frame.image)
        visible = _covered(truth) | frame.object_mask
        found = compare_regions(truth, picture, {"object": visible}, with_dists=False)["object"]
        results[own.name] = AssetResult(found.pixels, found.psnr or 0.0, found.flip or 0.0)
        with replacing(own / "beside.png") as stream:
            Image.fromarray(np.concatenate([truth, picture], axis=1)).save(stream, "PNG")
    return results


def _covered(truth: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """The pixels of a picture that do not show the environment, bool [height, width]."""
    around: Floats = np.array(_AROUND)[None, None]
    return np.asarray((np.abs(truth.astype(int) - encode_srgb(around)) > 2).any(axis=2))
