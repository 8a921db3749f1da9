"""The Python API: scenes from files and from values are the same, and the examples' notebooks run."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import pytest
import trimesh
from colonnade_lab.evaluation.studies.synthetic_attic import write_attic
from live_maps import SMALL_MAPS

import colonnade
from colonnade.design.toolchain import project_root
from colonnade.mesh.load import load_mesh

SIZE = (48, 36)
FILE = """
mesh.name = "torus:200"
camera = {direction = [0.2, 0.5, 1.0], fov = 35.0}
material = {kind = "diffuse", albedo = [0.9, 0.8, 0.7]}
background.colour = [0.1, 0.2, 0.4]
[[light]]
offset = [-0.75, 0.85, 0.9]
[[light]]
position = [2.0, 3.0, 4.0]
"""
TABLES = {
    "camera": {"direction": np.array([0.2, 0.5, 1.0]), "fov": np.float64(35)},
    "material": {"kind": "diffuse", "albedo": (0.9, 0.8, 0.7)},
    "background": {"colour": [0.1, 0.2, 0.4]},
    "light": [{"offset": (-0.75, 0.85, 0.9)}, {"position": (2.0, 3.0, 4.0)}],
}


def test_a_scene_of_values_is_that_of_a_file_also_on_a_device(tmp_path: Path) -> None:
    """A mesh in memory, too, whose hits name its faces."""
    (tmp_path / "scene.toml").write_text(FILE)
    expected = colonnade.Scene.load(tmp_path / "scene.toml").render(size=SIZE)
    mesh = load_mesh("torus:200")
    arrays = mesh.vertices, mesh.faces
    scenes = [colonnade.Scene(given, **TABLES) for given in ("torus:200", arrays, trimesh.Trimesh(*arrays))]
    for scene in scenes:
        frame = scene.render(size=SIZE)
        assert frame.pixels.dtype == np.uint8 and len(np.unique(frame.pixels)) > 20
        np.testing.assert_array_equal(frame.pixels, expected.pixels)
        np.testing.assert_array_equal(frame.hits().triangle, expected.hits().triangle)
        assert frame.counters == expected.counters
    packed = scenes[1].pack()
    with colonnade.ModelDevice() as device:
        np.testing.assert_array_equal(device.render(packed, SIZE), expected.pixels)
        assert device.counters() == expected.counters


def test_tables_replace_those_of_their_name_and_none_removes_one() -> None:
    scene = colonnade.Scene("octahedron", camera={"position": (0, 1, 4)}, light={"offset": (1, 1, 1)})
    moved = scene.with_tables(camera={"position": (3, 1, 2)}, light=None)
    assert scene.description.camera.position == (0, 1, 4) and moved.description.camera.position == (3, 1, 2)
    assert not moved.description.names_light and moved.description.mesh == scene.description.mesh
    packed = scene.pack("tiny")
    expected = scene.with_tables(camera={"position": (3, 1, 2)}).pack("tiny").registers(SIZE)
    assert packed.with_camera(moved.description.camera).registers(SIZE) == expected != packed.registers(SIZE)
    turned = list(scene.with_tables(motion={"turn": 50.0}).frames(2, size=SIZE))
    assert (turned[0].pixels != turned[1].pixels).any()


def test_what_is_wrong_is_said_in_one_line() -> None:
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    cube = colonnade.Scene("cube")
    ring: list[object] = []
    ring.append(ring)
    packed = cube.pack()
    for message, make in {
        r"the scene: camera.fov must be a number from 1 to 150": lambda: colonnade.Scene("cube", camera={"fov": 200}),
        r"the scene: \[mesh\] needs either a name or a path": lambda: colonnade.Scene(),
        r"no scene nowhere: name a TOML file": lambda: colonnade.Scene.load("nowhere"),
        r"vertices have the shape \[4, 2\]": lambda: colonnade.Scene((np.zeros((4, 2)), [[0, 1, 2]])),
        r"a vertex that does not exist: there are 4": lambda: colonnade.Scene((square, [[0, 1, 4]])),
        r"faces are float64": lambda: colonnade.Scene((square, [[0.0, 1.0, 2.0]])),
        r"the mesh is a Scene: give a name, a file, a pair": lambda: colonnade.Scene(trimesh.Scene()),
        r"vertices are no array: give three numbers each": lambda: colonnade.Scene(([[0, 0, 0], [1]], [[0, 1, 2]])),
        r"vertices are <U1: give numbers": lambda: colonnade.Scene((np.full((4, 3), "1"), [[0, 1, 2]])),
        r"vertices are complex128: give numbers": lambda: colonnade.Scene((np.array(square) + 1j, [[0, 1, 2]])),
        r"vertices are masked in part": lambda: colonnade.Scene((np.ma.masked_equal(square, 1), [[0, 1, 2]])),
        r"cannot be read: RuntimeError: of its own": lambda: colonnade.Scene(Broken()),
        r"crease is 'x': it must be a number": lambda: colonnade.Scene((square, [[0, 1, 2]]), crease="x"),
        r"folder is 3: it must be text, or a Path": lambda: colonnade.Scene("cube", folder=3),
        r"file is None: it must be text, or a Path": lambda: colonnade.Scene.load(None),
        r"camera is 'x': it must be a dict": lambda: colonnade.Scene("cube", camera="x"),
        r"camera.position is a set: give text, numbers": lambda: colonnade.Scene(
            "cube", camera={"position": {1, 2, 3}}
        ),
        r"the scene is nested too deeply: 64": lambda: colonnade.Scene("cube", camera={"position": ring}),
        r"Scene.__init__: got an unexpected keyword argument 'lamp'": lambda: colonnade.Scene("cube", lamp={}),
        r"backend is 'gpu': it must be one of rtl, model, reference": lambda: colonnade.Scene("cube").render("gpu"),
        r"encoder is 'fast': it must be": lambda: colonnade.Scene("cube").render(encoder="fast"),
        r"samples is 0: it must be a whole number": lambda: colonnade.Scene("cube").render(samples=0),
        r"samples is 2.5: it must be a whole number": lambda: cube.render(samples=2.5),
        r"size is \(4.5, 3\): it must be": lambda: cube.render(size=(4.5, 3)),
        r"size is array\(\[4, 3\]\): it must be width and height": lambda: cube.render(size=np.array([4, 3])),
        r"config is None: it must be text": lambda: cube.pack(config=None),
        r"overrides is 'a=1': it must be a list of texts": lambda: cube.pack(overrides="a=1"),
        r"hits is 'no': it must be true or false": lambda: cube.render(hits="no"),
        r"denoise is 'yes': it must be true or false, or one of": lambda: cube.render(denoise="yes"),
        r"progress is 3: it must be a Progress": lambda: cube.render(progress=3),
        r"unknown option frames; known here: overrides": lambda: cube.render(frames=3),
        r"size is 3: it must be width and height": lambda: packed.registers(3),
        r"camera is \{'fov': 3\}: it must be a Camera": lambda: packed.with_camera({"fov": 3}),
        r"config is \{\}: it must be text": lambda: colonnade.ModelDevice({}),
        r"has a mesh of its own: leave out \[mesh\]": lambda: colonnade.Scene(
            (square, [[0, 1, 2]]), object=[{"mesh": {"name": "cube"}}]
        ),
    }.items():
        with pytest.raises(colonnade.UserError, match=message):
            make()
    coloured = trimesh.Trimesh(square, [[0, 1, 2]], vertex_colors=np.full((4, 4), 99, np.uint8), process=False)
    with pytest.warns(UserWarning, match="colours or textures .vertex. are left out"):
        colonnade.Scene(coloured)
    with pytest.raises(AttributeError, match="no attribute Scenes"):
        colonnade.Scenes  # noqa: B018


def test_what_a_scene_leaves_open_is_a_warning_once_for_it(tmp_path: Path) -> None:
    """Whatever is rendered of it: frames, a film, or a change."""
    write_attic(tmp_path / "attic", 96, 72)
    options = {"config": "small", "overrides": SMALL_MAPS, "size": (96, 72)}
    tables = {"background": {"room": "attic"}, "motion": {"turn": 60.0}, "frame": {"samples": 2}}
    scene = colonnade.Scene("cube", **tables, folder=tmp_path)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        scene.render(**options)
        said = [str(one.message) for one in caught]
        assert len(list(scene.frames(2, **options))) == 2
        scene.with_tables(material={"kind": "mirror"}).render(**options)
    (line,) = [line for line in said if line.startswith("room attic: ")]
    assert "fitted to the photo" in line and "light gathered and noise filtered by small" in line
    assert [str(one.message) for one in caught] == said


class Broken:
    """A mesh of another library that fails."""

    faces = ((0, 1, 2),)

    @property
    def vertices(self) -> object:
        raise RuntimeError("of its own")


@pytest.mark.parametrize("name", ["frames", "room"])
def test_a_notebook_runs(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its cells in order, as in a folder of the project; it holds no outputs."""
    notebook = json.loads((project_root() / "examples" / "notebooks" / f"{name}.ipynb").read_text(encoding="utf-8"))
    monkeypatch.chdir(project_root() / "examples" / "notebooks")
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert len(cells) >= 5 and all(cell["outputs"] == [] and cell["execution_count"] is None for cell in cells)
    values: dict[str, object] = {}
    for number, cell in enumerate(cells):
        exec(compile("".join(cell["source"]), f"{name}.ipynb, cell {number}", "exec"), values)
