"""A data file holds what its commands print, and is refused when its hardware is not today's."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from colonnade.common.errors import UserError
from colonnade.design.toolchain import project_root

from colonnade_lab.figures import catalog, data, digests, kept, measure
from colonnade_lab.figures.catalog import Entry
from colonnade_lab.figures.facts import PRESETS
from colonnade_lab.ppa.library.liberty_files import find_liberties

CONFIG = {"array": {"rows": 1}, "frame": None}
ENTRY = Entry("bench-tiny", "tiny", {"": ("colonnade", "bench", "--config", "tiny", "--json", "REPORT")}, sources=())


@pytest.fixture
def docs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder for data, a catalog of one entry that is not measured, and a generator without Java."""
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / data.UNMEASURED).write_text("bench-tiny\n")
    for module in (data, measure):
        monkeypatch.setattr(module, "manifest_for", lambda *_: SimpleNamespace(manifest=SimpleNamespace(config=CONFIG)))
    monkeypatch.setattr(data, "catalog", lambda: {ENTRY.name: ENTRY})
    monkeypatch.setattr(digests, "_cached", lambda design: f"Verilog of {design.name}")
    monkeypatch.setattr(measure, "commit", lambda: ("c0ffee", False))
    monkeypatch.setattr(measure, "_report", lambda *_: {"config": CONFIG, "rate": 1.5, "path": {"cells": [1], "ns": 2}})
    return tmp_path


def content(docs: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((docs / "data" / "bench-tiny.json").read_text())
    return found


def test_a_data_file_says_what_it_is_of(docs: Path) -> None:
    assert list(data.problems(docs)) == []
    measure.measure(ENTRY, docs)
    found = content(docs)
    assert found.pop("seconds") >= 0
    assert found.pop("processors") >= 1
    assert len(found.pop("date")) == 10
    assert found == {
        "command": ["colonnade bench --config tiny"],
        "commit": "c0ffee",
        "is_modified": False,
        "config": CONFIG,
        "digests": {"tiny": "Verilog of tiny"},
        "result": {"rate": 1.5, "path": {"ns": 2}},
    }
    assert data.unmeasured(docs) == []
    assert list(data.problems(docs)) == []


def test_a_data_file_keeps_what_is_read_a_record_on_a_line(docs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    unread = {"stalls": {"box unit": list(range(900))}, "psnr": 50.0, "cycles": None}
    frame = {"rays_per_cycle_in_box": 2.5, "counters": {"raysInBox": 7, "boxTests": 8, "frames": 1}, **unread}
    area = {"array_kge": 17_040.0, "units": {"BoxUnit": {"kge": 37.0}}}
    point = {"values": {}, "workloads": {"bunny": frame}, "area": {"asap7": area}, "failures": [], "power": {}}
    points = [
        {"name": f"point {index}", "figures": dict.fromkeys(map(str, range(99)), 0.5), **point} for index in (1, 2)
    ]
    study = {"title": "Study", "workloads": [{"name": "bunny"}], "points": points, "jobs": {"run": 9}}
    monkeypatch.setattr(measure, "_report", lambda *_: study)
    measure.measure(ENTRY, docs)
    own = {"rays_per_cycle_in_box": 2.5, "counters": {"raysInBox": 7, "boxTests": 8}}
    found = content(docs)["result"]
    assert found.keys() == {"title", "workloads", "points"}
    assert [each["workloads"] for each in found["points"]] == [{"bunny": own}, {"bunny": own}]
    assert found["points"][0]["area"] == {"asap7": {"array_kge": 17_040.0}}
    lines = (docs / "data" / "bench-tiny.json").read_text().splitlines()
    assert len([line for line in lines if "point " in line]) == 2 and max(map(len, lines)) <= kept.WIDTH + 1


def test_figures_of_the_same_sources_are_not_measured_again(docs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    measure.measure(ENTRY, docs)
    file = docs / "data" / "bench-tiny.json"
    file.write_text(json.dumps(content(docs) | {"seconds": 1000.0}))
    monkeypatch.setattr(measure, "_report", lambda *_: {"config": CONFIG, "rate": 2.5})
    measure.measure(ENTRY, docs)
    assert content(docs)["result"]["rate"] == 1.5
    measure.measure(ENTRY, docs, again=True)
    # What is in the caches takes no time: the longer one counts
    assert (content(docs)["result"]["rate"], content(docs)["seconds"]) == (2.5, 1000.0)
    file.write_text(json.dumps(content(docs) | {"digests": {"tiny": "other Verilog"}}))
    monkeypatch.setattr(measure, "commit", lambda: ("another", False))
    measure.measure(ENTRY, docs)
    assert (content(docs)["commit"], content(docs)["seconds"] == 1000) == ("another", False)


def test_a_report_of_other_hardware_is_refused(docs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measure, "_report", lambda *_: {"config": {"array": {"rows": 9}}})
    with pytest.raises(UserError, match="another configuration than tiny"):
        measure.measure(ENTRY, docs)
    monkeypatch.setattr(measure, "_report", lambda *_: {"config": "tiny", "equal": True})
    measure.measure(ENTRY, docs)
    assert content(docs)["result"] == {"equal": True}


def test_configurations_of_older_versions_are_migrated(docs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    measure.measure(ENTRY, docs)
    older, read = {"version": 3, "array": {"rows": 1}, "frame": {"rays": True}}, []

    def generator(config: str, *_: object) -> SimpleNamespace:
        read.extend([json.loads(Path(config).read_text())] if config.endswith(".json") else [])
        return SimpleNamespace(manifest=SimpleNamespace(config={"version": 4, "array": {"rows": 1}}))

    monkeypatch.setattr(data, "manifest_for", generator)
    (docs / "data" / "bench-tiny.json").write_text(json.dumps(content(docs) | {"config": older}))
    assert not list(data.problems(docs)) and read == [older]


def test_figures_of_other_hardware_are_refused(docs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    measure.measure(ENTRY, docs)
    file = docs / "data" / "bench-tiny.json"
    file.write_text(json.dumps(content(docs) | {"config": {"array": {"rows": 2}, "frame": None}}))
    (problem,) = data.problems(docs)
    assert "another configuration than tiny (array.rows)" in problem
    assert "run tools/figures bench-tiny" in problem

    # A key that is younger than the file has the value of tiny
    file.write_text(json.dumps(content(docs) | {"config": {"array": {"rows": 1}}}))
    assert not list(data.problems(docs))

    def refuse(*_: object) -> None:
        raise UserError("unknown key array.row")

    monkeypatch.setattr(data, "manifest_for", refuse)
    assert "the generator refuses its configuration: unknown key array.row" in next(data.problems(docs))


def test_figures_of_other_verilog_are_refused(docs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    measure.measure(ENTRY, docs)
    file, cached = docs / "data" / "bench-tiny.json", digests._cached
    file.write_text(json.dumps(content(docs) | {"digests": {"tiny": "0" * 64}}))
    (problem,) = data.problems(docs)
    assert problem == (
        "data/bench-tiny.json: the Verilog of tiny changed (measured at c0ffee): run tools/figures bench-tiny"
    )
    assert [line.split()[:3] for line in data.digest_table(docs)] == [["bench-tiny", "c0ffee", "stale"]]
    # A list admits that a file waits for its measurement
    (docs / "data" / data.UNMEASURED).write_text("bench-tiny\n")
    assert not list(data.problems(docs))
    (docs / "data" / data.UNMEASURED).unlink()
    # The quick check knows only what is cached
    monkeypatch.setattr(digests, "_cached", lambda _: None)
    assert not list(data.problems(docs))
    monkeypatch.setattr(digests, "_cached", cached)
    file.write_text(json.dumps(content(docs) | {"digests": {"huge": "0" * 64}}))
    (problem,) = data.problems(docs)
    assert "its digest of huge belongs to no measurement, it has no digest of tiny" in problem


def test_figures_of_other_sources_are_refused(docs: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    model = tmp_path / "model.hpp"
    model.write_text("int half(int x) { return x / 2; }\n")
    monkeypatch.setattr(digests, "project_root", lambda: tmp_path)
    monkeypatch.setattr(digests, "SOURCES", {"model": ("*.hpp",)})
    entry = replace(ENTRY, designs=(), sources=("model",))
    monkeypatch.setattr(data, "catalog", lambda: {entry.name: entry})
    measure.measure(entry, docs)
    assert not list(data.problems(docs))
    model.write_text("int half(int x) { return x >> 1; }\n")
    (problem,) = data.problems(docs)
    assert "sources of model changed" in problem


def test_figures_of_another_study_or_scene_are_refused(
    docs: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    study, scene = tmp_path / "scenes" / "study.toml", tmp_path / "scenes" / "cube.toml"
    scene.parent.mkdir()
    scene.write_text('mesh.name = "cube"\n')
    study.write_text('title = "A"\n[workload]\nscenes = ["cube.toml"]\nsize = [8, 8]\n')
    monkeypatch.setattr(digests, "project_root", lambda: tmp_path)
    entry = replace(ENTRY, commands={"": (*ENTRY.commands[""], "scenes/study.toml")})
    monkeypatch.setattr(data, "catalog", lambda: {entry.name: entry})
    measure.measure(entry, docs)
    study.write_text(study.read_text().replace('"A"', '"B"') + "# why\n")
    assert not list(data.problems(docs))
    for file, before, after in ((study, "[8, 8]", "[9, 8]"), (scene, "cube", "sphere")):
        text = file.read_text()
        file.write_text(text.replace(before, after))
        (problem,) = data.problems(docs)
        assert "scenes changed" in problem
        file.write_text(text)


@pytest.mark.parametrize(
    ("suffix", "text", "same", "other"),
    [
        (
            "sv",
            '// Generated by CIRCT\nmodule A(\n  input [3:0] a, // @[A.scala:7:2]\n  b\n);\n  $error("a // b");\n',
            '/* B */ module A (input [3:0] a,b);$error("a // b");',
            'module A (input [3:0] a,b);$error("a // c");',
        ),
        (
            "sv",
            'module A;$error("failed\\n    at A.scala:77 assert");',
            'module A;$error("failed\\n    at A.scala:8 assert");',
            'module A;$error("failed\\n    at A.scala:8 assume");',
        ),
        (
            "hpp",
            '#define CALL(x) \\\n    f(x, "one ")\nconst char* t = "a b";\n',
            '#define CALL(x) f(x, \\\n               "one ")\nconst char* t = "a "\n                "b";\n',
            '#define CALL(x) f(x, "one ")\nconst char* t = "a c";\n',
        ),
        (
            "py",
            'from a import (\n    b,\n)\nimport c\n\ndef f():\n    """Text."""\n    return "# 1"  # why\n',
            'from c import b\ndef f():\n    """Other\n\n    text."""\n    # why\n    return "# 1"\n',
            'def f():\n    return "# 2"\n',
        ),
    ],
)
def test_a_digest_is_of_meaning(tmp_path: Path, suffix: str, text: str, same: str, other: str) -> None:
    files = [tmp_path / f"{number}.{suffix}" for number in range(3)]
    for file, content in zip(files, (text, same, other), strict=True):
        file.write_text(content)
    first, second, third = (digests.digest_of([file]) for file in files)
    assert first == second != third
    assert digests.digest_of(files) == digests.digest_of(reversed(files)) != digests.digest_of(files[:2])


def test_each_configuration_is_emitted_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "A.sv").write_text("module A; endmodule\n")
    emitted: list[str] = []

    def design(config: str, overrides: tuple[str, ...]) -> SimpleNamespace:
        emitted.append(" ".join((config, *overrides)))
        return SimpleNamespace(sources=[tmp_path / "A.sv"])

    monkeypatch.setattr(digests, "design_for", design)
    monkeypatch.setattr(digests, "cache_directory", lambda _: tmp_path)
    wide = replace(ENTRY, overrides=("array.rows=2",))
    assert digests.digests_of(wide) == {"tiny array.rows=2": None}
    for _ in range(2):
        digests.emit([ENTRY, wide, ENTRY])
    assert sorted(emitted) == ["tiny", "tiny array.rows=2"]
    assert digests.digests_of(wide) == {"tiny array.rows=2": digests.digest_of([tmp_path / "A.sv"])}


def test_every_source_of_a_digest_exists() -> None:
    used = {name for entry in catalog.catalog().values() for name in entry.sources}
    assert used == digests.SOURCES.keys()
    root = project_root()
    assert all(list(root.glob(pattern)) for patterns in digests.SOURCES.values() for pattern in patterns)


def test_a_key_that_is_younger_than_the_file_has_its_default_in_every_section(monkeypatch: pytest.MonkeyPatch) -> None:
    configs = {
        ("edge", ()): {"maps": {"width": 64, "encoding": "twoLevel"}, "cache": None},
        ("tiny", ()): {"maps": None, "cache": None},
    }
    complete = {"maps": {"width": 640, "encoding": "twoLevel"}, "cache": {"lines": 8}}

    def generated(config: str, overrides: tuple[str, ...] = ()) -> SimpleNamespace:
        return SimpleNamespace(manifest=SimpleNamespace(config=configs.get((config, overrides), complete)))

    monkeypatch.setattr(data, "manifest_for", generated)
    entry = replace(ENTRY, config="edge")
    assert data.config_problem(entry, {"config": {"maps": {"width": 64}}}) is None
    assert "(maps.width)" in str(data.config_problem(entry, {"config": {"maps": {"width": 65}}}))


def test_files_and_the_list_of_what_is_not_measured_agree(docs: Path) -> None:
    (docs / "data" / data.UNMEASURED).write_text("bench-tiny\nbench-huge\n")
    (docs / "data" / "old.json").write_text("{}")
    measured = {"config": CONFIG, "digests": digests.digests_of(ENTRY)}
    (docs / "data" / "bench-tiny.json").write_text(json.dumps(measured))
    lines = list(data.problems(docs))
    assert len(lines) == 3
    assert all(name in line for name, line in zip(("old.json", "bench-huge", "bench-tiny"), lines, strict=True))
    (docs / "data" / data.UNMEASURED).unlink()
    (docs / "data" / "old.json").unlink()
    assert list(data.problems(docs)) == []
    (docs / "data" / "bench-tiny.json").unlink()
    assert list(data.problems(docs)) == ["data/bench-tiny.json is missing: run tools/figures bench-tiny"]


def test_an_array_has_one_size_in_all_files(docs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cached = {"array": {"columns": 1}, "columnBvhMemory": {"cache": {}}}
    area = Entry("area-tiny-asap7", "tiny", {"": ("colonnade",)}, libraries=("ASAP7",))
    entries = {each.name: each for each in (area, Entry("study", "tiny", {"": ("colonnade",)}))}
    report: dict[str, Any] = {
        "units": {},
        "chip": {"um2_per_gate": 0.5},
        "slowest_path": dict.fromkeys(("ns", "fo4", "unit")),
    }
    report["levels"] = {"array": {"kge": 17_040.0, "logic_kge": 1.0}, "traversal_unit": {"kge": 1.0}}

    def problems(size: float, config: dict[str, Any]) -> list[str]:
        point = {"name": "base", "config_values": config, "area": {"asap7": {"array_kge": size}}}
        for name, result in (("area-tiny-asap7", report), ("study", {"points": [point]})):
            (docs / "data" / f"{name}.json").write_text(json.dumps({"config": cached, "result": result}))
        return list(data._size_problems(data.Data(docs), entries))

    sizes = "the array of base has 17.28 MGE, in data/area-tiny-asap7.json 17.04 MGE"
    differs = f"data/study.json: {sizes}: run tools/figures study"
    assert problems(17_040.0, cached) == []
    assert problems(17_280.0, cached) == [differs]
    assert problems(17_280.0, cached | {"array": {"columns": 2}}) == []
    monkeypatch.setattr(data, "catalog", lambda: entries)
    monkeypatch.setattr(data, "problem_of", lambda *_: None)
    (docs / "data" / data.UNMEASURED).unlink()
    assert problems(17_280.0, cached) == list(data.problems(docs))


def test_the_catalog_measures_every_preset() -> None:
    presets = {file.stem for file in (project_root() / "configs").glob("*.json")}
    assert set(PRESETS) == presets
    entries = catalog.catalog()
    assert all(f"area-{preset}-asap7" in entries for preset in presets)
    assert {entry.name for entry in catalog.selected(("fpga", "area-edge"))} == {
        "fpga",
        "area-edge-asap7",
        "area-edge-sky130",
    }
    assert [entry.name for entry in catalog.selected(("light",))] == ["light"]  # not light-users
    with pytest.raises(KeyError):
        catalog.selected(("beauty",))
    classes = [{entry.name for entry in catalog.selected((name,))} for name in catalog.CLASSES]
    assert sum(map(len, classes)) == len(entries) == len(set.union(*classes))
    changed, released, sourced = classes
    assert {f"bench-{name}" for name in ("edge", "lean", "small", "tiny", "fpga")} < changed
    assert {"scaling", "bvh-cycles"} < released and {"quality-edge", "environments"} < sourced


def test_a_release_shows_no_figure_of_an_unknown_commit_or_of_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = {"bench-edge": ("aaaa", False), "rooms": ("bbbb", False), "bench-lean": ("aaaa", True)}
    monkeypatch.setattr(data, "catalog", lambda: {name: catalog.catalog()[name] for name in known})
    monkeypatch.setattr(data, "_git", lambda *arguments: "" if "aaaa" in arguments else None)
    (tmp_path / "data").mkdir()
    for name, (head, is_modified) in known.items():
        content = {"commit": head, "is_modified": is_modified}
        (tmp_path / "data" / f"{name}.json").write_text(json.dumps(content))
    (tmp_path / "data" / data.UNMEASURED).write_text("scaling\n")
    assert list(data.release_problems(tmp_path)) == [
        "data/unmeasured.txt: scaling is not measured: run tools/figures scaling",
        "data/rooms.json: its commit bbbb is not in the history: run tools/figures --again rooms",
        "data/bench-lean.json: it is of changes to commit aaaa: run tools/figures --again bench-lean",
    ]


def test_libraries_are_those_of_variables_or_fetched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entries = catalog.selected(("area-tiny", "energy-area"))
    monkeypatch.delenv("ASAP7", raising=False)
    monkeypatch.setenv("COLONNADE_DOWNLOADS", str(tmp_path))
    (tmp_path / "asap7_simple.lib.gz").touch()
    with pytest.raises(UserError, match=r"asap7_simple\.lib\.gz, from COLONNADE_DOWNLOADS, is another file"):
        measure.require_libraries(entries)
    files = [tmp_path / name for name in ("a.lib", "b.lib")]
    for file in files:
        file.touch()
    monkeypatch.setenv("ASAP7", " ".join(map(str, files)))
    measure.require_libraries(entries)
    assert find_liberties(("ASAP7",)) == find_liberties(("asap7",)) == tuple(files)
    assert data.commands_of(entries[0]) == ["colonnade ppa --config tiny --liberty ASAP7"]
