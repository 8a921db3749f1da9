"""Mesh files as data: for each what its reader makes of it, on every machine, in the host and in the browser tab."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from textured_files import FOUR, png


@dataclass(frozen=True)
class Case:
    """A file with those beside it.

    Attributes:
        content: The file.
        says: What its refusal says after its name; None: it is read.
        digest: The beginning of the digest of its surface (`test_read_cases`), "" for a refusal.
        notes: What is not shown of it.
        beside: Other files, by name.
    """

    content: str | bytes
    says: str | None = None
    digest: str = ""
    notes: tuple[str, ...] = ()
    beside: Mapping[str, str | bytes] = field(default_factory=dict)

    def write(self, folder: Path, name: str) -> Path:
        """Write it and the others into a folder of its own."""
        folder.mkdir()
        for own, content in ((name, self.content), *self.beside.items()):
            (folder / own).write_bytes(content if isinstance(content, bytes) else content.encode())
        return folder / name


L = "v 0 0 0\nv 2 0 0\nv 2 .5 0\nv 1 5e-1 0\nv 1 2 0\nv 0 2 0\n"
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
HEAD = "ply\nformat {} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n{}end_header\n"
FACES = "element face 2\nproperty list uchar int vertex_indices\n"
CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
POINTS = "".join(f"{x} {y} {z}\n" for x, y, z in CORNERS)
PACKED = b"".join(struct.pack("<3f", *corner) for corner in CORNERS)
ASCII = HEAD.format("ascii", FACES)
FACET = struct.pack("<12fH", 0, 0, 1, *(value for corner in CORNERS[:3] for value in corner), 0)
SOLID = "solid a\nfacet normal 0 0 1\nouter loop\n{}endloop\nendfacet\nendsolid a\n"

CASES = {
    "concave.obj": Case(L + "f 1 2 3 4 5 6\n", digest="42c53bb84d7e"),
    "concave.off": Case("OFF\n6 1 0\n" + L.replace("v ", "") + "6 0 1 2 3 4 5\n", digest="97c4fcdc6062"),
    "relative.obj": Case(
        "# CR only\r" + SQUARE.replace("\n", "\r") + "vn 0 0 2\rf -4/1/-1 -3/2/-1 -2/3/1 -1/4/1\r",
        digest="95fb024be38f",
    ),
    "continued.obj": Case(SQUARE + "f 1 2 \\\n 3 4 # of four corners\n", digest="4ccfc3e6b107"),
    "precise.obj": Case(
        "v 0.1234567890123456789 1e-320 -0\n"
        "v 1.7976931348623157e+1 1e+1 .1e1\nv 9.007199254740993 900719925474099.3e-14 8\nf 1 2 3\n",
        digest="d44d7fceb727",
    ),
    "wide.obj": Case("\ufeff" + SQUARE + "f 1 2 3 4\n".replace("\n", "\r\n"), digest="4ccfc3e6b107"),
    "utf16.obj": Case((SQUARE + "f 1 2 3 4\n").encode("utf-16"), digest="4ccfc3e6b107"),
    "coloured.obj": Case(
        "v 0 0 0 1 0 .5\nv 1 0 0 0 1 2\nv 0 1 0 nan 0 1\nf 1 2 3\n",
        digest="1c2b4f7b2c6b",
        notes=(
            "1 colour of a vertex is black: colours are finite numbers",
            "1 colour of a vertex is clipped: colours are from 0 to 1",
        ),
    ),
    "partly-coloured.obj": Case(
        "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0 1 0 0 1\nf 1 2 3\nf 1 2\nl 1 2\np 1\ns 1\ns 2\n",
        digest="c55d53904e19",
        notes=(
            "2 colours of vertices are not shown: not all vertices have one",
            "1 point primitive is not shown: only faces are rendered",
            "1 line primitive is not shown: only faces are rendered",
            "2 smoothing groups are not used: edges are smooth up to the crease angle",
            "1 face of fewer than three corners is left out: they have no area",
        ),
    ),
    "textured.obj": Case(
        "mtllib m.mtl none.mtl\n"
        + SQUARE
        + "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 1 3 4\nusemtl c\nf 1/1 3/3 4/4\nusemtl d\nf 1 2 4\n",
        beside={
            "m.mtl": "# Blender\nnewmtl a\nKd 0.5 1 1\nmap_Kd -s 2 2 -o 0.5 -bm 1 a.png\nd 0.7\nKs 1 1 1\n"
            "newmtl b\nKd 0.2 0.3 0.4\nPm 1\nPr 0.2\nmap_Kd A.PNG\n"
            "newmtl c\nKd 0 0 0\nmap_Kd lost.png\nTf 1 1 1\nd 0.2\n",
            "a.png": png(FOUR),
        },
        digest="8b30418025a5",
        notes=(
            "1 file of materials is missing: faces have the default material",
            "1 option of a texture map is not used: only -s, -o and -clamp are",
            "1 picture of a texture is missing (lost.png): surfaces have their base colour",
            "1 partly transparent material is not blended: from alpha 1/2 on it is opaque, else a tinted pane"
            " or not shown",
            "1 glossy material is diffuse: highlights are not rendered",
            "1 material name is not defined: faces have the default material",
            "1 face of a textured material is untextured: texture coordinates are missing",
        ),
    ),
    "cut-out.obj": Case(
        "mtllib m.mtl\n" + SQUARE + "usemtl a\nf 1/1 2/2 3/3 4/4\n",
        beside={"m.mtl": "newmtl a\nKd 1 1 1\nmap_Kd a.png\nmap_d a.png\nKe 3 1 0\nnewmtl b\n", "a.png": png(FOUR)},
        digest="a5282895f4a2",
        notes=("1 material shines brighter than the hardware shows: the largest channel of an emission is 1",),
    ),
    "srgb.obj": Case(
        "mtllib m.mtl\nusemtl a\n" + SQUARE + "f 1 2 3\n",
        beside={"m.mtl": "newmtl a\nKd 0.5 x 2\nNs -2\nillum x\n"},
        digest="b4ba3c05c39d",
        notes=(
            "2 values of materials are not read (the first is Kd 0.5 x 2): a colour has three numbers, others have one",
            "1 material's negative Ns is taken as 0: highlights are not rendered",
        ),
    ),
    "unknown.obj": Case(
        "usemtl a\n" + SQUARE + "f 1 2 3 4\n",
        digest="4ccfc3e6b107",
        notes=("1 material name is not defined: faces have the default material",),
    ),
    "crossed.obj": Case(
        "v 0 3 0\nv 2 -2 0\nv -3 1 0\nv 3 1 0\nv -2 -2 0\nf 1 2 3 4 5\n",
        digest="df61cb7e98a4",
        notes=("1 polygon crosses or folds over itself: triangles may overlap",),
    ),
    "zero.obj": Case(SQUARE + "f 0 1 2\n", "a face names vertex 0; OBJ files number vertices from 1"),
    "beyond.obj": Case(SQUARE + "f 1 2 5\n", "a face names vertex 5, but the file has 4 vertices"),
    "before.obj": Case("v 0 0 0\nf -1 -2 1\nv 1 1 1\n", "a relative index of a face names a vertex before the first"),
    "letters.obj": Case(SQUARE + "f a b c\n", "a vertex index of a face is not an integer"),
    "no-number.obj": Case("v 1 2 x\nf 1 1 1\n", "a value is not valid: x is no number"),
    "short.obj": Case("v 1 2\nf 1 1 1\n", "a value is not valid: a vertex or normal has fewer than 3 numbers"),
    "infinite.obj": Case(
        "v 1e999 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertex 1 is not a finite number: repair the file"
    ),
    "lines.obj": Case(SQUARE + "l 1 2\n", "has no faces: 1 line primitive is not shown: only faces are rendered"),
    "control.obj": Case(b"v 1 2 \x1b[2J\0x\nf 1 1 1\n", r"a value is not valid: \x1b[2J\x00x is no number"),
    "negative.obj": Case(
        "mtllib m.mtl\n" + SQUARE + "f 1 2 3\n",
        "m.mtl, line 2: Kd -1 0 0: a material's numbers must be finite and not negative",
        beside={"m.mtl": "newmtl a\n Kd -1 0 0 \n"},
    ),
    "plain.ply": Case(ASCII + POINTS + "3 0 1 2\n3 0 2 3\n", digest="bfcf53c5320d"),
    "free.ply": Case(ASCII + (POINTS + "3 0 1 2\n3 0 2 3\n").replace(" ", "\n\n"), digest="bfcf53c5320d"),
    "surplus.ply": Case(
        ASCII + POINTS.replace("\n", " 6 0.5\n") + "3 0 1 2 7\n3 0 2 3\n",
        digest="bfcf53c5320d",
        notes=("9 values beyond those of the header are not read: a row has those of the header",),
    ),
    "big.ply": Case(
        HEAD.format("binary_big_endian", FACES).encode()
        + b"".join(struct.pack(">3f", *corner) for corner in CORNERS)
        + struct.pack(">B3iB3i", 3, 0, 1, 2, 3, 0, 2, 3),
        digest="bfcf53c5320d",
    ),
    "mixed.ply": Case(
        HEAD.format("binary_little_endian", FACES).encode()
        + PACKED
        + struct.pack("<B4iB3i", 4, 0, 1, 2, 3, 3, 0, 2, 3),
        digest="5fd1e89932d3",
    ),
    "strips.ply": Case(
        HEAD.format("ascii", "element tristrips 1\nproperty list int int vertex_indices\n")
        + POINTS
        + "8 0 1 2 3 -1 1 3 2\n",
        digest="2eb0d5e866a6",
    ),
    "coloured.ply": Case(
        HEAD.format(
            "ascii", "".join(f"property uchar {name}\n" for name in ("red", "green", "blue", "alpha", "x2")) + FACES
        )
        + POINTS.replace("\n", " 128 0 255 9 1\n")
        + "3 0 1 2\n3 0 2 3\n",
        digest="cd8d7910922d",
        notes=(
            "4 partly transparent vertices are opaque: transparency is not rendered",
            "1 property is not read: vertex.x2",
        ),
    ),
    "faces.ply": Case(
        HEAD.format("ascii", FACES + "property float r\nproperty float g\nproperty float b\n")
        + POINTS
        + "3 0 1 2 0.5 0 1\n3 0 2 3 1 1 3\n",
        digest="9fed3009349e",
    ),
    "textured.ply": Case(
        HEAD.format(
            "ascii",
            "comment TextureFile a.png\ncomment TextureFile b.png\n"
            + FACES
            + "property list uchar float texcoord\nproperty int texnumber\n",
        )
        + POINTS
        + "3 0 1 2 6 0 0 1 0 1 1 0\n3 0 2 3 6 0 0 1 1 0 1 1\n",
        beside={"a.png": png(FOUR)},
        digest="526f6bf7adde",
        notes=("1 picture of a texture is missing (b.png): surfaces have their base colour",),
    ),
    "damaged.ply": Case(
        HEAD.format("ascii", "property float s\nproperty float t\n" + FACES.replace("2", "1")).replace(
            "ply\n", "ply\ncomment TextureFile a.png\n"
        )
        + POINTS.replace("\n", " 0 1\n")
        + "3 0 1 2\n",
        beside={"a.png": png(FOUR)[:50]},
        digest="f71a8fa71793",
        notes=("1 picture of a texture is truncated or damaged (a.png): surfaces have their base colour",),
    ),
    "end.ply": Case("ply\nformat ascii 1.0\n", "cannot be read as a mesh: its PLY header has no end"),
    "format.ply": Case("ply\nformat utf8 1.0\nend_header\n", "cannot be read as a mesh: its PLY format is utf8"),
    "type.ply": Case(
        "ply\nelement a 1\nproperty half x\nend_header\n", "a property of its header is not valid: property half x"
    ),
    "rows.ply": Case(
        "ply\nelement a 1e3\nend_header\n", "the number of an element of its header is not valid: element a 1e3"
    ),
    "lack.ply": Case(
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty int x\nend_header\n1\n", "its vertices lack x, y or z"
    ),
    "many.ply": Case(
        ASCII.replace("vertex 4", "vertex 900000000000") + POINTS,
        "is truncated: its header states 900,000,000,000 rows of vertex, the file ends before",
    ),
    "list.ply": Case(
        ASCII + POINTS + "-3 0 1 2\n3 0 2 3\n", "a list of face begins with -3, not with its number of values"
    ),
    "index.ply": Case(
        ASCII + POINTS + "3 0 1 4\n3 0 2 3\n", "a face names vertex 4, which does not exist: the file has 4 vertices"
    ),
    "long.ply": Case(
        HEAD.format("binary_little_endian", FACES.replace("uchar int", "int int")).encode()
        + PACKED
        + struct.pack("<i", 2**31 - 1),
        "is truncated: its header states 2 rows of face, the file ends before",
    ),
    "binary.stl": Case(bytes(80) + struct.pack("<I", 1) + FACET, digest="7fae1b18685e"),
    "solid.stl": Case(SOLID.format("vertex 0 0 0\nVERTEX 1e0 0 0\nvertex 0 1 0\n"), digest="360618a66f50"),
    "spare.stl": Case(
        bytes(80) + struct.pack("<I", 1) + FACET[:-2] + b"\1\0" + FACET,
        digest="7fae1b18685e",
        notes=(
            "50 bytes after the last facet are not read: the header has the number of facets",
            "1 facet colour is not shown: STL has no standard for them",
        ),
    ),
    "cut.stl": Case(bytes(80) + struct.pack("<I", 2) + FACET, "is truncated: its header states 2 facets, it holds 1"),
    "two.stl": Case(
        SOLID.format("vertex 0 0 0\nvertex 1 0 0\n"), "is truncated: it begins 1 facets and has 2 of their vertices"
    ),
    "numbers.stl": Case(SOLID.format("vertex 0 0\nvertex 1 0 0\nvertex 0 1 0\n"), "a vertex has fewer than 3 numbers"),
    "coloured.off": Case(
        "CNOFF\n4 1\n" + POINTS.replace("\n", " 0 0 1 255 0 128 255\n") + "4 0 1 2 3\n", digest="d3a48adabcdf"
    ),
    "faces.off": Case(
        "OFF4 2 0\n" + POINTS + "3 0 1 2 0.5 0.0 1.0 0.5\n3 0 2 3 # none\n",
        digest="5e17a8fca347",
        notes=("1 partly transparent face is opaque: transparency is not rendered",),
    ),
    "short.off": Case("OFF\n9 1 0\n" + POINTS, "is truncated: its header states 9 vertices and 1 faces"),
    "no.off": Case("PFF\n1 1 1\n", "cannot be read as a mesh: it is no text that starts with OFF, COFF or NOFF"),
    "index.off": Case("OFF\n4 1 0\n" + POINTS + "3 0 1 -4\n", "a face names vertex -4, but the file has 4 vertices"),
}
