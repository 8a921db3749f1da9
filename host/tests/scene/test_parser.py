"""Scene files: defaults, the project's scenes, and one line for each error."""

from __future__ import annotations

import re
from dataclasses import asdict
from pathlib import Path

import pytest

from colonnade.common.errors import UserError
from colonnade.common.toml_files import parse_toml
from colonnade.mesh.clips.tracks import Animation
from colonnade.mesh.load import load_mesh
from colonnade.scene.model import MeshSource, Paths, Placement, Scene
from colonnade.scene.parser import _TABLES, load_scene

ROOT = Path(__file__).resolve().parents[3]
SCENES = ROOT / "scenes"


def write(folder: Path, text: str) -> Path:
    file = folder / "scene.toml"
    file.write_text(text)
    return file


def test_the_benchmarks_scene() -> None:
    scene = load_scene(SCENES / "object.toml")
    assert scene.camera.direction == (0.45, 0.35, 1.0)
    assert (scene.camera.framing, scene.camera.fov) == (0.7, 40.0)
    assert scene.light.offset == (1.2, 1.6, 1.5)
    assert scene.with_mesh("bunny").mesh_source == "bunny"


def test_every_scene_of_the_project_is_read() -> None:
    files = sorted(SCENES.glob("*.toml"))
    assert {"object.toml", "first-light.toml"} <= {file.name for file in files}
    for file in files:
        scene = load_scene(file)
        for mesh in [one.mesh for one in scene.objects] or [scene.mesh]:
            load_mesh(mesh.source)


def test_the_page_of_the_scene_file_has_all_keys_and_their_defaults() -> None:
    """A key without a default stands in the row without a value."""
    page = (ROOT / "docs" / "host.md").read_text().split("|table of the scene|")[1].split("\n\n")[0]
    rows = [line.strip("|").split("|") for line in page.splitlines()[2:]]
    scene = Scene(MeshSource("cube"), placement=Placement())
    assert [re.findall("`([a-z]+)`", row[0])[0] for row in rows] == _TABLES
    for row in rows:
        (name, *_), spans = re.findall("`([a-z]+)`", row[0]), re.findall("`([^`]+)`", "".join(row[2:]))
        given = parse_toml("\n".join(spans).encode(), "the table")
        keys = asdict(getattr(scene, {"object": "placement"}.get(name, name)))
        keys = {key: list(value) if isinstance(value, tuple) else value for key, value in keys.items()}
        assert given == {key: value for key, value in keys.items() if value not in (None, [], "cube")}, name
        assert keys.keys() <= set(re.findall("`([a-z_]+)`", row[1])), name


@pytest.mark.parametrize("value", ["0", '"0"'])
def test_an_animation_is_a_name_or_a_number(tmp_path: Path, value: str) -> None:
    text = f'[mesh]\nname = "a"\nanimation = {value}\n[[object]]\nmesh = {{name = "a", animation = {value}}}'
    table, objects = text.split("[[")
    assert load_scene(write(tmp_path, table)).mesh.animation == "0"
    assert load_scene(write(tmp_path, f"[[{objects}")).objects[0].mesh.animation == "0"


def test_a_path_is_relative_to_the_scene(tmp_path: Path) -> None:
    scene = load_scene(write(tmp_path, '[mesh]\npath = "parts/a.obj"'))
    assert scene.mesh_source == tmp_path / "parts" / "a.obj"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"\[mesh\] needs either a name or a path"),
        ("mesh = 3", "mesh must be a table"),
        ('[mesh]\nname = "a"\npath = "b"', "either a name or a path"),
        ("[mesh]\nname = 3", "mesh.name must be text"),
        *(
            (f'[mesh]\nname = "a"\nanimation = {value}', "mesh.animation must be text or a whole number from 0")
            for value in (-1, 0.5, "true", "[0]", '""')
        ),
        ('[mesh]\nname = "a"\n[lihgt]', "unknown key lihgt; known here: mesh"),
        ('[mesh]\nname = "a"\n[light]\ncolor = [1, 1, 1]', "unknown key light.color; known here"),
        ('[mesh]\nname = "a"\n[light]\ncolour = [1, 1]', "light.colour must be three numbers"),
        ('[mesh]\nname = "a"\n[light]\ncolour = [1, 1, -1]', "light.colour must be three numbers from 0"),
        ('[mesh]\nname = "a"\n[light]\nshadows = 1', "light.shadows must be true or false"),
        ('[mesh]\nname = "a"\n[frame]\ndenoise = 3', "frame.denoise must be true or false or one of atrous, oidn"),
        ('[mesh]\nname = "a"\n[light]\nposition = [0, 0, 1]\noffset = [0, 0, 1]', "not both"),
        ('[mesh]\nname = "a"\n[material]\nalbedo = [2, 0, 0]', "material.albedo must be three numbers from 0 to 1"),
        ('[mesh]\nname = "a"\n[camera]\nfov = 180', "camera.fov must be a number from 1 to 150"),
        ('[mesh]\nname = "a"\n[camera]\nfov = true', "camera.fov must be a number"),
        ('[mesh]\nname = "a"\n[camera]\nfov = nan', "camera.fov must be a number"),
        ('[mesh]\nname = "a"\n[camera]\nposition = [nan, 0, 0]', "camera.position must be three finite numbers"),
        ('[mesh]\nname = "a"\n[camera]\nposition = [1, 0, 0]\nframing = 0.5', "either position and target"),
        ('[mesh]\nname = "a"\n[camera]\ntarget = [1, 0, 0]', "needs camera.position"),
        ('[mesh]\nname = "a"\n[camera]\ndirection = [0, 0, 0]', "camera.direction must not be zero"),
        ('[mesh]\nname = "a"\n[transform]\nscale = 0', "transform.scale must be a number"),
        ('[mesh]\nname = "a"\n[frame]\nwidth = 0', "frame.width must be a whole number"),
        ('[mesh]\nname = "a"\n[material]\nkind = "wood"', "material.kind must be one of diffuse, mirror, glass"),
        ('[mesh]\nname = "a"\n[material]\nkind = "mirror"\nior = 1.5', "material.ior is for glass"),
        ('[mesh]\nname = "a"\n[material]\nior = 0.5', "material.ior must be a number from 1 to 4"),
        ('[mesh]\nname = "a"\n[light]\nfalloff = 0', "light.falloff must be a number"),
        ('[mesh]\nname = "a"\n[[light]]\n[[light]]\nshadows = false', "unknown key light.shadows; known here: pos"),
        ('[mesh]\nname = "a"\n[paths]\nbounces = 16', "paths.bounces must be a whole number from 0 to 15"),
        ('[mesh]\nname = "a"\n[paths]\nshadow_transmittance = 2', "paths.shadow_transmittance must be a number"),
        ('[mesh]\nname = "a"\n[background]\nroom = 3', "background.room must be text"),
        ('[mesh]\nname = "a"\n[background]\nocclusion = 1', "background.occlusion must be true or false"),
        ('[mesh]\nname = "a"\n[background]\nroom = "r"\n[camera]\nfov = 30', "the camera is the room's"),
        ('[mesh]\nname = "a"\n[object]\nsize = 1', "needs background.room"),
        ('[[object]]\nmesh.name = "a"\nmotion = {spin = 1}', "unknown key object.motion.spin"),
        ('[[object]]\nmesh.name = "a"\nmotion = 3', "object.motion must be a table"),
        ('[[object]]\nmesh.name = "a"\nmotion = [{at = 0.5}, {at = 0.2}]', "object.motion.at must ascend"),
        ('[[object]]\nmesh.name = "a"\nmotion = [{turn = 1}, {turn = "x"}]', "object.motion.turn must be a number"),
        ('[mesh]\nname = "a"\n[object]\n[transform]\nscale = 2\n[background]\nroom = "r"', "leave out transform.scale"),
        ('[mesh]\nname = "a"\n[object]\nstand_at = [1, -2]\n[background]\nroom = "r"', "object.stand_at must be two"),
        ("[mesh", "is not TOML"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(UserError, match=message) as caught:
        load_scene(write(tmp_path, text))
    assert "\n" not in str(caught.value) and "scene.toml" in str(caught.value)


def test_a_mesh_file_gets_a_scene_and_a_mark_is_no_text(tmp_path: Path) -> None:
    assert load_scene(tmp_path / "a.GLB").mesh.path == tmp_path / "a.GLB"
    assert load_scene(write(tmp_path, '\ufeff[mesh]\nname = "cube"')).mesh.name == "cube"


def test_a_room_with_several_lights_is_read(tmp_path: Path) -> None:
    text = """
    [mesh]
    name = "teapot"
    [background]
    room = "rooms/living"
    [object]
    stand_at = [330, 297.5]
    turn = -20
    [material]
    kind = "glass"
    ior = 1.4
    [paths]
    bounces = 6
    [[light]]
    position = [0, 2, 0]
    falloff = 1.5
    shadow_offset = 0.001
    [[light]]
    offset = [1, 1, 0]
    """
    scene = load_scene(write(tmp_path, text))
    assert scene.background.room == tmp_path / "rooms" / "living"
    assert scene.placement == Placement((330.0, 297.5), turn=-20.0)
    assert (scene.material.kind, scene.material.albedo, scene.material.ior) == ("glass", None, 1.4)
    assert scene.paths == Paths(bounces=6)
    assert [light.falloff for light in scene.lights] == [1.5, None]
    assert scene.light.shadow_offset == 0.001 and scene.lights[1].position is None
    assert scene.with_environment(tmp_path).background.room == tmp_path


def test_the_file_of_an_animation_is_beside_the_scene(tmp_path: Path) -> None:
    text = '[[object]]\nmesh = {path = "a.glb", animation = 0, animation_file = "clips/b.glb"}'
    for scene in (text, text.replace("[[object]]\nmesh =", "mesh =")):
        mesh = load_scene(write(tmp_path, scene)).mesh
        assert mesh.played == Animation("0", tmp_path / "clips" / "b.glb") and mesh.path == tmp_path / "a.glb"
    with pytest.raises(UserError, match=r"mesh\.animation_file needs mesh\.animation: the name of one, or"):
        load_scene(write(tmp_path, 'mesh = {name = "cube", animation_file = "b.glb"}'))


def test_an_unreadable_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="does not exist"):
        load_scene(tmp_path / "none.toml")
    with pytest.raises(UserError, match="cannot read"):
        load_scene(tmp_path)
    (tmp_path / "noise.toml").write_bytes(bytes(range(256)))
    with pytest.raises(UserError, match="is not TOML"):
        load_scene(tmp_path / "noise.toml")
