"""Hostile mesh files: one line, never a crash."""

from __future__ import annotations

import json
import struct
import zipfile
from pathlib import Path
from typing import Any

import gltf_documents
import hostile
import pytest
from gltf_documents import gltf
from hostile import RENDER, TRIANGLE, Case, Content, fifo, link_to
from interchange_files import MESH, TEXTURED, archive, dae, threemf
from interchange_files import POINTS as CORNERS

from colonnade.common.errors import UserError
from colonnade.mesh.load import load_mesh

OBJ, PLY, STL, OFF = (f"{RENDER} --mesh x.{suffix}" for suffix in ("obj", "ply", "stl", "off"))
GLTF = f"{RENDER} --mesh x.gltf"
THREEMF, DAE, ZAE = (f"{RENDER} --mesh x.{suffix}" for suffix in ("3mf", "dae", "zae"))
POINTS = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
PLY_HEADER = (
    "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
    "element face {}\nproperty list uchar int vertex_indices\nend_header\n"
)
PLY_BODY = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"


def with_mtl(line: str) -> dict[str, Content]:
    return {"x.obj": f"mtllib x.mtl\nusemtl a\n{TRIANGLE}", "x.mtl": f"newmtl a\n{line}\n"}


def of_gltf(**changes: Any) -> dict[str, Content]:
    return {"x.gltf": json.dumps(gltf(**changes))}


ACCESSORS = gltf()["accessors"]


def of_materials(count: int) -> dict[str, Content]:
    """A document of so many triangles, each in a colour of its own."""
    primitive = gltf()["meshes"][0]["primitives"][0]
    factors = {"metallicFactor": 0}
    colours = [[number / count, 0, 0, 1] for number in range(count)]
    return of_gltf(
        meshes=[{"primitives": [primitive | {"material": number} for number in range(count)]}],
        materials=[{"pbrMetallicRoughness": factors | {"baseColorFactor": colour}} for colour in colours],
    )


def of_draco(**extension: Any) -> dict[str, Content]:
    """A document whose triangle is said to be compressed."""
    primitive = gltf()["meshes"][0]["primitives"][0] | {"extensions": {"KHR_draco_mesh_compression": extension}}
    accessors = [{key: accessor[key] for key in ("componentType", "count", "type")} for accessor in ACCESSORS]
    return of_gltf(meshes=[{"primitives": [primitive]}], accessors=accessors)


def buffer(name: str) -> list[dict[str, Any]]:
    return [{"byteLength": 42, "uri": name}]


def bomb(path: Path) -> None:
    """A 3MF file that unpacks to a thousand times its size."""
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file,
        file.open("3D/3dmodel.model", "w") as member,
    ):
        for _ in range(700):
            member.write(bytes(1 << 20))


def claiming(content: bytes, size: int) -> bytes:
    """An archive whose list states another size of its first member."""
    start = content.index(b"PK\1\2") + 24
    return content[:start] + struct.pack("<I", size) + content[start + 4 :]


#: Entities of ten of the one before, to 10^9, and one of another file.
LAUGHS = "".join(f"<!ENTITY e{k} '" + f"&e{k - 1};" * 10 + "'>" for k in range(1, 10))
ENTITIES = f'<!DOCTYPE x [<!ENTITY e0 "0 0 0 ">{LAUGHS}<!ENTITY file SYSTEM "tri.obj">]>'
#: Objects of two of the one before, to 2^38.
DOUBLED = "".join(
    f"<object id='{k}'><components><component objectid='{k - 1}'/><component objectid='{k - 1}'/></components></object>"
    for k in range(2, 40)
)
#: Nodes of two of the one before, to 2^38.
VISUAL = "<library_visual_scenes>"
DOUBLED_NODES = (
    '<library_nodes><node id="n1"><instance_geometry url="#g"/></node>'
    + "".join(
        f'<node id="n{k}"><instance_node url="#n{k - 1}"/><instance_node url="#n{k - 1}"/></node>' for k in range(2, 40)
    )
    + "</library_nodes>"
)
MANY_PARTS = "it has more than 16,384 parts and copies of parts: join them, or export it as glTF"
#: 200,000 triangles.
MANY = MESH.replace("<triangles>", "<triangles>" + '<triangle v1="0" v2="1" v3="2"/>' * 200_000)

CASES = {
    "obj-index-0": Case(OBJ, "names vertex 0", {"x.obj": f"{POINTS}f 0 1 2\n"}),
    "obj-index-0-with-normal": Case(OBJ, "names vertex 0", {"x.obj": f"{POINTS}vn 0 0 1\nf 0//1 1//1 2//1\n"}),
    "obj-index-beyond": Case(OBJ, "vertex 9, but the file has", {"x.obj": f"{POINTS}f 1 2 9\n"}),
    "obj-index-before": Case(OBJ, "vertex -9, but the file has", {"x.obj": f"{POINTS}f 1 2 -9\n"}),
    "obj-index-digits": Case(OBJ, "but the file has", {"x.obj": f"{POINTS}f 1 2 {'9' * 400}\n"}),
    "obj-index-text": Case(OBJ, "not an integer", {"x.obj": f"{POINTS}f a b c\n"}),
    "obj-index-float": Case(OBJ, "not an integer", {"x.obj": f"{POINTS}f 1.5 2 3\n"}),
    "obj-index-5000-digits": Case(OBJ, "but the file has 3 vertices", {"x.obj": f"{POINTS}f 1 2 {'9' * 5000}\n"}),
    "obj-two-corners": Case(OBJ, "x.obj", {"x.obj": f"{POINTS}f 1 2\n"}),
    "obj-nan": Case(OBJ, "not a finite number", {"x.obj": "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"}),
    "obj-infinite": Case(OBJ, "not a finite number", {"x.obj": "v 1e999 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"}),
    "obj-huge": Case(OBJ, "scale it down", {"x.obj": "v 1e200 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"}),
    "obj-words": Case(OBJ, "x.obj", {"x.obj": "v a b c\nf 1 1 1\n"}),
    "obj-nul": Case(OBJ, "x.obj", {"x.obj": b"\0" * 1000}),
    "obj-escapes": Case(f"{RENDER} --mesh '\x1b[31m.obj'", "\\x1b[31m.obj", {"\x1b[31m.obj": "f 1 2 3\n"}),
    "obj-named-300": Case(f"{RENDER} --mesh {'n' * 300}.obj", "File name too long"),
    "mesh-folder": Case(f"{RENDER} --mesh room", "no mesh"),
    "mesh-strange-suffix": Case(f"{RENDER} --mesh a.png", "suffix of a mesh file"),
    "mtl-nan": Case(OBJ, "x.mtl, line 2: Kd nan 0 0", with_mtl("Kd nan 0 0")),
    "mtl-infinite": Case(OBJ, "must be finite", with_mtl("Ni inf")),
    "mtl-negative": Case(OBJ, "must be finite", with_mtl("Kd -1 0 0")),
    "mtl-overflow": Case(OBJ, "must be finite", with_mtl("d 1e999")),
    "mtl-escapes": Case(OBJ, "Kd nan \\x1b[31m", with_mtl("Kd nan \x1b[31m")),
    "mtl-fifo": Case(OBJ, "a pipe", {"x.obj": f"mtllib x.mtl\n{TRIANGLE}", "x.mtl": fifo}),
    "mtl-device": Case(OBJ, "outside", {"x.obj": f"mtllib x.mtl\n{TRIANGLE}", "x.mtl": link_to("/dev/zero")}),
    "mtl-folder": Case(OBJ, "a folder", {"x.obj": f"mtllib room\n{TRIANGLE}"}),
    "ply-index-beyond": Case(
        PLY, "does not exist", {"x.ply": PLY_HEADER.format(3, 1) + PLY_BODY.replace("3 0 1 2", "3 0 1 9")}
    ),
    "ply-index-negative": Case(
        PLY, "x.ply", {"x.ply": PLY_HEADER.format(3, 1) + PLY_BODY.replace("3 0 1 2", "3 0 1 -9")}
    ),
    "ply-many-vertices": Case(PLY, "x.ply", {"x.ply": PLY_HEADER.format(10**12, 1) + PLY_BODY}),
    "ply-many-faces": Case(PLY, "x.ply", {"x.ply": PLY_HEADER.format(3, 10**12) + PLY_BODY}),
    "ply-digits": Case(PLY, "x.ply", {"x.ply": PLY_HEADER.format("9" * 5000, 1) + PLY_BODY}),
    "ply-negative": Case(PLY, "x.ply", {"x.ply": PLY_HEADER.format(-3, -1) + PLY_BODY}),
    "ply-no-header-end": Case(PLY, "x.ply", {"x.ply": "ply\nformat ascii 1.0\n"}),
    "ply-binary-short": Case(
        PLY, "x.ply", {"x.ply": PLY_HEADER.format(10**9, 10**9).replace("ascii", "binary_little_endian") + "xx"}
    ),
    "stl-count": Case(STL, "x.stl", {"x.stl": b"\0" * 80 + struct.pack("<I", 0xFFFFFFFF) + b"\0" * 50}),
    "stl-cut": Case(
        STL,
        "truncated: its header states 3 facets, it holds 1",
        {"x.stl": b"\0" * 80 + struct.pack("<I", 3) + b"\0" * 70},
    ),
    "stl-text-cut": Case(
        STL, "truncated: it begins 1 facets", {"x.stl": "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n"}
    ),
    "stl-short": Case(STL, "x.stl", {"x.stl": b"\0" * 20}),
    "stl-nan": Case(STL, "x.stl", {"x.stl": b"\0" * 80 + struct.pack("<I", 1) + b"\xff" * 50}),
    "stl-text": Case(STL, "x.stl", {"x.stl": "solid x\nfacet normal a b c\nendsolid\n"}),
    "off-index": Case(
        OFF, "names vertex 9, but the file has 3", {"x.off": "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n"}
    ),
    "off-size": Case(
        OFF, "fewer corners than it states", {"x.off": f"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n{'9' * 20} 0 1 2\n"}
    ),
    "off-count": Case(OFF, "x.off", {"x.off": f"OFF\n{10**12} {10**12} 0\n0 0 0\n"}),
    "off-noise": Case(OFF, "x.off", {"x.off": "OFF\n\x1b[31m\n"}),
    "gltf-buffer-fifo": Case(GLTF, "a pipe", of_gltf(buffers=buffer("b.bin")) | {"b.bin": fifo}),
    "gltf-buffer-device": Case(GLTF, "outside", of_gltf(buffers=buffer("b.bin")) | {"b.bin": link_to("/dev/zero")}),
    "gltf-buffer-above": Case(GLTF, "x.gltf", of_gltf(buffers=buffer("../../../../etc/hostname"))),
    "gltf-buffer-absolute": Case(GLTF, "outside", of_gltf(buffers=buffer("/etc/hostname"))),
    "gltf-buffer-named-300": Case(GLTF, "x.gltf", of_gltf(buffers=buffer("b" * 300))),
    "gltf-buffer-is-output": Case(
        f"{GLTF} --json b.bin", "would replace", of_gltf(buffers=buffer("b.bin")) | {"b.bin": b"\0" * 42}
    ),
    "gltf-draco": Case(GLTF, "x.gltf: its Draco data are damaged", of_draco(bufferView=0, attributes={"POSITION": 0})),
    "gltf-draco-no-attributes": Case(GLTF, "Draco use has no attributes", of_draco(bufferView=0)),
    "gltf-draco-no-view": Case(GLTF, "bufferViews[None] is used", of_draco(attributes={})),
    "gltf-draco-view": Case(GLTF, "bufferViews[9] is used", of_draco(bufferView=9, attributes={})),
    "gltf-many-materials": Case(GLTF, "more than 256 materials: use at most 256", of_materials(20_000)),
    "3mf-bomb": Case(THREEMF, "its archive unpacks to 734,003,200 bytes, one of its size to 102,", {"x.3mf": bomb}),
    "3mf-claimed-size": Case(
        THREEMF, "its archive unpacks to 4,294,967,280 bytes", {"x.3mf": claiming(threemf(), 0xFFFFFFF0)}
    ),
    "3mf-elements": Case(
        THREEMF,
        "its XML has more than 2,1",
        {"x.3mf": threemf(f'<object id="1">{MESH}</object>' + "<a b='' c=''/>" * 800_000)},
    ),
    "zae-picture": Case(
        ZAE,
        "a.png in its archive has 67,108,865 bytes: a picture may have 67,108,864",
        {"x.zae": claiming(archive(a__png=b"", a__dae=dae(image="a.png", **TEXTURED)), (1 << 26) + 1)},
    ),
    "3mf-false-size": Case(THREEMF, "cannot be read as a mesh: BadZipFile", {"x.3mf": claiming(threemf(), 99)}),
    "3mf-items": Case(
        THREEMF,
        "its parts have more than 16,777,216 triangles",
        {"x.3mf": threemf(f'<object id="1">{MANY}</object>', '<item objectid="1"/>' * 100)},
    ),
    "3mf-components": Case(
        THREEMF,
        MANY_PARTS,
        {"x.3mf": threemf(f'<object id="1">{MESH}</object>{DOUBLED}', '<item objectid="39"/>')},
    ),
    "3mf-many-items": Case(THREEMF, MANY_PARTS, {"x.3mf": threemf(build='<item objectid="1"/>' * 50_000)}),
    "3mf-loop": Case(
        THREEMF,
        "a part of it contains itself",
        {"x.3mf": threemf('<object id="1"><components><component objectid="1"/></components></object>')},
    ),
    "3mf-text": Case(THREEMF, "XMLSyntaxError", {"x.3mf": archive(**{"3D_3dmodel__model": b"\xff" * 400})}),
    "dae-entities": Case(DAE, "entity amplification", {"x.dae": dae(head=ENTITIES).replace(CORNERS, "&e9;")}),
    "dae-file-entity": Case(DAE, "Entity 'file' not defined", {"x.dae": dae(head=ENTITIES).replace(CORNERS, "&file;")}),
    "dae-deep": Case(DAE, "Excessive depth", {"x.dae": dae(instance="<node>" * 50_000)}),
    "dae-nodes": Case(
        DAE, MANY_PARTS, {"x.dae": dae(instance='<instance_node url="#n39"/>').replace(VISUAL, DOUBLED_NODES + VISUAL)}
    ),
    "dae-escapes": Case(DAE, "x.dae", {"x.dae": dae(instance="\x1b[31m")}),
    "zae-encrypted": Case(
        ZAE,
        "is encrypted",
        {"x.zae": archive(a__dae=dae()).replace(b"PK\1\2\x14\x03\x14\0\0", b"PK\1\2\x14\x03\x14\0\1")},
    ),
    "zae-none": Case(ZAE, "File is not a zip file", {"x.zae": dae()}),
    "strict": Case(f"{GLTF} --strict", "2 cameras are not used", of_gltf(cameras=[{}, {}])),
    **{
        name: Case(f"{RENDER} --mesh {name}", says, {name: content})
        for name, (says, content) in gltf_documents.REFUSED.items()
    },
}


@hostile.parametrised(CASES)
def test_mesh_is_refused(case: Case, folder: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    hostile.run(case, folder, monkeypatch)


def test_textures_are_read_as_pictures_only(folder: Any) -> None:
    """A texture may be a pipe, or a picture for which Pillow starts another program."""
    hostile.make(folder / "x.obj", f"mtllib x.mtl\nusemtl a\n{TRIANGLE}")
    hostile.make(folder / "y.obj", f"mtllib y.mtl\nusemtl a\n{TRIANGLE}")
    hostile.make(folder / "y.mtl", "# Blender\nnewmtl a\nKd 0.25 0.5 0.75\nmap_Kd x.eps\n")
    hostile.make(folder / "x.eps", "%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n")
    hostile.make(folder / "x.mtl", "newmtl a\nKd 0.25 0.5 0.75\nmap_Kd pipe.png\n")
    hostile.make(folder / "pipe.png", fifo)
    hostile.make(folder / "x.gltf", json.dumps(gltf(images=[{"uri": "pipe.png"}], textures=[{"source": 0}])))
    with pytest.raises(UserError, match="it is a pipe"):
        load_mesh(folder / "x.obj")
    assert len(load_mesh(folder / "x.gltf").faces) == 1
    mesh = load_mesh(folder / "y.obj")
    assert mesh.materials[0].albedo == (0.25, 0.5, 0.75) and mesh.textures == ()
    assert any("1 picture of a texture is not readable" in note for note in mesh.notes)


def test_relative_indices_of_obj_are_read(folder: Any) -> None:
    (folder / "x.obj").write_text(f"{POINTS}v 0 0 1\nf 1 2 3\nf -4 -3 -1\n")
    assert len(load_mesh(folder / "x.obj").faces) == 2
