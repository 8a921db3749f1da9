"""Study files: defaults, and errors that name the line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from colonnade.common.errors import UserError
from colonnade.common.limits import MAX_DESIGNS
from colonnade.design.manifest import Manifest
from colonnade.design.toolchain import project_root

from colonnade_lab.explore import work
from colonnade_lab.explore.explore import Exploration
from colonnade_lab.explore.figures import columns
from colonnade_lab.explore.plan import Plan
from colonnade_lab.explore.points import Point, grid_size, manifests_of, point_of, points_of
from colonnade_lab.explore.result import figures_of
from colonnade_lab.explore.search import check_search
from colonnade_lab.explore.study_file import StudyFile, line_of, load_study

STUDY = """title = "Try"
baseline = "32b32s64d"

[design]
config = "tiny"

[axes]
precision = ["16b16s32d", "32b32s64d"]
"array.contexts" = [
  4,
  8,
]

[workload]
scenes = ["object.toml"]
meshes = ["cube"]
size = [32, 24]

[quality]
dists = false
"""


def study(folder: Path, text: str) -> StudyFile:
    (folder / "study.toml").write_text(text)
    return load_study(folder / "study.toml")


def test_the_grid_has_all_combinations_in_order(tmp_path: Path) -> None:
    file = study(tmp_path, STUDY.replace('baseline = "32b32s64d"\n', ""))
    names = [point.name for point in points_of(file)]
    assert names == [f"{p}, contexts={c}" for p in ("16b16s32d", "32b32s64d") for c in (4, 8)]
    assert grid_size(file) == len(names)
    assert points_of(file)[1].overrides == ("precision=16b16s32d", "array.contexts=8")


def test_one_by_one_varies_each_axis_alone(tmp_path: Path) -> None:
    file = study(tmp_path, STUDY.replace('baseline = "32b32s64d"', 'combine = "one-by-one"'))
    assert [point.name for point in points_of(file)] == ["base", "16b16s32d", "32b32s64d", "contexts=4", "contexts=8"]


def test_named_points_come_first_and_may_be_the_baseline(tmp_path: Path) -> None:
    lean = '[[point]]\nname = "lean"\nset = { "geometry.triangleBits" = 24 }\nchildren = 2\n'
    file = study(tmp_path, STUDY.replace("32b32s64d", "lean", 1) + lean)
    assert points_of(file)[0] == replace(point_of(file, {"geometry.triangleBits": 24}, "lean"), children=2)


def refused(folder: Path, text: str) -> str:
    with pytest.raises(UserError) as error:
        file = study(folder, text)
        manifests_of(file, points_of(file))
    message = str(error.value)
    assert "\n" not in message
    return message.removeprefix(f"{folder / 'study.toml'}:")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('title = "Try"', 'titel = "Try"', "1: unknown key titel; known here: title, workload"),
        ('config = "tiny"', 'konfig = "tiny"', "5: unknown key design.konfig; known here: config, set"),
        ('config = "tiny"', "config = 3", "5: design.config: "),
        ('meshes = ["cube"]', "", '2: baseline: there is no point "32b32s64d"; points: "16b16s32d, contexts=4", "16'),
        ("[32, 24]", "[32, 0]", "17: workload.size: "),
        ("[32, 24]", "[32]", "17: workload.size: "),
        ('scenes = ["object.toml"]', "scenes = []", "15: workload.scenes: "),
        ("dists = false", "dists = 1", "20: quality.dists: "),
        ("[quality]\ndists = false", "", "nothing is measured: give [quality], [tests], [cycles],"),
        ("size = [32, 24]", "reduce = [0]", "17: workload.reduce: "),
        (
            'meshes = ["cube"]',
            "reduce = [9]",
            "16: workload.reduce: the meshes of scenes stay as they are: name workload",
        ),
        ("[quality]", "[tests]\nsame_pictures = true\n[quality]", "20: tests.same_pictures: the same as which point"),
        ("[quality]", '[power]\nmeshes = ["teapot"]\n[quality]', "power: the gates need a library"),
        ("[quality]", '[cycles]\nmeshes = ["teapot"]\n[quality]', "20: cycles.meshes: teapot is not in"),
        ('"Try"\n', '"Try"\ncombine = "list"\n', "2: combine: a list has [[point]] tables and no [axes]"),
        ('"Try"\n', '"Try"\ncombine = "search"\n', '2: combine: a search needs combine = "search" and a table'),
        ('"Try"\n', '"Try"\ncombine = "all"\n', "2: combine: "),
        ("  8,", "  4,", 'two points are named "16b16s32d, contexts=4"'),
        ("  8,", "  17,", '11: "16b16s32d, contexts=17": '),
        ('"32b32s64d"]', '"32b32s65d"]', "8: "),
        ('"array.contexts"', '"array.kontexts"', '9: "16b16s32d, kontexts=4": '),
        ('config = "tiny"', 'config = "huge"', "no configuration huge"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = STUDY.replace(old, new)
    if "baseline" not in message:
        text = text.replace('baseline = "32b32s64d"', "#")
    assert text != STUDY
    found = refused(tmp_path, text)
    assert found.startswith(message) or message in found


def test_no_toml_and_no_file_are_one_line(tmp_path: Path) -> None:
    assert "is not TOML" in refused(tmp_path, "title = ")
    with pytest.raises(UserError, match="does not exist"):
        load_study(tmp_path / "none.toml")


def test_lines_of_values_and_quoted_keys() -> None:
    assert line_of(STUDY, ("axes", "array.contexts")) == 9
    assert line_of(STUDY, ("axes", "array.contexts", "8")) == 11
    assert line_of(STUDY, ("axes", "precision", "32b32s64d")) == 8
    assert line_of(STUDY, ("workload", "meshes", "cube")) == 16
    assert line_of(STUDY, ("quality", "none")) == 19
    assert line_of(STUDY, ("power",)) is None


@pytest.mark.parametrize(
    "path", sorted((project_root() / "scenes" / "studies").glob("*.toml")), ids=lambda path: path.stem
)
def test_the_studies_of_the_repository_are_legal(path: Path) -> None:
    file = load_study(path)
    points = points_of(file)
    assert len(manifests_of(file, points[:2])) == len(points[:2])


def test_scenes_of_several_objects_are_frames_of_their_own(tmp_path: Path) -> None:
    several = '[[object]]\nmesh.name = "cube"\n[[object]]\nmesh.name = "sphere:64"\ntransform.translate = [3, 0, 0]\n'
    (tmp_path / "several.toml").write_text(several)
    alone = STUDY.replace("object.toml", "several.toml").replace('meshes = ["cube"]\n', "")
    (frame,) = Plan(study(tmp_path, alone), {}).frames
    assert frame.name == "several" and len(frame.mesh.faces) > 12
    assert frame.mesh.vertices[:, 0].max() > 2.5
    with pytest.raises(UserError, match=r"a mesh replaces that of a single object, but the scene has 2 \[\[object\]\]"):
        Plan(study(tmp_path, alone.replace("[workload]", '[workload]\nmeshes = ["cube"]')), {})


def test_a_scene_has_its_files_in_the_folder_of_any_job(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "object.toml").write_text('mesh.name = "cube"\nbackground.room = "room"\n')
    (tmp_path / "room").mkdir()
    monkeypatch.chdir(tmp_path)
    (frame,) = Plan(study(Path(), STUDY), {}).frames
    assert frame.scene.background.room == tmp_path / "room"


def test_each_mesh_is_reduced_to_each_number_of_triangles(tmp_path: Path) -> None:
    (tmp_path / "object.toml").write_text('mesh.name = "cube"\n')
    both = STUDY.replace('["cube"]', '["cube", "torus"]')
    frames = Plan(study(tmp_path, both.replace("size =", "reduce = [20, 90]\nsize =")), {}).frames
    assert [frame.name for frame in frames] == ["cube, 20", "cube, 90", "torus, 20", "torus, 90"]
    assert [frame.source for frame in frames] == ["cube", "cube", "torus", "torus"]
    for frame, maximum in zip(frames, (20, 90, 20, 90), strict=True):
        assert 5 < len(frame.mesh.faces) <= maximum
    with pytest.raises(UserError, match=r":17: mesh cube cannot be reduced to 1 triangles: allow more"):
        Plan(study(tmp_path, both.replace("size =", "reduce = [1]\nsize =")), {})
    with pytest.raises(UserError, match=r":16: two frames are named cube, 20"):
        Plan(study(tmp_path, both.replace("torus", "cube").replace("size =", "reduce = [20]\nsize =")), {})


@pytest.mark.parametrize("text", ["frame.samples = 4", "light.radius = 0.5"])
def test_scenes_of_several_samples_are_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "object.toml").write_text(f'mesh.name = "cube"\n{text}\n')
    with pytest.raises(UserError, match=rf"object\.toml: a study renders one sample a pixel: leave out {text[:5]}"):
        Plan(study(tmp_path, STUDY), {})


def test_two_frames_of_one_name_are_refused(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "s.toml").write_text('mesh.name = "cube"\n')
    alone = STUDY.replace('meshes = ["cube"]\n', "").replace('["object.toml"]', '["a/s.toml", "b/s.toml"]')
    with pytest.raises(UserError, match=r"study\.toml:15: two frames are named s: rename a scene's file"):
        Plan(study(tmp_path, alone), {})
    with pytest.raises(UserError, match=r":16: two frames are named cube"):
        Plan(study(tmp_path, STUDY.replace("object", "a/s").replace('["cube"]', '["cube", "cube"]')), {})


@pytest.mark.parametrize("size", ["[32, 24]", '"32x24"', '"32X24"'])
def test_sizes_are_those_of_the_command_line_or_two_numbers(tmp_path: Path, size: str) -> None:
    power = f'libraries = ["l"]\n{STUDY.replace("[32, 24]", size)}[power]\nsize = {size}\n'
    found = study(tmp_path, power).study
    assert found.workload.size == (32, 24)
    assert found.power is not None and found.power.size == (32, 24)


def repeated(count: int, combine: str) -> str:
    """A study of `count` values in one axis."""
    values = ", ".join(map(str, range(count)))
    search = '[search]\nbudget = 9\nobjectives = ["psnr_min", "flip"]\n' if combine == "search" else ""
    axes = "" if combine == "list" else f'[axes]\n"array.contexts" = [{values}]\n'
    points = "".join(f'[[point]]\nname = "{i}"\n' for i in range(count)) if combine == "list" else ""
    return f'title = "t"\ncombine = "{combine}"\n{axes}{points}[workload]\nscenes = ["s.toml"]\n[quality]\n{search}'


@pytest.mark.parametrize("combine", ["grid", "one-by-one", "list", "search"])
def test_every_way_of_making_points_has_the_same_limit(tmp_path: Path, combine: str) -> None:
    fits = MAX_DESIGNS - (combine == "one-by-one")
    points_of(study(tmp_path, repeated(fits, combine)))
    for count in (fits + 1, 9_000):
        with pytest.raises(UserError, match=r"study\.toml:[34]: the study has more than 1,000 points: "):
            points_of(study(tmp_path, repeated(count, combine)))


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("constraints = [ 'psnr_min >= 1.2.3' ]", ":21: psnr_min >= 1.2.3 is not of the form figure >= number"),
        ("constraints = [ 'psnr_min >= ...' ]", "is not of the form"),
        ("constraints = [ 'psnr_min >= 1e999' ]", "is not of the form"),
        ("start = [{ precision = 1979-05-27 }]", ":21: search.start.precision: a date or time is no value: write"),
        ("budget = 1001", ":21: search.budget: must be less than or equal to 1000, not 1001"),
        ("budget = 1\nstart = [{}]", ":22: search.start: the budget ends before these points"),
    ],
)
def test_what_a_search_cannot_take_is_one_line(tmp_path: Path, line: str, message: str) -> None:
    head = "" if "budget" in line else "budget = 5\n"
    search = f'[search]\n{line}\nobjectives = ["psnr_min", "flip"]\n{head}'
    text = STUDY.replace('baseline = "32b32s64d"\n', '#\ncombine = "search"\n')
    text = text.replace("[quality]\n", f"{search}[quality]\n")
    kinds = ("quality", "tests", "baseline", "cycles", "area", "power")
    with pytest.raises(UserError) as error:
        check_search(study(tmp_path, text), columns(dict.fromkeys(kinds, True), ()))
    assert message in str(error.value) and "\n" not in str(error.value)


#: Values that a key may wrongly have.
ODD = (
    *("true", "-1", "0", "1" + 39 * "0", "0.5", "nan", "-inf", '""', '"\\u0000"', '"a\\nb"', '"\\u001b[31m"'),
    *('"\\u2028"', "1979-05-27", "07:32:00", "[]", "[[]]", "[1]", '["x"]', "[{}]", "[{ a = 1979-05-27 }]", "{}"),
    *('{ "" = 1 }', '"x=1"'),
)


def test_odd_values_are_refused_in_a_line_with_file_and_key(tmp_path: Path) -> None:
    """Each key with each odd value: refused with the key, or a legal study; a date or control character never is."""
    lines = (STUDY + '[power]\nclock = 1.0\ncycles = 5\n[[point]]\nname = "p"\nset = { a = 1 }\n').splitlines()
    lines.insert(2, 'libraries = ["l"]')
    for number, line in enumerate(lines):
        key, equals, _ = line.partition(" = ")
        for value in ODD if equals and line.count("[") == line.count("]") else ():
            text = "\n".join([*lines[:number], f"{key} = {value}", *lines[number + 1 :]])
            try:
                study(tmp_path, text)
            except UserError as error:
                message = str(error)
                assert message.startswith(f"{tmp_path / 'study.toml'}:") or "study " in message
                assert message.isprintable() and ": " in message
                assert not any(word in message for word in ("item", "validation", "instance", "Input", "Traceback"))
            else:
                assert not any(bad in value for bad in ("1979", "07:32", "\\u", "nan", "inf")), (key, value)


def plan_of_cycles(folder: Path, table: str, more: str = "") -> tuple[Plan, list[Point], dict[str, Manifest]]:
    """The plan of a study of cycles, its points and their manifests."""
    (folder / "object.toml").write_text('mesh.name = "cube"\n')
    text = STUDY.replace('baseline = "32b32s64d"\n', "").replace("[quality]\ndists = false", table) + more
    file = study(folder, text)
    points = points_of(file)
    return Plan(file, {}), points, manifests_of(file, points)


def test_cycles_are_counted_by_the_model(tmp_path: Path) -> None:
    """With the keys that the RTL's frames have, and without a simulator."""
    plan, (point, *_), manifests = plan_of_cycles(tmp_path, "[cycles]")
    jobs = plan.jobs(point, manifests[point.name], None)
    (job,) = jobs.all()
    assert job.kind.name == "counted" and "verilator" not in job.kind.needs
    work.counted(tmp_path, **job.arguments)
    result = figures_of(tmp_path)
    assert result["cycles"] > 32 * 24 and result["rays_per_cycle_in_box"] > 0 and result["bottleneck"]
    frame = jobs.entry(plan, {job.key: tmp_path})["workloads"]["cube"]
    assert frame["is_modelled"] and frame["cycles"] == result["cycles"] and frame["rtl_cycles"] is None


def kinds_of(table: str, folder: Path, more: str = "") -> list[list[str]]:
    """The kinds of jobs of each point of a study of cycles."""
    plan, _, _ = plan_of_cycles(folder, table, more)
    return [[job.kind.name for job in point.all()] for point in Exploration(plan.file, {}).points]


def test_the_rtl_checks_the_first_and_the_last_point(tmp_path: Path) -> None:
    both, model, rtl = ["counted", "cycles"], ["counted"], ["cycles"]
    assert kinds_of("[cycles]", tmp_path) == [both, model, model, both]
    assert kinds_of("[cycles]\ncheck = false", tmp_path) == [model] * 4
    assert kinds_of('[cycles]\nbackend = "rtl"', tmp_path) == [rtl] * 4


def test_the_rtl_takes_points_that_the_model_does_not_know(tmp_path: Path) -> None:
    found = kinds_of("[cycles]", tmp_path, '\n[[point]]\nname = "slices"\nset = { "units.extraSlices" = true }\n')
    assert found == [["cycles"], ["counted"], ["counted"], ["counted"], ["counted", "cycles"]]


def test_the_command_chooses_the_backend(tmp_path: Path) -> None:
    plan, points, manifests = plan_of_cycles(tmp_path, "[cycles]")
    rtl = Plan(plan.file.with_backend("rtl"), {}).jobs(points[0], manifests[points[0].name], None, is_checked=True)
    assert [job.kind.name for job in rtl.all()] == ["cycles"]
    with pytest.raises(UserError, match="counts no cycles"):
        study(tmp_path, STUDY).with_backend("rtl")
