"""Small 3MF and COLLADA files."""

from __future__ import annotations

import io
import zipfile

#: A square as one polygon, then an L of six corners, in the plane z = 0.
POINTS = "0 0 0 1 0 0 1 1 0 0 1 0 2 0 0 4 0 0 4 1 0 3 1 0 3 2 0 2 2 0"
SQUARE, L = (4, "0 1 2 3"), (6, "4 5 6 7 8 9")
#: The same square as an object of 3MF.
MESH = (
    '<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="1" y="1" z="0"/>'
    '<vertex x="0" y="1" z="0"/></vertices><triangles><triangle v1="0" v2="1" v3="2"/>'
    '<triangle v1="0" v2="2" v3="3"/></triangles></mesh>'
)
CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
#: The picture of a COLLADA effect.
SAMPLER = (
    '<newparam sid="s"><surface type="2D"><init_from>i</init_from></surface></newparam>'
    '<newparam sid="t"><sampler2D><source>s</source></sampler2D></newparam>'
)


def archive(**members: bytes | str) -> bytes:
    """A ZIP archive of members by name, in which __ stands for a full stop and _ for a slash."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members.items():
            file.writestr(name.replace("__", ".").replace("_", "/"), content)
    return stream.getvalue()


def threemf(objects: str = f'<object id="1" type="model">{MESH}</object>', build: str = "", unit: str = "") -> bytes:
    """A 3MF file; by default of the square, once."""
    head = f'<?xml version="1.0"?><model xmlns="{CORE}" {unit}>'
    items = build or '<item objectid="1"/>'
    return archive(**{"3D_3dmodel__model": f"{head}<resources>{objects}</resources><build>{items}</build></model>"})


def dae(
    polygons: tuple[int, str] = SQUARE,
    asset: str = "",
    effect: str = "<diffuse><color>0.5 1 0 1</color></diffuse>",
    image: str = "",
    parameters: str = "",
    instance: str = "",
    inputs: str = "",
    arrays: str = "",
    head: str = "",
) -> str:
    """A COLLADA file of polygons in the plane z = 0."""
    size, corners = polygons
    count = len(POINTS.split())
    library = f'<library_images><image id="i"><init_from>{image}</init_from></image></library_images>' if image else ""
    return f"""<?xml version="1.0"?>{head}
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>{asset}</asset>{library}
<library_effects><effect id="e"><profile_COMMON>{parameters}<technique sid="c"><phong>{effect}</phong></technique>
</profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="{count}">{POINTS}</float_array>
<technique_common><accessor source="#pa" count="{count // 3}" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>{arrays}
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<polylist material="s" count="1"><input semantic="VERTEX" source="#v" offset="0"/>{inputs}<vcount>{size}</vcount>
<p>{corners}</p></polylist></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="w"><node id="n">{instance}<instance_geometry url="#g"><bind_material>
<technique_common><instance_material symbol="s" target="#m"/></technique_common></bind_material></instance_geometry>
</node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#w"/></scene></COLLADA>"""


#: Texture coordinates of the ten points: their x and y.
UV = " ".join(f"{x} {y}" for x, y in zip(POINTS.split()[::3], POINTS.split()[1::3], strict=True))
TEXTURED = {
    "effect": '<diffuse><texture texture="t" texcoord="UV"/></diffuse>',
    "parameters": SAMPLER,
    "inputs": '<input semantic="TEXCOORD" source="#q" offset="0" set="0"/>',
    "arrays": f'<source id="q"><float_array id="qa" count="20">{UV}</float_array><technique_common>'
    '<accessor source="#qa" count="10" stride="2"><param name="S" type="float"/><param name="T" type="float"/>'
    "</accessor></technique_common></source>",
}
