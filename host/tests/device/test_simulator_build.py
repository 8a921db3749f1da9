"""The cache of simulators: its keys, and the removal of wrong simulators."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from colonnade.common import cache
from colonnade.common.errors import UserError
from colonnade.common.progress import Progress, Report
from colonnade.design.generator import GeneratedDesign, design_for
from colonnade.device import simulator_build
from colonnade.device.simulator_build import PROGRAM, Tools, build_simulator, verilator_command


@dataclass
class Notes(Progress):
    """Collects notes."""

    said: list[str] = field(default_factory=list)

    @contextmanager
    def step(self, title: str) -> Iterator[Report]:
        yield lambda share: None

    def note(self, text: str) -> None:
        self.said.append(text)


@dataclass
class Builder:
    """Replaces Verilator: writes a program that prints the number of builds."""

    tools: Tools
    builds: int = 0
    fails: bool = False

    def __call__(
        self, tools: Tools, design: GeneratedDesign, harness: Path, output: Path, log: Path, waveform: bool = False
    ) -> None:
        self.builds += 1
        if self.fails:
            (output / "half").write_text("half")
            raise RuntimeError(f"the simulator does not build (status 1): see {log}")
        (output / PROGRAM).write_text(f"build {self.builds}")


@dataclass(frozen=True)
class Design:
    """Replaces generated Verilog."""

    text: str = "module Colonnade;"
    manifest = SimpleNamespace(has_queries=False)

    def digest(self) -> str:
        return self.text


@pytest.fixture
def builder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Builder:
    builder = Builder(Tools(Path("verilator"), Path("g++"), ("Verilator 5.006", "g++ 12.2.0")))
    monkeypatch.setattr(simulator_build, "simulator_tools", lambda: builder.tools)
    monkeypatch.setattr(simulator_build, "require_right_compiler", lambda compiler, flags: None)
    monkeypatch.setattr(simulator_build, "cache_directory", lambda root: tmp_path)
    monkeypatch.setattr(simulator_build, "_build", builder)
    return builder


def forget() -> None:
    """Forget verified entries, as a new process does."""
    cache._verified.clear()


def test_a_simulator_is_built_once(builder: Builder) -> None:
    first = build_simulator(Design())  # type: ignore[arg-type]
    forget()
    assert build_simulator(Design()) == first  # type: ignore[arg-type]
    assert builder.builds == 1


def test_design_and_versions_are_in_the_key(builder: Builder) -> None:
    paths = {build_simulator(Design()), build_simulator(Design("module Other;"))}  # type: ignore[arg-type]
    builder.tools = replace(builder.tools, versions=("Verilator 5.048", "g++ 12.2.0"))
    paths.add(build_simulator(Design()))  # type: ignore[arg-type]
    builder.tools = replace(builder.tools, versions=("Verilator 5.006", "g++ 14.1.0"))
    paths.add(build_simulator(Design()))  # type: ignore[arg-type]
    assert builder.builds == len(paths) == 4


def test_quick_simulators_are_others(builder: Builder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLONNADE_QUICK_SIMULATORS", "1")
    quick, command = build_simulator(Design()), verilator_command(builder.tools)  # type: ignore[arg-type]
    monkeypatch.delenv("COLONNADE_QUICK_SIMULATORS")
    assert build_simulator(Design()) != quick  # type: ignore[arg-type]
    assert "OPT_FAST=-O0" in command and "OPT_FAST=-O3" in verilator_command(builder.tools)


@pytest.mark.parametrize("poison", ["other", "cut", "gone", "unsealed"])
def test_a_wrong_simulator_is_removed_from_the_cache(builder: Builder, poison: str) -> None:
    program = build_simulator(Design())  # type: ignore[arg-type]
    match poison:
        case "other":
            program.write_text("build X")
        case "cut":
            program.write_text("")
        case "gone":
            program.unlink()
        case "unsealed":
            (program.parent / cache.CONTENTS).unlink()
    forget()
    notes = Notes()
    assert build_simulator(Design(), notes).read_text() == "build 2"  # type: ignore[arg-type]
    assert notes.said == ["the cached simulator was damaged and is built again"]
    forget()
    build_simulator(Design(), notes)  # type: ignore[arg-type]
    assert builder.builds == 2


def test_a_failed_build_leaves_nothing_but_its_log(builder: Builder, tmp_path: Path) -> None:
    builder.fails = True
    with pytest.raises(RuntimeError, match=r"does not build \(status 1\): see .*\.log$"):
        build_simulator(Design())  # type: ignore[arg-type]
    assert not [path for path in (tmp_path / "simulator").iterdir() if path.suffix not in (".lock", ".log")]
    builder.fails = False
    assert build_simulator(Design()).read_text() == "build 2"  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["a b", "it's", "x;y", "a`b`", "c#d", "e:f", 'g"h', "i\\j", "k$l"])
def test_a_path_that_make_does_not_accept_is_rejected(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / name
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    tools = Tools(Path("verilator"), Path("g++"), ("", ""))
    with pytest.raises(UserError, match=r"^make cannot build a simulator in .*: set TMPDIR to a plain path$"):
        simulator_build._build(tools, Design(), tmp_path, tmp_path, tmp_path / "log")  # type: ignore[arg-type]
    assert not any(folder.iterdir())


@pytest.mark.verilator
@pytest.mark.matrix
def test_a_checkout_may_have_any_name(tmp_path: Path) -> None:
    place = tmp_path / "o'd d`touch pwn`;\"#:x\\y"
    place.mkdir()
    harness = Path(simulator_build.__file__).parent / "harness"
    simulator_build._build(simulator_build.simulator_tools(), design_for("tiny"), harness, place, place / "log")
    assert [path.name for path in place.iterdir()] == [PROGRAM]
    assert [path for folder in (tmp_path, place, Path.cwd()) for path in folder.glob("pwn*")] == []
