"""The program of `colonnade.mesh.files.trimesh_files`: reads a file by trimesh and writes it as binary glTF.

Standard output has a line of JSON, what is lost, and the file.
"""

from __future__ import annotations

import io
import json
import logging
import math
import posixpath
import re
import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import trimesh.util
from collada.common import DaeError
from trimesh.exchange.load import mesh_loaders
from trimesh.scene.transforms import SceneGraph
from trimesh.units import unit_conversion

from colonnade.common.decoder_process import DAMAGED
from colonnade.common.errors import UserError
from colonnade.common.input_files import text_of
from colonnade.common.limits import MAX_TRIANGLES
from colonnade.common.machine_limits import limit_this_process
from colonnade.mesh import losses as lost
from colonnade.mesh.files.glb import Glb
from colonnade.mesh.files.mesh_archive import MeshArchive
from colonnade.mesh.files.trimesh_collada import prepare_collada
from colonnade.mesh.files.trimesh_counts import bound_parts, no_vertex, too_many_triangles
from colonnade.mesh.files.trimesh_materials import Materials, Pictures
from colonnade.mesh.losses import Losses

#: What trimesh passes over, by the beginnings of elements.
_PASSED_OVER = {
    ".dae": (
        (rb"<instance_controller\b", lost.SKINS),
        (rb"<morph\b", lost.MORPHS),
        (rb"<ph\b", lost.HOLES),
        (rb"<(?:lines|linestrips)\b", lost.LINES),
        (rb"<animation\b", lost.ANIMATIONS),
        (rb"<instance_light\b", lost.LIGHTS),
        (rb"<instance_camera\b", lost.CAMERAS),
        (rb"<(?:ambient|emission|specular|reflective|transparent)\b[^>]*>\s*<texture\b", lost.TEXTURES),
        (rb"<wrap_[st]>\s*(?:CLAMP|MIRROR|BORDER)", lost.WRAPS),
    ),
    ".3mf": (
        (rb"<(?:\w+:)?(?:basematerials|colorgroup|texture2dgroup)\b", lost.MATERIAL_GROUPS),
        (rb"<(?:\w+:)?beamlattice\b", lost.BEAMS),
    ),
}
#: How the name of a member ends that an archive has to hold.
_MEMBERS = {".zae": ".dae", ".3mf": "3d/3dmodel.model", ".3dxml": ".3dxml"}
#: How the names of the members end that trimesh gets; nothing: all.
_READ = {".3mf": ".model", ".3dxml": ""}
#: Units of 3MF.
_UNITS = ("micron", "millimeter", "millimeters", "centimeter", "inch", "foot", "meter")
#: Rotations to y up, from the axis that a COLLADA file states.
_UP = {b"X": ((0, -1, 0), (1, 0, 0), (0, 0, 1)), b"Z": ((1, 0, 0), (0, 0, 1), (0, -1, 0))}
#: Parts that cannot be read and have a note of their own.
_NAMED = 8


@dataclass(frozen=True)
class _Source:
    """A file.

    Attributes:
        kind: Its suffix; of a COLLADA archive that of the file in it.
        data: What trimesh reads; nothing if it is an archive.
        texts: Its XML, of the formats whose elements are searched.
        archive: The archive that it comes from.
        folder: Its folder in the archive.
        members: The members that trimesh reads.
    """

    kind: str
    data: bytes
    texts: Sequence[bytes] = ()
    archive: MeshArchive | None = None
    folder: str = ""
    members: Mapping[str, bytes] = field(default_factory=dict)


def _source(kind: str, data: bytes, losses: Losses) -> _Source:
    """The file of these bytes, with that suffix."""
    if kind not in _MEMBERS:
        return _Source(kind, data, [text_of(data).encode("utf-8", "surrogateescape")])
    archive, wanted = MeshArchive(data), _MEMBERS[kind]
    names = [name for name in archive.names if name.lower().endswith(wanted) and "__MACOSX" not in name]
    if not names:
        raise UserError(f"its archive holds no file that ends with {wanted}")
    if kind == ".zae":
        losses.add(lost.SCENES, len(names) - 1)
        found = _source(wanted, archive.read(names[0]), losses)
        return replace(found, archive=archive, folder=posixpath.dirname(names[0]))
    members = {name: archive.read(name) for name in archive.names if name.lower().endswith(_READ[kind])}
    return _Source(kind, b"", list(members.values()), members=members)


def _converted(source: _Source, losses: Losses) -> bytes:
    """The binary glTF of a file."""
    for pattern, loss in _PASSED_OVER.get(source.kind, ()):
        losses.add(loss, sum(len(re.findall(pattern, text)) for text in source.texts))
    axes, is_linear = np.eye(4), False
    if source.kind == ".dae":
        (text,) = source.texts
        if re.search(rb"(?i)[\s>]-?nan[\s<]", text):
            raise UserError("a value is not a finite number: repair the file")  # pycollada would take 0
        if up := re.search(rb"<up_axis>\s*([XZ])_UP", text):
            axes[:3, :3] = _UP[up[1]]
        # As in MTL files
        is_linear = re.search(rb"<authoring_tool>\s*Blender\b", text) is not None
    glb = Glb()
    pictures = Pictures(glb, losses, source.archive, source.folder)
    materials = Materials(pictures, is_linear)
    kind = source.kind[1:]
    trimesh.util.decompress = lambda *_, **__: {name: io.BytesIO(own) for name, own in source.members.items()}
    loaded = mesh_loaders[kind](file_obj=io.BytesIO(source.data), file_type=kind, resolver=pictures)
    meshes, nodes = _scene(source, loaded, glb, materials, losses)
    return glb.content(
        {
            "scenes": [{"nodes": [len(nodes)]}],
            "nodes": [*nodes, {"children": list(range(len(nodes))), "matrix": axes.T.reshape(-1).tolist()}],
            "meshes": meshes,
            "materials": materials.written,
            "textures": [{"source": number} for number in range(len(pictures.images))],
            "images": pictures.images,
        }
    )


def _scene(
    source: _Source, loaded: Mapping[str, Any], glb: Glb, materials: Materials, losses: Losses
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The meshes and nodes of what a loader of trimesh returns: those of a scene, or the arrays of one mesh."""
    geometry = loaded.get("geometry", {"mesh": loaded})
    graph = SceneGraph(base_frame=loaded.get("base_frame", "world"))
    for edge in loaded.get("graph", [{"frame_to": "one", "geometry": "mesh"}]):
        graph.update(**edge)
    numbers: dict[str, int] = {}
    meshes: list[dict[str, Any]] = []
    nodes: list[dict[str, Any]] = []
    triangles = 0
    for frame in graph.nodes_geometry:
        matrix, name = graph[frame]
        mesh = geometry[name]
        if not np.isfinite(matrix).all():
            raise UserError(f"the transform of {frame} is not finite")
        triangles += len(mesh["faces"])
        if triangles > MAX_TRIANGLES:
            raise too_many_triangles(MAX_TRIANGLES)
        if not len(mesh["faces"]):
            continue
        if name not in numbers:
            numbers[name] = len(meshes)
            meshes.append({"primitives": [_primitive(mesh, glb, materials, losses)]})
        metres = _metres(source.kind, mesh.get("metadata", {}).get("units"))
        scaled = matrix * np.array([metres, metres, metres, 1.0])[:, None]
        nodes.append({"mesh": numbers[name], "matrix": scaled.T.reshape(-1).tolist()})
    return meshes, nodes


def _metres(kind: str, units: str | None) -> float:
    """The length of a unit; 1 without one."""
    if kind == ".3mf" and units not in _UNITS:
        raise UserError(f"its unit is {units}: 3MF has {', '.join(_UNITS)}")
    metres = unit_conversion(units, "meters") if units else 1.0
    if not 0.0 < metres < math.inf:
        raise UserError(f"its unit has {metres} metres: it must be a positive length")
    return metres


def _primitive(mesh: Mapping[str, Any], glb: Glb, materials: Materials, losses: Losses) -> dict[str, Any]:
    """The primitive of a mesh, the arguments of ``trimesh.Trimesh``."""
    faces = np.asarray(mesh["faces"], dtype=np.int64).reshape(-1, 3)
    if (least := int(faces.min())) < 0:
        raise no_vertex(least)
    values = {"POSITION": np.asarray(mesh["vertices"], dtype=np.float64)}
    if mesh.get("vertex_normals") is not None:
        values["NORMAL"] = np.asarray(mesh["vertex_normals"], dtype=np.float64)
    written: dict[str, Any] = {}
    visual = mesh.get("visual")
    if visual is not None and visual.uv is not None:
        values["TEXCOORD_0"] = np.asarray(visual.uv, dtype=np.float64) * [1.0, -1.0] + [0.0, 1.0]
    colours = next((mesh[key] for key in ("vertex_colors", "face_colors") if mesh.get(key) is not None), None)
    if colours is not None:
        white = 255.0 if np.asarray(colours).dtype.kind in "iu" else 1.0
        colours = np.asarray(colours, dtype=np.float64) / white
        if mesh.get("vertex_colors") is None:
            values = {name: array[faces].reshape(-1, array.shape[1]) for name, array in values.items()}
            colours, faces = np.repeat(colours, 3, axis=0), np.arange(faces.size).reshape(-1, 3)
        values["COLOR_0"] = np.column_stack([materials.linear(colours[:, :3]), colours[:, 3:4]])
    if visual is not None or colours is not None:
        written["material"] = materials.number(None if visual is None else visual.material)
    written["attributes"] = {name: glb.accessor(array) for name, array in values.items()}
    return written | {"indices": glb.accessor(faces.reshape(-1, 1))}


class _Reports(logging.Handler):
    """Counts what trimesh and pycollada report of a part that they pass over."""

    def __init__(self, losses: Losses) -> None:
        super().__init__(logging.WARNING)
        self._losses, self._reasons = losses, list[str]()

    def emit(self, record: logging.LogRecord) -> None:
        """Count the report of a record."""
        self.add(record.getMessage())

    def add(self, reason: str) -> None:
        """Count a report."""
        if reason not in self._reasons and len(self._reasons) < _NAMED:
            self._reasons.append(reason)
        self._losses.add(lost.unread_part(reason if reason in self._reasons else "as those before"))


def _main() -> None:
    """Convert the file of standard input, whose suffix is the last argument."""
    losses, output = Losses(), sys.stdout.buffer
    reports = _Reports(losses)
    logging.getLogger("trimesh").addHandler(reports)
    prepare_collada(losses, reports.add)
    bound_parts(MAX_TRIANGLES)
    # Numbers after one that is none would be left out
    warnings.filterwarnings("error", message="string or file could not be read")
    memory, seconds, kind = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    data = sys.stdin.buffer.read()
    limit_this_process(memory, seconds)
    sys.stdout = sys.stderr
    try:
        content = _converted(_source(kind, data, losses), losses)
    except Exception as error:  # of many types, and MemoryError
        name = "" if isinstance(error, UserError | DaeError) else f"{type(error).__name__}: "
        print(name, *str(error).split(), file=sys.stderr)
        sys.exit(DAMAGED)
    found = [
        (loss.one, loss.several, loss.instead, count, losses.names.get(loss, ""))
        for loss, count in losses.counts.items()
    ]
    output.write(json.dumps(found).encode() + b"\n" + content)


if __name__ == "__main__":
    _main()
