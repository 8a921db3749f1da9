"""Writes what a bench or a program hands to a device for rays, and what its memory holds afterwards (docs/rays.md).

Usage: python examples/rays/batches.py --config DESIGN [--set KEY=VALUE …] [--rays N] --output PREFIX

- PREFIX.image, PREFIX.dram: the device image of a torus, and its records if the design reads them from DRAM
- PREFIX.batches: a header of 128 bytes, 64 bytes for each batch, and rays. Addresses of rays count from the beginning
  of this file, of hits and tags from the beginning of the results
- PREFIX.results: tags and hits of the bit-exact model, among bytes that the device does not write

Batches have all forms of rays and of hits. One is misaligned, and one names rays that are outside of the memory.
"""

from __future__ import annotations

import argparse
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from colonnade.common.processes import tool
from colonnade.design.generator import manifest_for
from colonnade.mesh.geometry import primitives
from colonnade.rays import Scene, Sensor
from colonnade.rays.recorded import RecordedRays
from colonnade.rays.scene import ALL_DEVICE_MASKS, CULL_BACK, FAN, OCCLUDED, RANGES, SENSOR
from colonnade.scene_image.device_image import device_image
from colonnade.scene_image.dram_image import dram_image
from numpy.typing import NDArray

#: Registers of a scene, in the order of the header.
REGISTERS = (
    *(f"bounds.{end}.{axis}" for end in ("low", "high") for axis in "xyz"),
    *("placement.mantissa", "placement.exponent"),
    *(f"placement.base.{axis}" for axis in "xyz"),
)
#: The values of these; numbers of records and batches, bytes of results, the word where nothing is written.
HEADER = struct.Struct("<6iIi3q4I56x")
#: Of a batch: rays, hits, count, mode, origin, tnear, tfar, tag, done, and a word of 64 bits that is 0.
BATCH = struct.Struct("<2Q2I5fI2Q")
LINE, UNWRITTEN, FAILED, FIRST_TAG = 64, b"\xa5", 1 << 31, 0x5000
#: Behind the memory of any bench, a multiple of a line.
OUTSIDE = 1 << 30
FORMS = ("rays, hits", "fan, hits", "misaligned", "sensor, ranges", "rays, occlusion")
FORMS += ("outside", "rays, ranges", "fan, occlusion", "sensor, hits")


def rays_of(vertices: NDArray[np.float64], count: int) -> NDArray[np.float32]:
    """Rays [count, 8] from a sphere around the vertices to places among them."""
    random = np.random.default_rng(3)
    outward = random.normal(size=(count, 3))
    rays = np.zeros((count, 8), dtype=np.float32)
    rays[:, :3] = 3 * outward / np.linalg.norm(outward, axis=1, keepdims=True)
    rays[:, 4:7] = random.uniform(vertices.min(axis=0), vertices.max(axis=0), (count, 3)) - rays[:, :3]
    rays[:, 7] = np.inf
    return rays


def submissions(rays: NDArray[np.float32]) -> dict[str, tuple[Any, ...]]:
    """Arguments of `Scene.submit`, by form. Most numbers of rays fill no whole line of hits."""
    count, masks = len(rays), ALL_DEVICE_MASKS
    sensor = Sensor(
        (0.2, 0.3, 4),
        (-1.6, 1.2, -4),
        (0.05, 0, 0),
        (0, -0.6, 0),
        64,
        max(1, count // 64),
    )
    start, fan = rays[0, :3], rays[:, 4:].copy()
    fan[:, :3] += rays[:, :3] - start
    flat = (sensor.record(), 64 * sensor.height)
    limits = (sensor.origin, 0.0, np.inf)
    return {
        "rays, hits": (rays[1:], count - 1, masks),
        "fan, hits": (fan[2:], count - 2, masks | FAN, start, 0.25),
        "misaligned": (rays, count, masks),
        "sensor, ranges": (*flat, masks | SENSOR | RANGES, *limits),
        "rays, occlusion": (rays[3:], count - 3, masks | OCCLUDED),
        "outside": (rays, count, masks),
        "rays, ranges": (rays[5:], count - 5, masks | RANGES | CULL_BACK),
        "fan, occlusion": (fan[4:], count - 4, masks | FAN | OCCLUDED, start, 0.0),
        "sensor, hits": (*flat, masks | SENSOR, *limits),
    }


def lines(size: int) -> int:
    """Bytes of whole lines."""
    return -(-size // LINE) * LINE


def placed(batches: list[tuple[bytes, bytes, int]], hits: Mapping[str, bytes]) -> tuple[bytes, bytes]:
    """Batches with their addresses and their rays, behind the header; tags and hits as the device leaves them."""
    descriptors, data, tags, results = b"", b"", b"", b""
    first_rays, first_hits = (
        HEADER.size + BATCH.size * len(FORMS),
        lines(4 * len(FORMS)),
    )
    for number, (name, (batch, rays, size)) in enumerate(zip(FORMS, batches, strict=True)):
        fields = list(BATCH.unpack(batch))
        fields[0], fields[1] = first_rays + len(data), first_hits + len(results)
        fields[9], fields[10] = FIRST_TAG + number, 4 * number
        if name == "misaligned":
            fields[1] += LINE // 2
        if name == "outside":
            fields[0] += OUTSIDE
        fails = name in ("misaligned", "outside")
        descriptors += BATCH.pack(*fields)
        data += rays.ljust(lines(len(rays)), b"\0")
        tags += struct.pack("<I", fields[9] | fails * FAILED)
        # A line that nothing writes lies between hits
        results += (b"" if fails else hits[name]).ljust(lines(size) + LINE, UNWRITTEN)
    return descriptors + data, tags.ljust(first_hits, UNWRITTEN) + results


def main() -> None:
    """Write the files."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--config", required=True)
    parser.add_argument("--set", action="append", default=[], dest="overrides")
    parser.add_argument("--rays", type=int, default=256, help="of a batch, 64 at least")
    parser.add_argument("--output", type=Path, required=True)
    options = parser.parse_args()
    if options.rays < LINE:
        parser.error("--rays: give 64 at least")
    design = (options.config, tuple(options.overrides))
    manifest = manifest_for(*design).manifest
    vertices, faces = primitives.torus(16)
    recorder = RecordedRays()
    model, recorded = (Scene(vertices, faces, *design, backend=backend) for backend in ("model", recorder))

    calls = submissions(rays_of(vertices, options.rays))
    hits = {name: model.submit(*call).tobytes() for name, call in calls.items()}
    for call in calls.values():
        recorded.submit(*call)

    batches, results = placed(recorder.batches, hits)
    assert recorder.records is not None
    numbers = len(FORMS), len(results), int.from_bytes(4 * UNWRITTEN, "little")
    files = {
        "image": device_image(recorder.records, manifest),
        "batches": HEADER.pack(
            *(recorder.values[name] for name in REGISTERS),
            len(recorder.records.records),
            *numbers,
        )
        + batches,
        "results": results,
    }
    if manifest.config["columnBvhMemory"]["cache"]:
        files["dram"] = dram_image(recorder.records, manifest)
    options.output.parent.mkdir(parents=True, exist_ok=True)
    for suffix, content in files.items():
        options.output.with_name(f"{options.output.name}.{suffix}").write_bytes(content)
    found = np.frombuffer(hits["rays, hits"], dtype="<u4")[1::4] != 0xFFFFFFFF
    print(f"rays: {len(FORMS)} batches; {found.sum()} of {len(found)} rays of the first one hit")


if __name__ == "__main__":
    tool(main)
