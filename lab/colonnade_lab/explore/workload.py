"""The frames of a study's workload."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from colonnade.common.errors import UserError
from colonnade.mesh.materials.mesh import Mesh
from colonnade.scene.lit_room import scene_room
from colonnade.scene.object_mesh import object_mesh
from colonnade.scene.parser import load_scene
from colonnade.scene.passes import exposed

from colonnade_lab.explore.frames import Frame, frame_of
from colonnade_lab.explore.reduced_mesh import reduced_mesh
from colonnade_lab.explore.study_file import StudyFile


def frames_of(file: StudyFile) -> list[Frame]:
    """The frames of a study: each scene with each mesh, and with each of its reductions.

    Raises:
        UserError: A scene or mesh is missing or wrong, or two frames have one name; with the line of the study.
    """
    workload = file.study.workload
    meshes: dict[str, Mesh] = {}
    found: list[Frame] = []
    for name in workload.scenes:
        try:
            # Jobs run in folders of their own
            scene = exposed(load_scene((file.path.parent / name).resolve()))
            samples = scene.frame.samples or 1
            if scene.blurs or samples > 1:
                key = "frame.samples" if samples > 1 else scene.blurs[0]
                raise UserError(f"scene {name}: a study renders one sample a pixel: leave out {key}")
        except UserError as error:
            raise file.error(("workload", "scenes", name), str(error)) from None
        for source in workload.meshes or (None,):
            try:
                own = scene if source is None else scene.with_mesh(source)
                key = name if own.objects else f"{own.mesh_source} {own.mesh.crease} {own.mesh.simplify}"
                if key not in meshes:
                    meshes[key] = object_mesh(own, scene_room(own) if own.objects else None, corner_colours=True)
            except UserError as error:
                where = ("workload", "scenes", name) if source is None else ("workload", "meshes", source)
                raise file.error(where, str(error)) from None
            stem = Path(name).stem
            both = len(workload.scenes) > 1 and source is not None
            title = f"{stem}, {source}" if both else stem if source is None else source
            mesh = replace(meshes[key], name=source or meshes[key].name)
            for named, own_mesh in _reductions(file, title, mesh):
                if any(named == frame.name for frame in found):
                    where = ("workload", "scenes", name) if source is None else ("workload", "meshes", source)
                    raise file.error(where, f"two frames are named {named}: rename a scene's file, or name a mesh once")
                found.append(frame_of(named, own, own_mesh, source))
    return found


def _reductions(file: StudyFile, title: str, mesh: Mesh) -> Iterator[tuple[str, Mesh]]:
    """The titles of a mesh's frames and their meshes: that mesh, or the reduced ones."""
    if not file.study.workload.reduce:
        yield title, mesh
    for maximum in file.study.workload.reduce:
        try:
            yield f"{title}, {maximum}", reduced_mesh(mesh, maximum)
        except UserError as error:
            raise file.error(("workload", "reduce", str(maximum)), str(error)) from None
