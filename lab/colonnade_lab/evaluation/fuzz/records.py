"""Corruption of records of the column BVH memory, and of the registers that describe them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from colonnade.common.types import Bytes
from colonnade.design.manifest import Field, Manifest
from colonnade.scene_image.file import SceneImage

from colonnade_lab.evaluation.fuzz.cases import Case
from colonnade_lab.evaluation.fuzz.values import random_value


def corrupt_records(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """Flip bits, set fields, redirect pointers, overwrite records, or change the registers of the scene."""
    if random.random() < 0.15:
        return _move_border(random, case, manifest)
    records = case.image.records.copy()
    mutations = (_flip_bits, _set_field, _set_field, _redirect, _overwrite, _copy)
    changes = []
    for _ in range(int(random.integers(1, 4))):
        mutate = mutations[int(random.integers(len(mutations)))]
        changes.append(mutate(random, records, case.image, manifest))
    return replace(case, image=replace(case.image, records=records)), "; ".join(changes)


def _flip_bits(random: np.random.Generator, records: Bytes, image: SceneImage, manifest: Manifest) -> str:
    address, bit = int(random.integers(len(records))), int(random.integers(8 * records.shape[1]))
    records[address, bit // 8] ^= 1 << (bit % 8)
    return f"bit {bit} of record {address}"


def _set_field(random: np.random.Generator, records: Bytes, image: SceneImage, manifest: Manifest) -> str:
    address = int(random.integers(len(records)))
    kind = _kind(address, image)
    fields = list(manifest.layouts[kind].fields.values())
    # Half of the changes go to the few fields that control the traversal
    control = [f for f in fields if f.name.split(".")[0].split("[")[0] in _CONTROL_FIELDS]
    candidates = control if control and random.random() < 0.5 else fields
    field = candidates[int(random.integers(len(candidates)))]
    value = random_value(random, *field.range)
    write_field(records[address], field, value)
    return f"{kind} {address}: {field.name} = {value}"


_CONTROL_FIELDS = {"corner", "first", "nodes", "leaves", "format", "isClear", "material"}


def _redirect(random: np.random.Generator, records: Bytes, image: SceneImage, manifest: Manifest) -> str:
    """Point a node to itself, or near the end of the scene or of the memory."""
    nodes = [address for address in range(len(records)) if _kind(address, image) == "node"]
    address = nodes[int(random.integers(len(nodes)))] if nodes else 0
    field = manifest.layouts["node"].fields["first"]
    borders = (address, 0, image.header.record_count, field.range[1] + 1)
    value = borders[int(random.integers(len(borders)))] + int(random.integers(-4, 3))
    value = min(max(value, 0), field.range[1])
    write_field(records[address], field, value)
    return f"node {address}: first = {value}"


def _overwrite(random: np.random.Generator, records: Bytes, image: SceneImage, manifest: Manifest) -> str:
    address = int(random.integers(len(records)))
    fill = (random.integers(0, 256, records.shape[1], dtype=np.uint8), np.uint8(0), np.uint8(255))
    choice = int(random.integers(3))
    records[address] = fill[choice]
    return f"record {address} is {('random', 'zeros', 'ones')[choice]}"


def _copy(random: np.random.Generator, records: Bytes, image: SceneImage, manifest: Manifest) -> str:
    to, source = (int(address) for address in random.integers(len(records), size=2))
    records[to] = records[source]
    return f"record {to} is record {source}"


def _move_border(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    names = [name for name in ("recordCount", "root", "hasColours") if f"scene.{name}" in manifest.registers]
    name = f"scene.{names[int(random.integers(len(names)))]}"
    maximum = (1 << manifest.registers[name].width) - 1
    near = case.registers[name] + int(random.integers(-3, 4))
    value = min(max(near, 0), maximum) if random.random() < 0.7 else random_value(random, 0, maximum)
    return replace(case, registers={**case.registers, name: value}), f"{name} = {value}"


def _kind(address: int, image: SceneImage) -> str:
    if image.source_faces[2 * address] >= 0:
        return "nearPair"
    return "colours" if address and image.header.has_colours and image.source_faces[2 * address - 2] >= 0 else "node"


def write_field(record: Bytes, field: Field, value: int) -> None:
    """Set a field of a little-endian record to the low bits of a value."""
    word = int.from_bytes(record.tobytes(), "little")
    mask = ((1 << field.width) - 1) << field.offset
    word = (word & ~mask) | ((value << field.offset) & mask)
    record[:] = np.frombuffer(word.to_bytes(len(record), "little"), dtype=np.uint8)
