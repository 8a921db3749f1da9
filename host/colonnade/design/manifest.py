"""The manifest: what the generator tells the host about one design.

Nothing here knows an offset: record layouts, registers and number formats are read from ``manifest.json``.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common.errors import UserError

VERSION = 1


@dataclass(frozen=True)
class Field:
    """One field of a record or stream: ``width`` bits from bit ``offset`` (0 is the least significant)."""

    name: str
    offset: int
    width: int
    signed: bool
    fraction: int

    @property
    def range(self) -> tuple[int, int]:
        """Least and greatest value that fits."""
        return value_range(self.width, self.signed)


def value_range(width: int, signed: bool) -> tuple[int, int]:
    """Least and greatest integer of ``width`` bits."""
    return (-(1 << (width - 1)), (1 << (width - 1)) - 1) if signed else (0, (1 << width) - 1)


@dataclass(frozen=True)
class RecordLayout:
    """Where the fields of one kind of record lie; packs and unpacks whole columns of records.

    A record is ``bits`` wide, a multiple of 32, stored little-endian.
    """

    name: str
    bits: int
    fields: Mapping[str, Field]

    def pack(self, values: Mapping[str, npt.ArrayLike]) -> npt.NDArray[np.uint8]:
        """Records from integer columns: ``values`` maps a field to integers [n]; missing fields are 0.

        Returns:
            uint8 [n, bits / 8].

        Raises:
            ValueError: a field is unknown or a value does not fit.
        """
        columns = {name: np.asarray(column, dtype=np.int64) for name, column in values.items()}
        count = max((column.shape[0] for column in columns.values()), default=0)
        words = np.zeros((self.bits // 32, count), dtype=np.uint64)
        for name, column in columns.items():
            if name not in self.fields:
                raise ValueError(f"record {self.name} has no field {name}")
            field = self.fields[name]
            low, high = field.range
            if count and (int(column.min()) < low or int(column.max()) > high):
                raise ValueError(f"{self.name}.{name}: a value does not fit {field.width} bits")
            raw = column.astype(np.uint64) & np.uint64((1 << field.width) - 1)
            word, shift = divmod(field.offset, 32)
            words[word] |= (raw << np.uint64(shift)) & np.uint64(0xFFFFFFFF)
            for part in range(1, (shift + field.width + 31) // 32):
                words[word + part] |= (raw >> np.uint64(32 * part - shift)) & np.uint64(0xFFFFFFFF)
        return np.ascontiguousarray(words.T.astype("<u4")).view(np.uint8).reshape(count, self.bits // 8)

    def unpack(self, records: npt.NDArray[np.uint8]) -> dict[str, npt.NDArray[np.int64]]:
        """All fields of ``records`` (uint8 [n, bits / 8]) as int64 [n]."""
        words = np.ascontiguousarray(records).view("<u4").astype(np.uint64)
        result: dict[str, npt.NDArray[np.int64]] = {}
        for field in self.fields.values():
            word, shift = divmod(field.offset, 32)
            raw = words[:, word] >> np.uint64(shift)
            for part in range(1, (shift + field.width + 31) // 32):
                raw = raw | (words[:, word + part] << np.uint64(32 * part - shift))
            value = (raw & np.uint64((1 << field.width) - 1)).astype(np.int64)
            if field.signed:
                value = value - ((value >> (field.width - 1)) << field.width)
            result[field.name] = value
        return result

    def count_of(self, pattern: str) -> int:
        """Elements of an array of fields: ``count_of("kinds[{}]")`` is the arity."""
        count = 0
        while pattern.format(count) in self.fields:
            count += 1
        return count


@dataclass(frozen=True)
class Register:
    """A register: ``words`` consecutive 32-bit words from word ``address``, low word first.

    The device takes values above ``limit`` as ``limit``; None: it takes all that fit.
    """

    name: str
    address: int
    words: int
    width: int
    signed: bool
    access: str
    limit: int | None = None

    def encode(self, value: int) -> list[tuple[int, int]]:
        """The (address, word) writes that set it."""
        low, high = value_range(self.width, self.signed)
        if not low <= value <= high:
            raise ValueError(f"register {self.name}: {value} does not fit {self.width} bits")
        raw = value & ((1 << self.width) - 1)
        return [(self.address + i, (raw >> (32 * i)) & 0xFFFFFFFF) for i in range(self.words)]

    def decode(self, words: list[int]) -> int:
        """The value of its words, low word first."""
        raw = sum(word << (32 * i) for i, word in enumerate(words)) & ((1 << self.width) - 1)
        return raw - (1 << self.width) if self.signed and raw >> (self.width - 1) else raw


@dataclass(frozen=True)
class AttributeFormats:
    """What the physical-attribute memory's words hold.

    Attributes:
        sizes: Of the maps, by name.
        layouts: Of the words, by kind.
    """

    sizes: Mapping[str, int]
    layouts: Mapping[str, RecordLayout]


@dataclass(frozen=True)
class Manifest:
    """One generated design as the host sees it."""

    config: Mapping[str, Any]
    numbers: Mapping[str, int]
    record_bits: int
    layouts: Mapping[str, RecordLayout]
    registers: Mapping[str, Register]
    streams: Mapping[str, RecordLayout]
    memories: Mapping[str, Mapping[str, Any]]
    attributes: AttributeFormats | None
    format_hash: str
    config_hash: str

    @property
    def bvh(self) -> bool:
        """False for the exhaustive baseline, which has no nodes."""
        return bool(self.config["geometry"]["bvh"])

    @staticmethod
    def load(path: str | Path) -> Manifest:
        """Reads ``manifest.json``, or the one in a generated directory."""
        file = Path(path)
        if file.is_dir():
            file = file / "manifest.json"
        try:
            return Manifest.from_dict(json.loads(file.read_text(encoding="utf-8")))
        except FileNotFoundError:
            raise UserError(f"no manifest at {file}: run colonnade generate first") from None
        except (json.JSONDecodeError, UnicodeDecodeError, KeyError, TypeError, AttributeError):
            raise UserError(f"{file} is not a manifest of this version: generate the design again") from None

    @staticmethod
    def from_dict(data: Mapping[str, Any]) -> Manifest:
        """A manifest from its JSON object."""
        if data["version"] != VERSION:
            raise UserError(f"the manifest has version {data['version']}, this host reads {VERSION}: generate it again")
        bits = int(data["records"]["bits"])
        return Manifest(
            config=data["config"],
            numbers={key: int(value) for key, value in data["numbers"].items()},
            record_bits=bits,
            layouts={name: _layout(name, fields, bits) for name, fields in data["records"]["layouts"].items()},
            registers={r["name"]: _register(r) for r in data["registers"]["fields"]},
            streams={name: _layout(name, fields, None) for name, fields in data["streams"].items()},
            memories=data["memories"],
            attributes=_attributes(data.get("attributes")),
            format_hash=data["formatHash"],
            config_hash=data["configHash"],
        )


def _layout(name: str, fields: list[Mapping[str, Any]], bits: int | None) -> RecordLayout:
    parsed = {
        f["name"]: Field(f["name"], int(f["offset"]), int(f["width"]), bool(f["signed"]), int(f.get("fraction", 0)))
        for f in fields
    }
    used = max((field.offset + field.width for field in parsed.values()), default=0)
    return RecordLayout(name, bits if bits is not None else -(-used // 32) * 32, parsed)


def _attributes(data: Mapping[str, Any] | None) -> AttributeFormats | None:
    if data is None:
        return None
    sizes = {name: int(value) for name, value in data["sizes"].items()}
    return AttributeFormats(sizes, {name: _layout(name, fields, None) for name, fields in data["layouts"].items()})


def _register(data: Mapping[str, Any]) -> Register:
    limit = data.get("limit")
    return Register(
        data["name"],
        int(data["address"]),
        int(data["words"]),
        int(data["width"]),
        bool(data["signed"]),
        data["access"],
        None if limit is None else int(limit),
    )
