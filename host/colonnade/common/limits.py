"""Size limits of inputs and outputs. Each is far above what a scene or a design needs."""

from __future__ import annotations

#: Nesting levels of JSON and TOML.
MAX_DEPTH = 64
#: Lists and objects of a JSON document.
MAX_GROUPS = 1 << 20
#: Digits of an integer.
MAX_DIGITS = 40
#: Characters of a string in a scene, of a mesh's name, or of a ``--set``.
MAX_TEXT = 4096
#: Pixels of an input picture: twice the largest frame.
MAX_PIXELS = 2 * 4096 * 4096
#: Pixels of all textures of a mesh in its files; and kept ones, 128 for each texel of the texture memory.
MAX_TEXTURE_PIXELS = 1 << 29
KEPT_TEXTURE_PIXELS = 1 << 25
#: Frames of one command.
MAX_FRAMES = 10_000
#: Samples of a pixel.
MAX_SAMPLES = 1024
#: Pixels of a frame that is recorded as a waveform; each takes on the order of 100 kB.
MAX_WAVEFORM_PIXELS = 4096
#: Points of a study.
MAX_DESIGNS = 1_000

#: Frames of a capture, and pixels of its depth.
MAX_CAPTURE_FRAMES = 100_000
MAX_DEPTH_PIXELS = 1 << 22

#: Bytes of a text file of a capture, and of a picture or stream in it.
MAX_CAPTURE_TEXT_BYTES = 1 << 25
MAX_MEMBER_BYTES = 1 << 26

#: Bytes of a scene, a configuration or a room's ``meta.json``.
MAX_TEXT_BYTES = 1 << 20
#: Bytes of a picture, array or hits file.
MAX_PICTURE_BYTES = 1 << 30
#: Bytes of a mesh, with the files that it references.
MAX_MESH_BYTES = 1 << 31
#: Triangles of a mesh with its instances: twice the largest memory's.
MAX_TRIANGLES = 1 << 24
#: Bytes of a scene image and of its header.
MAX_IMAGE_BYTES = 1 << 32
MAX_HEADER_BYTES = 1 << 24
#: Bytes of an uncompressed Liberty file.
MAX_LIBERTY_BYTES = 1 << 31

#: Magnitude of a scene's coordinates, and of a room camera's values in metres and pixels.
MAX_COORDINATE = 1e12

#: Characters shown of a word, and of a message.
MAX_WORD = 240
MAX_MESSAGE = 1000
