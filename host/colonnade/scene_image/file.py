"""The scene image: one file with the memory contents of a packed scene.

Layout, little-endian: 8 bytes magic; uint32 length of the header; header as JSON; records; the face table, int32 for
each packed id; words of a room's memories, in the header's order; SHA-256 of all that went before. The placement of
camera, light and object is no part of it.
"""

from __future__ import annotations

import hashlib
import json
import struct
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from colonnade.common.atomic_files import check_folder, check_writable, made_folder, replacing
from colonnade.common.errors import UserError
from colonnade.common.input_files import exists, is_folder, parse_json, read_input
from colonnade.common.limits import MAX_HEADER_BYTES, MAX_IMAGE_BYTES
from colonnade.design.manifest import Manifest
from colonnade.mesh.materials import MeshMaterial
from colonnade.mesh.mesh import Extent
from colonnade.scene_image.bvh import TreeStatistics
from colonnade.scene_image.header import check_header

MAGIC = b"CLNDIMG2"
FILE_NAME = "scene.image"
_DIGEST_BYTES = 32
_ADVICE = "pack the scene again"


@dataclass(frozen=True)
class ObjectFrame:
    """How the mesh lies in the object's cube: ``unit_vertex = (vertex - offset) * scale``.

    Attributes:
        scale: Vertex units for one mesh unit.
        offset: Mesh coordinates of the cube's corner (0, 0, 0).
    """

    scale: float
    offset: tuple[float, float, float]


@dataclass(frozen=True)
class LoadedMemory:
    """How many words the image has for a memory.

    Attributes:
        memory: Its name in the manifest, such as ``albedo.palette``.
        words: From address 0.
        word_bytes: The least that hold the memory's word.
    """

    memory: str
    words: int
    word_bytes: int

    @property
    def bytes(self) -> int:
        """In the file."""
        return self.words * self.word_bytes


@dataclass(frozen=True)
class EnvironmentHeader:
    """The room whose maps an image holds.

    Attributes:
        name: Of the room.
        depth_unit: Metres: the plane map's w is this divided by the depth.
        memories: Of the physical-attribute memory, in the file's order.
    """

    name: str
    depth_unit: float
    memories: tuple[LoadedMemory, ...]


@dataclass(frozen=True)
class ImageHeader:
    """What a scene image holds.

    Attributes:
        format_hash: Of the manifest it was packed for.
        mesh: Name of the mesh.
        source_triangles: Faces of the mesh's file.
        triangles: Packed ones; ids run from 0.
        record_bits, record_count: Of the column memory.
        triangle_base, triangle_records, attribute_base: Sections, in records.
        bounds_low, bounds_high: The object's tight box, vertex units, inclusive.
        frame: How the mesh lies in the object's cube.
        extent: Box and outline in mesh space, for framing.
        materials: Of its faces, by their material's number.
        tree: None for an image without nodes.
        room: None for an image without a room's maps.
    """

    format_hash: str
    mesh: str
    source_triangles: int
    triangles: int
    record_bits: int
    record_count: int
    triangle_base: int
    triangle_records: int
    attribute_base: int
    bounds_low: tuple[int, int, int]
    bounds_high: tuple[int, int, int]
    frame: ObjectFrame
    extent: Extent
    materials: tuple[MeshMaterial, ...]
    tree: TreeStatistics | None
    room: EnvironmentHeader | None = None

    def to_json(self) -> dict[str, Any]:
        """A JSON object; floats survive it unchanged."""
        data = asdict(self)
        data["extent"] = {name: np.asarray(value).tolist() for name, value in data["extent"].items()}
        return data

    @staticmethod
    def from_json(data: dict[str, Any]) -> ImageHeader:
        """The header of a JSON object that `to_json` made."""
        values = dict(data)
        values["bounds_low"] = tuple(values["bounds_low"])
        values["bounds_high"] = tuple(values["bounds_high"])
        frame = values["frame"]
        values["frame"] = ObjectFrame(frame["scale"], tuple(frame["offset"]))
        extent = {name: np.array(value, dtype=np.float64) for name, value in values["extent"].items()}
        values["extent"] = Extent(**extent)
        values["materials"] = tuple(
            MeshMaterial(**{**material, "albedo": tuple(material["albedo"])}) for material in values["materials"]
        )
        values["tree"] = TreeStatistics(**values["tree"]) if values["tree"] else None
        if environment := values["room"]:
            memories = tuple(LoadedMemory(**memory) for memory in environment["memories"])
            values["room"] = EnvironmentHeader(environment["name"], environment["depth_unit"], memories)
        return ImageHeader(**values)


@dataclass(frozen=True)
class LoadSection:
    """Contents of one memory of the physical-attribute memory.

    Attributes:
        memory: Its name in the manifest, which knows its load target.
        words: uint8 [words, bytes of a word], low byte first; row i goes to address i.
    """

    memory: str
    words: npt.NDArray[np.uint8]


@dataclass(frozen=True)
class SceneImage:
    """Memory contents and header.

    Attributes:
        header: What it holds.
        records: uint8 [record_count, record_bits / 8], little-endian.
        source_faces: int32 [triangles], the face in the mesh's file of each packed id.
        attributes: A room's maps, memory by memory as `EnvironmentHeader.memories` has them; empty without a room.
    """

    header: ImageHeader
    records: npt.NDArray[np.uint8]
    source_faces: npt.NDArray[np.int32]
    attributes: tuple[LoadSection, ...] = ()

    def save(self, path: str | Path) -> Path:
        """Writes the file, or ``scene.image`` in a folder, which is made; returns its path. Whole or not at all."""
        file = image_file(Path(path))
        header = json.dumps(self.header.to_json(), separators=(",", ":"), sort_keys=True).encode()
        parts = [MAGIC, struct.pack("<I", len(header)), header]
        parts += [self.records.tobytes(), self.source_faces.astype("<i4").tobytes()]
        parts += [section.words.tobytes() for section in self.attributes]
        digest = hashlib.sha256()
        with made_folder(file.parent), replacing(file) as stream:
            for part in parts:
                digest.update(part)
                stream.write(part)
            stream.write(digest.digest())
        return file

    @staticmethod
    def load(path: str | Path, manifest: Manifest | None = None) -> SceneImage:
        """Reads a scene image; with a manifest, one that was packed for another format is refused."""
        file = Path(path)
        if is_folder(file):
            file = file / FILE_NAME
        missing = f"there is no scene image {file}: run colonnade pack first"
        data = read_input(file, "the scene image", MAX_IMAGE_BYTES, missing)
        if data[: len(MAGIC)] != MAGIC:
            if data[: len(MAGIC) - 1] == MAGIC[:-1]:
                raise UserError(f"{file} is a scene image of another version: {_ADVICE}")
            raise UserError(f"{file} is not a scene image")
        header, start = _header(data, file)
        records_end = start + header.record_count * header.record_bits // 8
        faces_end = records_end + 4 * header.triangles
        memories = header.room.memories if header.room else ()
        end = faces_end + sum(memory.bytes for memory in memories)
        if len(data) < end + _DIGEST_BYTES:
            raise UserError(f"{file} is truncated ({len(data):,} of {end + _DIGEST_BYTES:,} bytes): {_ADVICE}")
        if len(data) > end + _DIGEST_BYTES or hashlib.sha256(data[:end]).digest() != data[end:]:
            raise UserError(f"{file} is corrupt (its checksum does not match): {_ADVICE}")
        if manifest is not None:
            _check_fits(header, manifest, file)
        raw = np.frombuffer(data, dtype=np.uint8)
        records = raw[start:records_end].reshape(header.record_count, header.record_bits // 8)
        faces = np.frombuffer(data[records_end:faces_end], dtype="<i4").astype(np.int32)
        attributes, first = [], faces_end
        for memory in memories:
            words = raw[first : first + memory.bytes].reshape(memory.words, memory.word_bytes)
            attributes.append(LoadSection(memory.memory, words))
            first += memory.bytes
        return SceneImage(header, records, faces, tuple(attributes))


def _check_fits(header: ImageHeader, manifest: Manifest, file: Path) -> None:
    """Refuse an image that the manifest's hardware cannot render."""
    if header.format_hash != manifest.format_hash:
        raise UserError(
            f"{file} was packed for another format ({header.format_hash[:12]}, the hardware has"
            f" {manifest.format_hash[:12]}): pack the scene again for this configuration"
        )
    memories = header.room.memories if header.room else ()
    if header.record_bits != manifest.record_bits or any(held.memory not in manifest.memories for held in memories):
        raise UserError(f"{file} is corrupt (its header does not match the hardware's format): {_ADVICE}")
    depth = int(manifest.memories["columnBvh"]["depth"])
    if header.record_count > depth:
        raise UserError(f"{file} holds {header.record_count:,} records, columnBvhMemory.depth is {depth:,}: raise it")
    stack_depth = int(manifest.config["columnBvhMemory"]["stackDepth"])
    if header.tree is not None and header.tree.stack_bound > stack_depth:
        raise UserError(
            f"{file} needs a stack of {header.tree.stack_bound} entries, columnBvhMemory.stackDepth is {stack_depth}:"
            " raise it"
        )
    if header.room is not None:
        _check_environment_fits(header.room, manifest, file)


def _check_environment_fits(environment: EnvironmentHeader, manifest: Manifest, file: Path) -> None:
    """Refuse maps that do not fill the hardware's memories: words beyond a memory would be lost, others undefined."""
    held = {memory.memory: (memory.words, memory.word_bytes) for memory in environment.memories}
    places = {name: place for name, place in manifest.memories.items() if name != "columnBvh"}
    needed = {name: (int(place["depth"]), -(-int(place["bits"]) // 8)) for name, place in places.items()}
    for name in sorted(held.keys() | needed.keys()):
        (words, size), (depth, maximum) = held.get(name, (0, 0)), needed.get(name, (0, 0))
        if (words, size) != (depth, maximum):
            raise UserError(
                f"{file} holds {words:,} words of {size} bytes for the memory {name!r}, the hardware has {depth:,} of"
                f" {maximum}: {_ADVICE}"
            )


def _header(data: bytes, file: Path) -> tuple[ImageHeader, int]:
    """The header and where the records begin."""
    start = len(MAGIC) + 4
    if len(data) < start:
        raise UserError(f"{file} is truncated ({len(data)} bytes): {_ADVICE}")
    (length,) = struct.unpack_from("<I", data, len(MAGIC))
    if len(data) < start + length + _DIGEST_BYTES:
        raise UserError(f"{file} is truncated ({len(data):,} bytes): {_ADVICE}")
    corrupt = UserError(f"{file} is corrupt (its header cannot be read): {_ADVICE}")
    if length > MAX_HEADER_BYTES:
        raise corrupt
    try:
        header = parse_json(data[start : start + length], "the header")
        check_header(header)
        return ImageHeader.from_json(header), start + length
    except (UserError, ValueError, KeyError, TypeError, AttributeError, OverflowError):
        raise corrupt from None


def image_file(path: Path) -> Path:
    """The file that a folder or a file's name stands for: names without a suffix are folders."""
    return path / FILE_NAME if is_folder(path) or not path.suffix else path


def check_image_file(file: Path) -> None:
    """Refuse an output that would replace anything but a scene image."""
    if exists(file.parent):
        check_folder(file.parent)
    if not exists(file):
        return
    check_writable(file)
    with file.open("rb") as stream:
        begin = stream.read(len(MAGIC) - 1)
    if begin and begin != MAGIC[:-1]:
        raise UserError(f"{file} is no scene image, and would be replaced: name another output")
