"""Corruption of records of the column BVH memory, and of the registers that describe their sections."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from colonnade.common.types import Bytes
from colonnade.design.manifest import Field, Manifest
from colonnade.scene_image.header import ImageHeader

from colonnade_lab.evaluation.fuzz.cases import Case
from colonnade_lab.evaluation.fuzz.values import random_value


def corrupt_records(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    """Flip bits, set fields, redirect pointers, overwrite records, or move the borders of the sections."""
    if random.random() < 0.15:
        return _move_border(random, case, manifest)
    records = case.image.records.copy()
    mutations = (_flip_bits, _set_field, _set_field, _redirect, _overwrite, _copy)
    changes = []
    for _ in range(int(random.integers(1, 4))):
        mutate = mutations[int(random.integers(len(mutations)))]
        changes.append(mutate(random, records, case.image.header, manifest))
    return replace(case, image=replace(case.image, records=records)), "; ".join(changes)


def _flip_bits(random: np.random.Generator, records: Bytes, header: ImageHeader, manifest: Manifest) -> str:
    address, bit = int(random.integers(len(records))), int(random.integers(8 * records.shape[1]))
    records[address, bit // 8] ^= 1 << (bit % 8)
    return f"bit {bit} of record {address}"


def _set_field(random: np.random.Generator, records: Bytes, header: ImageHeader, manifest: Manifest) -> str:
    address = int(random.integers(len(records)))
    kind = _kind(address, header)
    fields = list(manifest.layouts[kind].fields.values())
    # Half of the changes go to the few fields that control the traversal
    control = [f for f in fields if f.name.split(".")[0].split("[")[0] in _CONTROL_FIELDS]
    candidates = control if control and random.random() < 0.5 else fields
    field = candidates[int(random.integers(len(candidates)))]
    value = random_value(random, *field.range)
    write_field(records[address], field, value)
    return f"{kind} {address}: {field.name} = {value}"


_CONTROL_FIELDS = {"exponent", "firstChild", "firstTriangles", "kinds", "count", "isClear", "material"}


def _redirect(random: np.random.Generator, records: Bytes, header: ImageHeader, manifest: Manifest) -> str:
    """Point a node to itself, or near a border of a section or the end of the memory."""
    address = int(random.integers(max(header.triangle_base, 1)))
    name = ("firstChild", "firstTriangles")[int(random.integers(2))]
    field = manifest.layouts["node"].fields[name]
    borders = (address, 0, header.triangle_base, header.attribute_base, header.record_count, field.range[1] + 1)
    value = borders[int(random.integers(len(borders)))] + int(random.integers(-4, 3))
    value = min(max(value, 0), field.range[1])
    write_field(records[address], field, value)
    return f"node {address}: {name} = {value}"


def _overwrite(random: np.random.Generator, records: Bytes, header: ImageHeader, manifest: Manifest) -> str:
    address = int(random.integers(len(records)))
    fill = (random.integers(0, 256, records.shape[1], dtype=np.uint8), np.uint8(0), np.uint8(255))
    choice = int(random.integers(3))
    records[address] = fill[choice]
    return f"record {address} is {('random', 'zeros', 'ones')[choice]}"


def _copy(random: np.random.Generator, records: Bytes, header: ImageHeader, manifest: Manifest) -> str:
    to, source = (int(address) for address in random.integers(len(records), size=2))
    records[to] = records[source]
    return f"record {to} is record {source}"


def _move_border(random: np.random.Generator, case: Case, manifest: Manifest) -> tuple[Case, str]:
    names = ("recordCount", "triangleBase", "triangleRecords", "attributeBase")
    name = f"scene.{names[int(random.integers(len(names)))]}"
    maximum = (1 << manifest.registers[name].width) - 1
    near = case.registers[name] + int(random.integers(-3, 4))
    value = min(max(near, 0), maximum) if random.random() < 0.7 else random_value(random, 0, maximum)
    return replace(case, registers={**case.registers, name: value}), f"{name} = {value}"


def _kind(address: int, header: ImageHeader) -> str:
    if address < header.triangle_base:
        return "node"
    return "triangles" if address < header.attribute_base else "attributes"


def write_field(record: Bytes, field: Field, value: int) -> None:
    """Set a field of a little-endian record to the low bits of a value."""
    word = int.from_bytes(record.tobytes(), "little")
    mask = ((1 << field.width) - 1) << field.offset
    word = (word & ~mask) | ((value << field.offset) & mask)
    record[:] = np.frombuffer(word.to_bytes(len(record), "little"), dtype=np.uint8)
