"""`colonnade.Scene`: a scene from a file or from values, rendered and packed."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from colonnade.api.memory_mesh import MeshLike, memory_mesh, mesh_table
from colonnade.common import notes
from colonnade.common.arguments import checked
from colonnade.common.errors import UserError
from colonnade.common.frame_size import Size
from colonnade.common.limits import MAX_DEPTH
from colonnade.common.progress import QUIET, Progress
from colonnade.design.config_name import Overrides
from colonnade.design.generator import manifest_for
from colonnade.maps.encoders import Encoder
from colonnade.mesh.materials.mesh import Mesh
from colonnade.render.frames import render_frames
from colonnade.render.request import Backend, RenderRequest
from colonnade.render.result import RenderResult
from colonnade.render.room_defaults import tell_without_defaults
from colonnade.scene import model
from colonnade.scene.parser import read_tables, scene_file, scene_of
from colonnade.scene.passes import of_a_device
from colonnade.scene.prepared.device_scene import DeviceScene

Table = Annotated[Mapping[str, Any], "a dict, as a table of a scene file"]
Tables = Annotated[Table | Sequence[Table], "a dict or a list of dicts, as tables of a scene file"]

#: Options of `Scene.render` and `Scene.frames`: fields of `RenderRequest`.
_OPTIONS = ("overrides", "samples", "relit", "truth", "encoder", "denoise", "hits", "waveform")


class Scene:
    """A scene: objects, camera, lights and background.

    It has the tables, keys, units and defaults of a scene file (docs/host.md, "Placement"). Several lights
    are a list of tables. Values are checked when the scene is made. A scene does not change; `with_tables` makes
    another.

    Notes on what a mesh holds and a picture does not show, and on light and samples that a scene does not name, are
    Python warnings, each once for a scene and what `with_tables` makes of it.

    Args:
        mesh: A name such as ``teapot`` or ``sphere:80``, a file, arrays, or a ``trimesh.Trimesh``, of which vertices
            and faces are read. None: the table `object` names meshes.
        crease: Angle up to which edges are smooth, degrees; None: the file's normals, without them 60.
        camera: ``position`` and ``target``, or ``direction`` and ``framing``; ``up``, ``fov`` (degrees), …
        light: ``position`` or ``offset``, ``colour``, …; or a list of such tables.
        material: ``kind`` (diffuse, mirror or glass), ``albedo``, …, in place of the mesh's.
        transform: ``rotate`` (degrees), ``scale``, ``translate``.
        object: The place in a room, ``stand_at``, ``size``, ``turn``; or a list of tables of several objects.
        ambient: ``colour``.
        background: ``colour``, or ``room``, a folder, …
        paths: ``bounces``, ``gather``, …
        motion: What changes over several frames.
        frame: ``width``, ``height``, ``samples``.
        folder: What paths in the tables are relative to; by default the working directory.

    Raises:
        UserError: A key or a value is invalid; the message names it.
    """

    mesh: Mesh | None  # in memory; None: the tables name it

    @checked
    def __init__(
        self,
        mesh: MeshLike | None = None,
        *,
        crease: float | None = None,
        camera: Table | None = None,
        light: Tables | None = None,
        material: Table | None = None,
        transform: Table | None = None,
        object: Tables | None = None,
        ambient: Table | None = None,
        background: Table | None = None,
        paths: Table | None = None,
        motion: Table | None = None,
        frame: Table | None = None,
        folder: str | Path | None = None,
    ) -> None:
        given = {
            "transform": transform, "object": object, "camera": camera, "light": light, "material": material,
            "paths": paths, "ambient": ambient, "background": background, "motion": motion, "frame": frame,
        }  # fmt: skip
        tables = {name: table for name, table in given.items() if table is not None}
        if mesh is not None:
            tables["mesh"] = mesh_table(mesh) | ({} if crease is None else {"crease": crease})
        self._set(tables, None, "the scene", Path() if folder is None else Path(folder))
        if mesh is not None and not isinstance(mesh, str | Path):
            with _noted(self._notes):
                self.mesh = memory_mesh(mesh, crease)

    @classmethod
    @checked
    def load(cls, file: str | Path) -> Scene:
        """Read a scene file.

        Args:
            file: A TOML file, or the name of one of the project's scenes, such as ``room``.

        Raises:
            UserError: The file is missing or invalid.
        """
        path = scene_file(file)
        scene = cls.__new__(cls)
        scene._set(read_tables(path), None, f"scene {path}", path.parent)
        return scene

    def with_tables(self, **tables: Tables | None) -> Scene:
        """The scene with other tables: each replaces the table of its name; None removes it.

        ``scene.with_tables(camera={"position": (0, 1, 3), "target": (0, 0, 0)})``

        Raises:
            UserError: A key or a value is invalid.
        """
        kept = {name: table for name, table in (self.tables | tables).items() if table is not None}
        scene = type(self).__new__(type(self))
        scene._set(kept, self.mesh if "mesh" not in tables else None, self._where, self.folder)
        scene._notes = self._notes
        return scene

    def _set(self, tables: Mapping[str, Any], mesh: Mesh | None, where: str, folder: Path) -> None:
        try:
            self.tables: dict[str, Any] = _plain(tables, "")
        except RecursionError:
            raise UserError(f"{where} is nested too deeply: {MAX_DEPTH} levels at most") from None
        self.mesh, self.folder, self._where = mesh, folder, where
        self._notes: set[str] = set()
        self.description: model.Scene = scene_of(self.tables, where, folder)

    @checked
    def render(
        self, backend: Backend = "model", config: str = "small", size: Size | None = None, **options: Any
    ) -> RenderResult:
        """Render one frame.

        Args:
            backend: ``model``, the bit-exact model; ``rtl``, the generated Verilog in a simulator; or ``reference``,
                Embree in floating point.
            config: The design: a preset, a JSON file, or a precision such as ``32b32s64d``.
            size: Width and height, pixels; None: the scene's, 640×480 unless given.
            options: Others of `RenderRequest`: ``overrides``, ``samples``, ``relit``, ``truth``, ``encoder``,
                ``denoise``, ``hits``, ``waveform``; and ``progress`` (`colonnade.common.progress.for_terminal`).

        Returns:
            The frame: ``pixels``, uint8 [height, width, 3]; ``image``, linear float64; ``hits()``; ``counters``;
            ``report``, with rays, cycles and seconds.

        Raises:
            UserError: The design cannot render the scene, or the hardware raised an error bit.
        """
        (result,) = self.frames(1, backend, config, size, **options)
        return result

    def frames(
        self,
        count: int,
        backend: Backend = "model",
        config: str = "small",
        size: Size | None = None,
        **options: Any,
    ) -> Iterator[RenderResult]:
        """Render frames of the scene's motion, one after the other; mesh and room are loaded once.

        Args:
            count: Number of frames.
            backend: As in `render`.
            config: As in `render`.
            size: As in `render`.
            options: As in `render`.

        Raises:
            UserError: See `render`.
        """
        progress = options.pop("progress", QUIET)
        if unknown := options.keys() - set(_OPTIONS):
            raise UserError(f"unknown option {min(unknown)}; known here: {', '.join(_OPTIONS)}, progress")
        request = RenderRequest(
            self.description, config, backend=backend, size=size, frames=count, mesh=self.mesh, **options
        )
        with _noted(self._notes):
            results = render_frames(request, progress)
        while True:
            with _noted(self._notes):
                result = next(results, None)
            if result is None:
                return
            yield result

    @checked
    def pack(
        self,
        config: str = "small",
        *,
        overrides: Overrides = (),
        size: Size | None = None,
        relit: bool = False,
        encoder: Encoder | None = None,
        progress: Progress = QUIET,
    ) -> DeviceScene:
        """Pack the scene for a design.

        Args:
            config: As in `render`.
            overrides: Fields that replace some of it, ``key=value``.
            size: Width and height of frames, to refuse one that the room cannot have; None: no check.
            relit: Frames show the room under the scene's lights, not its photo.
            encoder: Of the room's maps and of textures, ``offline`` or ``live``; None: as `Encoder` says.
            progress: Shows the steps.

        Returns:
            ``image``, ``registers(size)``, and the files for a device: ``device_image()``, ``frame_file(size)``, …

        Raises:
            UserError: The design cannot render the scene.
        """
        with _noted(self._notes):
            manifest = manifest_for(config, overrides, progress).manifest
            scene = of_a_device(self.description)
            tell_without_defaults(scene, config, manifest)
            return DeviceScene.of(
                scene, manifest, self.mesh, size=size, relit=relit, encoder=encoder, progress=progress
            )

    def __repr__(self) -> str:
        return f"<Scene of {', '.join(self.tables)}>"


def _plain(value: Any, key: str) -> Any:
    """Tables without numpy's types, as a file has them.

    Raises:
        UserError: A value is none that a file could have.
    """
    if isinstance(value, Mapping):
        return {str(name): _plain(one, f"{key}.{name}" if key else str(name)) for name, one in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist(), key)
    if isinstance(value, list | tuple):
        return [_plain(one, key) for one in value]
    if value is None or isinstance(value, bool | int | float | str | Path):
        return value
    raise UserError(f"{key} is a {type(value).__name__}: give text, numbers, or a list or a dict of them")


@contextlib.contextmanager
def _noted(earlier: set[str] | None = None) -> Iterator[None]:
    """Show notes as warnings, except earlier ones."""
    with notes.opened(lambda line: warnings.warn(line, stacklevel=2), earlier):
        yield
