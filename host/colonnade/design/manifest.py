"""The manifest of a generated design: record layouts, registers and number formats.

The generator writes ``manifest.json``; the host takes every width, offset and address from it.
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

#: The newest version of manifests that is read; older ones are as well.
VERSION = 3


@dataclass(frozen=True)
class Field:
    """One field of a record or stream: ``width`` bits from bit ``offset`` (bit 0 is the least significant)."""

    name: str
    offset: int
    width: int
    signed: bool
    fraction: int

    @property
    def range(self) -> tuple[int, int]:
        """The smallest and the largest value of the field."""
        return value_range(self.width, self.signed)


def value_range(width: int, signed: bool) -> tuple[int, int]:
    """The smallest and the largest integer of ``width`` bits."""
    return (-(1 << (width - 1)), (1 << (width - 1)) - 1) if signed else (0, (1 << width) - 1)


@dataclass(frozen=True)
class RecordLayout:
    """The field layout of one kind of record; packs and unpacks arrays of records.

    A record is ``bits`` wide, a multiple of 32, stored little-endian.
    """

    name: str
    bits: int
    fields: Mapping[str, Field]

    def pack(self, values: Mapping[str, npt.ArrayLike]) -> npt.NDArray[np.uint8]:
        """Pack records from one integer array [n] for each field name; missing fields are 0.

        Returns:
            uint8 [n, bits / 8].

        Raises:
            ValueError: A field is unknown or a value does not fit its field.
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
        """Unpack records, uint8 [n, bits / 8], into int64 [n] for each field name."""
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


@dataclass(frozen=True)
class Register:
    """A register: ``words`` consecutive 32-bit words from word ``address``, low word first.

    The device clamps larger values to ``limit``; None: no clamping.
    """

    name: str
    address: int
    words: int
    width: int
    signed: bool
    access: str
    limit: int | None = None

    def encode(self, value: int) -> list[tuple[int, int]]:
        """The (address, word) writes that set the register to a value."""
        low, high = value_range(self.width, self.signed)
        if not low <= value <= high:
            raise ValueError(f"register {self.name}: {value} does not fit {self.width} bits")
        raw = value & ((1 << self.width) - 1)
        return [(self.address + i, (raw >> (32 * i)) & 0xFFFFFFFF) for i in range(self.words)]

    def decode(self, words: list[int]) -> int:
        """The register's value from its words, low word first."""
        raw = sum(word << (32 * i) for i, word in enumerate(words)) & ((1 << self.width) - 1)
        return raw - (1 << self.width) if self.signed and raw >> (self.width - 1) else raw


@dataclass(frozen=True)
class AttributeFormats:
    """Formats of the physical-attribute memory, or of the texture memory.

    Attributes:
        sizes: Sizes of the maps, by name.
        layouts: Layouts of the memory words, by kind.
    """

    sizes: Mapping[str, int]
    layouts: Mapping[str, RecordLayout]


@dataclass(frozen=True)
class Manifest:
    """The manifest's content."""

    config: Mapping[str, Any]
    numbers: Mapping[str, int]
    record_bits: int
    layouts: Mapping[str, RecordLayout]
    registers: Mapping[str, Register]
    streams: Mapping[str, RecordLayout]
    memories: Mapping[str, Mapping[str, Any]]
    attributes: AttributeFormats | None
    texture: AttributeFormats | None
    format_hash: str
    config_hash: str

    @property
    def bvh(self) -> bool:
        """Whether the design traverses a BVH; False for the linear-scan baseline, which has no nodes."""
        return bool(self.config["geometry"]["bvh"])

    @property
    def corner_colours(self) -> bool:
        """Whether faces have a colour at each corner."""
        return bool(self.config["geometry"]["cornerColours"])

    @property
    def emission(self) -> bool:
        """Whether diffuse materials emit light."""
        return bool(self.config["frame"]["emission"])

    @property
    def gathers(self) -> bool:
        """Whether diffuse surfaces gather light."""
        return bool(self.config["frame"].get("gather", False))

    @property
    def has_queries(self) -> bool:
        """Whether the design answers rays of applications in place of frames (in older manifests `frame.rays`)."""
        return self.config.get("queries") is not None or bool(self.config["frame"].get("rays", False))

    @property
    def format_words(self) -> list[int]:
        """The format hash as eight words of 32 bits; the first has its first eight digits."""
        return [int(self.format_hash[start : start + 8], 16) for start in range(0, 64, 8)]

    @staticmethod
    def load(path: str | Path) -> Manifest:
        """Read ``manifest.json``, given the file or its folder.

        Raises:
            UserError: The file is missing, no manifest, or newer than this host.
        """
        file = Path(path)
        if file.is_dir():
            file = file / "manifest.json"
        try:
            return Manifest.from_dict(json.loads(file.read_text(encoding="utf-8")))
        except FileNotFoundError:
            raise UserError(f"no manifest at {file}: run colonnade generate first") from None
        except (json.JSONDecodeError, UnicodeDecodeError, KeyError, TypeError, AttributeError):
            raise UserError(f"{file} is not a manifest: generate the design again") from None

    @staticmethod
    def from_dict(data: Mapping[str, Any]) -> Manifest:
        """Build a manifest from its JSON object."""
        if data["version"] > VERSION:
            raise UserError(f"the manifest has version {data['version']}, this host reads {VERSION} at most: update it")
        if data["version"] < VERSION:
            raise UserError(
                f"the manifest has the formats of version {data['version']}, this host packs version"
                f" {VERSION}: generate it again"
            )
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
            texture=_attributes(data.get("texture")),
            format_hash=data["formatHash"],
            config_hash=data["configHash"],
        )


def field_places(layouts: Mapping[str, RecordLayout]) -> dict[str, dict[str, tuple[int, int, bool]]]:
    """Offset, width and signedness of each field, by layout and field name."""
    return {
        name: {field.name: (field.offset, field.width, field.signed) for field in layout.fields.values()}
        for name, layout in layouts.items()
    }


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
