"""`colonnade.rays.Scene`: meshes as arrays, and the hits of arrays of rays (docs/rays.md)."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from colonnade.common.arguments import checked
from colonnade.common.errors import UserError
from colonnade.common.types import Floats
from colonnade.design.config_name import Overrides
from colonnade.design.generator import manifest_for
from colonnade.design.manifest import Manifest
from colonnade.rays.device import RayBackend, RayDevice
from colonnade.rays.sensor import Sensor
from colonnade.rays.traffic import Traffic, cache_shape
from colonnade.scene_image.packer import record_format

#: Bits of a batch's mode, as `driver/include/colonnade_rays.h` has them.
CULL_FRONT, CULL_BACK, OPAQUE_ONLY = 1 << 8, 1 << 9, 1 << 10
RANGES, OCCLUDED, FAN, SENSOR = 1, 2, 1 << 4, 1 << 5
#: A ray's mask, 32 bits; and the mask of a batch as it is, in the top byte of its mode.
ALL_MASKS, ALL_DEVICE_MASKS = 0xFFFFFFFF, 0xFF << 24

Backend = Literal["model", "rtl"] | RayBackend

#: Values of a hit's id.
MISS, OUT_OF_RANGE = 0xFFFFFFFF, 0xFFFFFFFE


@dataclass(frozen=True)
class Hits:
    """Hits of rays, n of them.

    Attributes:
        ray: Index of the ray, int64 [n].
        mesh: Number of the mesh, int64 [n]; -1 for a miss.
        face: Index of the mesh's face, int64 [n]; -1 for a miss.
        t: Distance in lengths of the ray's direction, float64 [n]; of a miss the ray's tfar.
        uv: Weights of the face's second and third corner, float64 [n, 2].
        is_back: The face's corners turn clockwise as the ray sees them, bool [n].
        is_opaque: bool [n].
    """

    ray: NDArray[np.int64]
    mesh: NDArray[np.int64]
    face: NDArray[np.int64]
    t: Floats
    uv: Floats
    is_back: NDArray[np.bool_]
    is_opaque: NDArray[np.bool_]


class Scene:
    """Meshes that rays hit, packed for a design. Calls may come from several threads; one runs at a time.

    Rays are arrays [n, 8]: origin, tnear, direction, tfar. A direction has any length; hits are those at
    tnear ≤ t ≤ tfar. A ray that is not finite, without direction or with an empty interval misses. `mode` has bits
    `CULL_FRONT`, `CULL_BACK`, `OPAQUE_ONLY`; a ray hits meshes whose mask, 32 bits, has a bit in common with its own.

    A face whose corners the design rounds to one line is no hit. The first query tells of such faces by a warning, and
    refuses a scene that loses more than one in a hundred.

    Args:
        vertices: float [n, 3], in any unit; None: a scene without a mesh.
        faces: int [m, 3].
        config: The design, as `colonnade generate --config` has it: the width of its vertices and triangle tests. None:
            `edge`, and where it would refuse a scene for the faces that it loses `edge` with vertices of 24 bits.
        overrides: Settings of the design, "key=value".
        refine: t and weights of a hit from the vertices as they are, in double. Where these say that the ray misses
            the face, a neighbour of it may take its place. False: what the device answers.
        backend: "model": the bit-exact model; "rtl": the simulated device, with `queries`; or a device of this
            design, such as a `RayShell`.

    Raises:
        UserError: A mesh or a design is wrong, or they do not fit; also of the methods that add or change meshes.
        RuntimeError: The simulated hardware failed.
    """

    @checked
    def __init__(
        self,
        vertices: Any = None,
        faces: Any = None,
        config: str | None = None,
        overrides: Overrides = (),
        refine: bool = True,
        backend: Backend = "model",
    ) -> None:
        from colonnade import _core

        self._lock = threading.Lock()
        self._owner: int | None = None
        self._manifest = manifest_for(config or "edge", overrides).manifest
        device: RayBackend | None = None if isinstance(backend, str) else backend
        if backend == "rtl":
            device = RayDevice(config or "edge", overrides)
        is_given = config is not None or len(overrides) > 0 or device is not None
        self._rays: Any = _core.Rays(design_text(self._manifest) if is_given else None, device)
        self._rays.refine(refine)
        self._is_committed = False
        if vertices is not None:
            self.add(vertices, faces)

    @checked
    def add(self, vertices: ArrayLike, faces: ArrayLike) -> int:
        """Add a mesh; its number."""
        corners = _array("faces", faces, np.int64, 3)
        if corners.size and not 0 <= corners.min() <= corners.max() < 1 << 32:
            raise UserError("the mesh's faces name a vertex that does not exist")
        return int(self._change("add", _array("vertices", vertices, np.float64, 3), corners.astype(np.uint32)))

    @checked
    def update(self, mesh: int, vertices: ArrayLike) -> None:
        """Move the vertices of a mesh, as many as it has."""
        self._change("update", _word("mesh", mesh), _array("vertices", vertices, np.float64, 3))

    @checked
    def remove(self, mesh: int) -> None:
        """Remove a mesh; the others keep their numbers."""
        self._change("remove", _word("mesh", mesh))

    @checked
    def enable(self, mesh: int, is_enabled: bool) -> None:
        """Leave a mesh out, or take it in."""
        self._change("enable", _word("mesh", mesh), bool(is_enabled))

    @checked
    def set_mask(self, mesh: int, mask: int) -> None:
        """Let only rays with a bit in common with the mask, at first all ones, hit a mesh."""
        self._change("mask", _word("mesh", mesh), _word("mask", mask))

    @checked
    def set_opaque(self, mesh: int, is_opaque: ArrayLike) -> None:
        """Say which faces of a mesh are opaque, bool [m]."""
        values = np.asarray(is_opaque)
        if values.ndim != 1 or values.dtype.kind not in "bui":
            raise UserError("is_opaque is no list of Booleans, one of each face")
        self._change("opacity", _word("mesh", mesh), np.ascontiguousarray(values != 0, dtype=np.uint8))

    @property
    def dropped(self) -> int:
        """Faces with an area that the design rounds to none: no ray hits them."""
        return int(self._query("dropped"))

    @property
    def unit(self) -> float:
        """A vertex unit, to which the device rounds vertices."""
        return float(self._query("grid")[0])

    @property
    def bounds(self) -> Floats:
        """The box of the meshes, float64 [2, 3]."""
        return np.array(self._query("bounds"))

    @checked
    def closest(self, rays: ArrayLike, mode: int = 0, mask: int = ALL_MASKS) -> Hits:
        """The closest hit of each ray, in their order."""
        return Hits(**self._query("closest", _rays(rays), *_filter(mode, mask)))

    @checked
    def all(self, rays: ArrayLike, mode: int = 0, mask: int = ALL_MASKS, max_hits: int = 1 << 20) -> Hits:
        """All hits, ordered by ray and t, at most `max_hits` of each ray."""
        if not 0 <= max_hits < 1 << 63:
            raise UserError(f"max_hits is {max_hits}: give 0 or more")
        return Hits(**self._query("all", _rays(rays), *_filter(mode, mask), max_hits))

    @checked
    def occluded(self, rays: ArrayLike, mode: int = 0, mask: int = ALL_MASKS) -> NDArray[np.bool_]:
        """Whether each ray hits a face, bool [n]."""
        result: NDArray[np.bool_] = self._query("occluded", _rays(rays), *_filter(mode, mask))
        return result

    @checked
    def ranges(self, sensor: Sensor, mode: int = 0, mask: int = 0xFF) -> Floats:
        """The t of the closest hit of a sensor's rays, float64 [height, width], of float32; inf for a miss.

        The device makes the rays. Unlike `closest`, hits are the device's, not refined; `mask` has 8 bits.

        Raises:
            UserError: The sensor is too far away.
        """
        scale, count = 2.0**sensor.exponent, sensor.columns * sensor.height
        limits = sensor.near * scale, sensor.far * scale
        mode, mask = _filter(mode, mask)
        if mask > 0xFF:
            raise UserError(f"a sensor's mask is {mask}: give 0 to 255")
        answer = self.submit(sensor.record(), count, mode | mask << 24 | SENSOR | RANGES, sensor.origin, *limits)
        found = answer.view([("t", "<f4"), ("id", "<u4")]).reshape(sensor.height, sensor.columns)[:, : sensor.width]
        if (found["id"] == OUT_OF_RANGE).any():
            raise UserError("the sensor is 16 edges of the scene's box or more away: move it nearer")
        return np.where(found["id"] == MISS, np.inf, found["t"] / scale)

    @checked
    def submit(
        self,
        records: NDArray[Any],
        count: int,
        mode: int,
        origin: ArrayLike = (0, 0, 0),
        near: float = 0,
        far: float = np.inf,
    ) -> NDArray[np.uint8]:
        """Hand over a batch as it is: `records` in memory, of `count` rays or a sensor; the bytes of its hits."""
        places: Any = [origin]
        start = [float(value) for value in _array("origin", places, np.float64, 3)[0].astype(np.float32)]
        if records.dtype.hasobject:
            raise UserError("records are Python objects: give an array of numbers or bytes")
        data = np.ascontiguousarray(records).view(np.uint8).ravel()
        result: NDArray[np.uint8] = self._query(
            "submit", data, _word("count", count), _word("mode", mode), start, near, far
        )
        return result

    @checked
    def order(self, rays: ArrayLike) -> NDArray[np.uint32]:
        """An order of rays in which near ones follow each other: the device then reads fewer records from DRAM."""
        result: NDArray[np.uint32] = self._query("order", _rays(rays))
        return result

    @checked
    def traffic(self, rays: ArrayLike, is_occlusion: bool = False) -> Traffic:
        """What the design's caches read for the rays in this order, of closest hits or of occlusion.

        Raises:
            UserError: The design has no caches.
        """
        shape, line_bytes = cache_shape(self._manifest)
        found = self._query("traffic", _rays(rays), 0, ALL_MASKS, is_occlusion, shape)
        return Traffic(found["reads"], found["lines"] * line_bytes)

    def counters(self) -> dict[str, int]:
        """Sums over all rays, by the names of the device's counters."""
        counters: dict[str, int] = self._rays.counters()
        return counters

    def _change(self, name: str, *arguments: Any) -> Any:
        with self._held():
            result = self._call(name, *arguments)
            self._is_committed = False
            return result

    def _query(self, name: str, *arguments: Any) -> Any:
        with self._held():
            dropped = 0
            if not self._is_committed:
                self._call("commit")
                self._is_committed = True
                dropped = self._call("dropped")
            result = self._call(name, *arguments)
        if dropped and name != "dropped":
            plural = "faces vanish" if dropped != 1 else "face vanishes"
            warnings.warn(f"rays: {dropped:,} {plural} on the design's grid: no ray hits them", stacklevel=3)
        return result

    @contextmanager
    def _held(self) -> Iterator[None]:
        """The calling thread's turn."""
        if self._owner == threading.get_ident():
            raise RuntimeError("a backend of this scene calls the scene: it would wait for itself")
        with self._lock:
            self._owner = threading.get_ident()
            try:
                yield
            finally:
                self._owner = None

    def _call(self, name: str, *arguments: Any) -> Any:
        try:
            return getattr(self._rays, name)(*arguments)
        except ValueError as error:
            raise UserError(f"rays: {error}") from None


def design_text(manifest: Manifest) -> str:
    """A design for `colonnade_rays_open`: its numbers and layouts, one a line."""
    numbers = {**manifest.numbers, **record_format(manifest), "depth": manifest.memories["columnBvh"]["depth"]}
    lines = [f"number {name} {value}" for name, value in numbers.items()]
    for record, layout in manifest.layouts.items():
        lines += [f"layout {record} {name} {f.offset} {f.width} {int(f.signed)}" for name, f in layout.fields.items()]
    return "\n".join(lines)


def _array(name: str, values: ArrayLike, kind: type, width: int) -> NDArray[Any]:
    try:
        given = np.asarray(values)
        if given.dtype.kind == "c":
            raise TypeError("complex")
        array: NDArray[Any] = np.ascontiguousarray(given, dtype=kind)
    except (TypeError, ValueError) as error:
        raise UserError(f"{name} are no array of numbers [n, {width}]") from error
    if array.ndim != 2 or array.shape[1] != width:
        raise UserError(f"{name} have the shape {list(array.shape)}: give [n, {width}]")
    return array


def _word(name: str, value: int) -> int:
    """A number of 32 bits."""
    if not 0 <= value < 1 << 32:
        raise UserError(f"{name} is {value}: give 0 to {(1 << 32) - 1}")
    return int(value)


def _filter(mode: int, mask: int) -> tuple[int, int]:
    return _word("mode", mode), _word("mask", mask)


def _rays(rays: ArrayLike) -> Floats:
    return _array("rays", rays, np.float64, 8)
