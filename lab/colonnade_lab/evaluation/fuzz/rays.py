"""Batches of any rays (docs/rays.md), and what the model answers."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from colonnade.common.temporary import temporary_folder
from colonnade.design.manifest import Manifest
from colonnade.mesh.load import load_mesh
from colonnade.rays import Scene
from colonnade.rays.recorded import RayRecords, RecordedRays
from colonnade.rays.scene import FAN, OCCLUDED, RANGES, SENSOR

#: A batch in memory.
BATCH = np.dtype(
    [
        *(("rays", "<u8"), ("hits", "<u8"), ("count", "<u4"), ("mode", "<u4"), ("origin", "<f4", 3), ("near", "<f4")),
        *(("far", "<f4"), ("tag", "<u4"), ("done", "<u8"), ("reserved", "<u8")),
    ]
)

#: Bits of a mode: its response; all that are known.
RESPONSE, KNOWN = 3, 0xFF000F33

#: Most rays of a batch, and of a batch in general.
MOST_RAYS, MAX_COUNT = 640, 1 << 24

_COUNTS = (1, 2, 63, 64, 65, 127, 128, 129, 200, 511, MOST_RAYS)
_MASKS = (0xFF, 0xFF, 0, 1, 2, 0x5A, 0xA5)
_MESH_MASK = 0x5A
_COLUMNS = 64
_SPECIAL = np.array(
    [
        *(0, -0.0, 1e-45, -1e-45, 1.17549435e-38, 1.1754942e-38, 3.4028235e38, -3.4e38, np.inf, -np.inf, np.nan),
        *(1, -1, 16, -16, 15.9999, 1e10, 1e-20),
    ],
    np.float32,
)


@dataclass(frozen=True)
class RayBatch:
    """A batch, and its rays.

    Attributes:
        words: Of the type `BATCH`, without addresses.
        rays: What it reads, in bytes of memory.
    """

    words: Any
    rays: bytes

    @property
    def size(self) -> int:
        """Bytes of its hits."""
        return hit_bytes(self.words)


def ray_bytes(words: Any) -> int:
    """Bytes that a batch reads."""
    mode, count = int(words["mode"]), int(words["count"])
    return 64 if mode & SENSOR else count * (16 if mode & FAN else 32)


def hit_bytes(words: Any) -> int:
    """Bytes that a batch writes."""
    response, count = int(words["mode"]) & RESPONSE, int(words["count"])
    return -(-count // 64) * 8 if response == OCCLUDED else count * (8 if response == RANGES else 16)


class RayScene:
    """A scene of two meshes, of which one has another mask, and one has faces that are not opaque.

    Attributes:
        image: What a device loads.
        values: Registers of the scene and its rays, by name.
    """

    image: RayRecords
    values: dict[str, int]

    def __init__(self, manifest: Manifest) -> None:
        asked = RecordedRays()
        with temporary_folder() as folder:
            (folder / "design.json").write_text(json.dumps(manifest.config))
            self._model, device = (self._scene(str(folder / "design.json"), backend) for backend in ("model", asked))
        device.submit(np.zeros((1, 8), np.float32), 1, 0)
        assert asked.records is not None
        self.image, self.values = asked.records, asked.values

    @staticmethod
    def _scene(design: str, backend: Any) -> Scene:
        mesh = load_mesh("torus:12")
        scene = Scene(mesh.vertices, mesh.faces, design, backend=backend)
        scene.set_mask(scene.add(mesh.vertices * 0.5 + 0.3, mesh.faces), _MESH_MASK)
        scene.set_opaque(0, np.arange(len(mesh.faces)) % 3 != 0)
        return scene

    def answer(self, batch: RayBatch) -> bytes | None:
        """The model's hits of a batch; None: its sensor is refused. Its count and mode are legal."""
        words = batch.words
        rays = np.frombuffer(batch.rays[: ray_bytes(words)], np.uint8)
        if int(words["mode"]) & SENSOR:
            columns = int(rays.view("<u4")[9])
            if columns % _COLUMNS or not 0 < columns <= MAX_COUNT:
                return None
        origin, near, far = words["origin"], float(words["near"]), float(words["far"])
        return self._model.submit(rays, int(words["count"]), int(words["mode"]), origin, near, far).tobytes()

    def counters(self) -> dict[str, int]:
        """Sums of all answers, by the names of the device's counters."""
        return self._model.counters()


def any_batch(random: np.random.Generator, max_rays: int = MOST_RAYS) -> RayBatch:
    """A legal batch of at most so many rays, of any response, form, limits, and rays of which some have any bits."""
    words = np.zeros((), BATCH)
    counts = [count for count in _COUNTS if count <= max_rays]
    count = int(random.choice(counts)) if random.random() < 0.7 else int(random.integers(1, max_rays + 1))
    mode = int(random.integers(3)) | (0, FAN, SENSOR)[int(random.integers(3))] | int(random.integers(16)) << 8
    words["count"], words["mode"] = count, mode | int(random.choice(_MASKS)) << 24
    if random.random() < 0.5:
        words["origin"], words["near"], words["far"] = random.normal(size=3) * 3, 0, np.inf
    else:
        limits = any_floats(random, 5)
        words["origin"], words["near"], words["far"] = limits[:3], limits[3], limits[4]
    rays = _sensor(random) if mode & SENSOR else _rays(random, count)[:, 4 if mode & FAN else 0 :]
    return RayBatch(words, rays.tobytes())


def any_floats(random: np.random.Generator, count: int) -> Any:
    """Float32 of which some have any bits, are extremes, or powers of two."""
    floats = (random.normal(size=count) * 2).astype(np.float32)
    how = random.integers(0, 12, count)
    floats = np.where(how == 0, random.choice(_SPECIAL, count), floats)
    floats = np.where(how == 1, random.integers(0, 1 << 32, count, dtype=np.uint32).view(np.float32), floats)
    return np.where(how == 2, np.ldexp(np.float32(1), random.integers(-149, 128, count)), floats).astype(np.float32)


def _rays(random: np.random.Generator, count: int) -> Any:
    """Float32 [count, 8], of which some six in ten pass near the meshes."""
    rays = any_floats(random, 8 * count).reshape(count, 8)
    near = random.random(count) < 0.6
    good = np.zeros((count, 8), np.float32)
    good[:, :3] = random.normal(size=(count, 3)) * 3
    good[:, 4:7] = -good[:, :3] + random.normal(size=(count, 3)) * 0.7
    good[:, 3] = np.where(random.random(count) < 0.7, 0, random.random(count) * 3)
    good[:, 7] = np.where(random.random(count) < 0.7, np.inf, random.random(count) * 4)
    rays[near] = good[near]
    odd = random.random(count) < 0.1
    rays[odd, 7] = any_floats(random, int(odd.sum()))
    return rays


def _sensor(random: np.random.Generator) -> Any:
    """A record of a sensor, uint32 [16]."""
    words = random.integers(0, 1 << 32, 16, dtype=np.uint32)
    if random.random() < 0.6:
        corner, steps = random.normal(size=3) * 2.0**29, random.normal(size=6) * 2.0**23
        words[:9] = np.concatenate([corner, steps]).astype(np.int64) & 0xFFFFFFFF
    words[9] = _COLUMNS * int(random.integers(1, 5))
    return words
