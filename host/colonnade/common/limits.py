"""Limits of what the command line reads and writes. Each is far above what a scene or a design needs."""

from __future__ import annotations

#: Nested arrays and objects of JSON and TOML.
MAX_DEPTH = 64
#: Digits of a whole number.
MAX_DIGITS = 40
#: Characters of a text in a scene, a mesh's name or a ``--set``.
MAX_TEXT = 4096
#: Pixels of a picture that is read: twice the largest frame.
MAX_PIXELS = 2 * 4096 * 4096
#: Frames of one command.
MAX_FRAMES = 10_000
#: Pixels of a frame that is written as a waveform; a pixel is some hundred kilobytes of it.
MAX_WAVEFORM_PIXELS = 4096
#: Designs of one sweep.
MAX_DESIGNS = 1_000

#: Bytes of scenes, configurations and a room's ``meta.json``.
MAX_TEXT_BYTES = 1 << 20
#: Bytes of pictures, arrays and hits.
MAX_PICTURE_BYTES = 1 << 30
#: Bytes of meshes, with what they refer to.
MAX_MESH_BYTES = 1 << 31
#: Bytes of a scene image, of which the header is a small part.
MAX_IMAGE_BYTES = 1 << 32
MAX_HEADER_BYTES = 1 << 24
#: Bytes of a liberty, unpacked.
MAX_LIBERTY_BYTES = 1 << 31

#: Metres and pixels of a room's camera; coordinates of a scene.
MAX_COORDINATE = 1e12

#: Characters of a word, and of a message, that are shown.
MAX_WORD = 240
MAX_MESSAGE = 1000
