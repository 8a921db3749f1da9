"""The scene image file, with the memory contents of a packed scene.

The layout, little-endian, is: 8 bytes magic; uint32 length of the header; header as JSON; records; face table, int32
for each packed id; words of the memories of a room and of the textures, in the header's order; SHA-256 of all preceding
bytes. The frame registers, such as camera and lights, are not part of the file.
"""

from __future__ import annotations

import hashlib
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import numpy.typing as npt

from colonnade.common.atomic_files import check_folder, check_writable, made_folder, replacing
from colonnade.common.errors import UserError
from colonnade.common.input_files import exists, is_folder, parse_json, read_input
from colonnade.common.limits import MAX_HEADER_BYTES, MAX_IMAGE_BYTES
from colonnade.design.manifest import Manifest
from colonnade.scene_image.header import ImageHeader
from colonnade.scene_image.header_checks import check_header

MAGIC = b"CLNDIMG5"
FILE_NAME = "scene.image"
_DIGEST_BYTES = 32
_ADVICE = "pack the scene again"


@dataclass(frozen=True)
class LoadSection:
    """Contents of one memory of the physical-attribute memory.

    Attributes:
        memory: Its name in the manifest, e.g. ``albedo.palette``.
        words: uint8 [words, word bytes], low byte first; row i is loaded to address i.
    """

    memory: str
    words: npt.NDArray[np.uint8]


class Loads(Protocol):
    """What a device loads: `records` and `attributes` of a `SceneImage`."""

    @property
    def records(self) -> npt.NDArray[np.uint8]:
        """See `SceneImage`."""

    @property
    def attributes(self) -> tuple[LoadSection, ...]:
        """See `SceneImage`."""


class Moves(Protocol):
    """What moves the mesh of an image."""

    @property
    def seconds(self) -> float:
        """How long it moves."""

    def posed(self, image: SceneImage, progress: float) -> SceneImage:
        """The image, of any pose, at a part of the motion, 0.0 to 1.0."""


@dataclass(frozen=True)
class SceneImage:
    """The content of a scene image file.

    Attributes:
        header: Description of the content.
        records: uint8 [record_count, record_bits / 8], little-endian.
        source_faces: int32 [2 · record_count], index in the mesh file of each packed id's face; −1 without one.
        attributes: A room's maps, textures and light cube in the order of `ImageHeader.memories`.
        moves: What moves the mesh, which files do not have; None: nothing.
    """

    header: ImageHeader
    records: npt.NDArray[np.uint8]
    source_faces: npt.NDArray[np.int32]
    attributes: tuple[LoadSection, ...] = ()
    moves: Moves | None = None

    def posed(self, progress: float) -> SceneImage:
        """The image at a part of its clip, 0.0 to 1.0; itself if nothing moves. A line tells of lost normals."""
        return self if self.moves is None else self.moves.posed(self, progress)

    def save(self, path: str | Path) -> Path:
        """Write the file atomically; returns its path.

        Args:
            path: A file, or a folder for ``scene.image``; missing folders are made.
        """
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
        """Read a scene image.

        Args:
            path: A file, or a folder with ``scene.image``.
            manifest: Refuse an image that this design cannot render.

        Raises:
            UserError: The file is missing, invalid, corrupt, or packed for another design.
        """
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
        faces_end = records_end + 8 * header.record_count
        memories = header.memories
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
    """Refuse an image that the design cannot render."""
    if header.format_hash != manifest.format_hash:
        raise UserError(
            f"{file} was packed for another format ({header.format_hash[:12]}, the hardware's is"
            f" {manifest.format_hash[:12]}): pack the scene again for this configuration"
        )
    memories = header.memories
    if header.record_bits != manifest.record_bits or any(part.memory not in manifest.memories for part in memories):
        raise UserError(f"{file} is corrupt (its header does not match the hardware's format): {_ADVICE}")
    depth = int(manifest.memories["columnBvh"]["depth"])
    enough = 1 << (header.record_count - 1).bit_length()
    if header.record_count > depth:
        raise UserError(
            f"{file} holds {header.record_count:,} records, columnBvhMemory.depth is {depth:,}: raise it to {enough}"
        )
    stack_depth = int(manifest.config["columnBvhMemory"]["stackDepth"])
    if header.tree is not None and header.tree.stack_bound > stack_depth:
        raise UserError(
            f"{file} needs a stack of {header.tree.stack_bound} entries, columnBvhMemory.stackDepth is {stack_depth}:"
            f" raise it to {header.tree.stack_bound}"
        )
    _check_memories_fit(header, manifest, file)


def _check_memories_fit(header: ImageHeader, manifest: Manifest, file: Path) -> None:
    """Refuse maps that do not fill the design's memories exactly: words would be lost or undefined."""
    available = {memory.memory: (memory.words, memory.word_bytes) for memory in header.memories}
    shapes = {
        name: shape
        for name, shape in manifest.memories.items()
        if name.startswith("texture.")
        or (name.startswith("light.") and header.light)
        or (name.startswith(("albedo.", "normals.", "planes.")) and header.room is not None)
    }
    needed = {name: (int(shape["depth"]), -(-int(shape["bits"]) // 8)) for name, shape in shapes.items()}
    for name in sorted(available.keys() | needed.keys()):
        (words, size), (depth, needed_size) = available.get(name, (0, 0)), needed.get(name, (0, 0))
        if (words, size) != (depth, needed_size):
            raise UserError(
                f"{file} holds {words:,} words of {size} bytes for the memory {name!r}, the hardware has {depth:,} of"
                f" {needed_size}: {_ADVICE}"
            )


def _header(data: bytes, file: Path) -> tuple[ImageHeader, int]:
    """Read the header; also returns the offset of the records."""
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
    """The image file of a path: a folder or a name without a suffix means ``scene.image`` in it."""
    return path / FILE_NAME if is_folder(path) or not path.suffix else path


def check_image_file(file: Path) -> None:
    """Refuse an output that would replace anything but a scene image."""
    if exists(file.parent):
        check_folder(file.parent)
    if not exists(file):
        return
    check_writable(file)
    with file.open("rb") as stream:
        magic = stream.read(len(MAGIC) - 1)
    if magic and magic != MAGIC[:-1]:
        raise UserError(f"{file} is not a scene image and would be replaced: name another output")
