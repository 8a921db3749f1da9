"""Limits of what the command line reads and writes. Each is far above what a scene or a design needs."""

from __future__ import annotations

#: Nested arrays and objects of JSON and TOML.
MOST_DEPTH = 64
#: Digits of a whole number.
MOST_DIGITS = 40
#: Characters of a text in a scene, a mesh's name or a ``--set``.
MOST_TEXT = 4096
#: Pixels of a picture that is read: twice the largest frame.
MOST_PIXELS = 2 * 4096 * 4096
#: Frames of one command.
MOST_FRAMES = 10_000
#: Designs of one sweep.
MOST_DESIGNS = 1_000

#: Bytes of scenes, configurations and a room's ``meta.json``.
MOST_TEXT_BYTES = 1 << 20
#: Bytes of pictures, arrays and hits.
MOST_PICTURE_BYTES = 1 << 30
#: Bytes of meshes, with what they refer to.
MOST_MESH_BYTES = 1 << 31
#: Bytes of a scene image, of which the header is a small part.
MOST_IMAGE_BYTES = 1 << 32
MOST_HEADER_BYTES = 1 << 24
#: Bytes of a liberty, unpacked.
MOST_LIBERTY_BYTES = 1 << 31

#: Metres and pixels of a room's camera; coordinates of a scene.
MOST_COORDINATE = 1e12

#: Characters of a word, and of a message, that are shown.
MOST_WORD = 240
MOST_MESSAGE = 1000
