"""Whole studies: on this machine, killed and continued, and on a Dask cluster that loses a worker."""

from __future__ import annotations

import contextlib
import json
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import hostile
import pytest
from click.testing import CliRunner
from colonnade.cli.main import cli
from colonnade.common import ledger
from colonnade.common.errors import UserError
from colonnade.common.input_files import read_input

from colonnade_lab.explore import runners
from colonnade_lab.explore.explore import Exploration
from colonnade_lab.explore.jobs import entry_of
from colonnade_lab.explore.output import Output, check_output
from colonnade_lab.explore.study_file import load_study

STUDY = """title = "Try <b>"
baseline = "32b32s64d"
objectives = ["psnr_min", "psnr_baseline_min"]

[design]
config = "tiny"

[axes]
precision = ["16b16s32d", "32b32s64d"]

[workload]
scenes = ["scene.toml"]
meshes = ["cube"]
size = [32, 24]

[quality]
dists = false
"""

SCENE = """[mesh]
name = "cube"
[camera]
direction = [{}, 0.4, 1.0]
"""


def write_study(folder: Path, direction: float) -> Path:
    (folder / "scene.toml").write_text(SCENE.format(direction))
    (folder / "study.toml").write_text(STUDY)
    return folder / "study.toml"


@pytest.fixture
def study(tmp_path: Path) -> Iterator[Path]:
    """A study of a scene that no other test renders, so that no result is cached before or after."""
    study = write_study(tmp_path, random.random())
    exploration = Exploration(load_study(study), {})
    yield study
    forget(exploration)


@dataclass(frozen=True)
class Explored:
    """A study that ran on this machine without a break, and its figures."""

    direction: float
    figures: dict[str, Any]


@pytest.fixture(scope="module")
def explored_study(tmp_path_factory: pytest.TempPathFactory) -> Explored:
    direction = random.random()
    study = write_study(tmp_path_factory.mktemp("explored"), direction)
    content, _ = explored(study)
    assert content["jobs"]["cached"] == 0
    forget(Exploration(load_study(study), {}))
    return Explored(direction, figures(content))


@pytest.fixture
def again(explored_study: Explored, tmp_path: Path) -> Iterator[Path]:
    """That study without its results."""
    study = write_study(tmp_path, explored_study.direction)
    yield study
    forget(Exploration(load_study(study), {}))


def forget(exploration: Exploration) -> None:
    for point in exploration.points:
        for job in point.all():
            shutil.rmtree(entry_of(job), ignore_errors=True)


def command(study: Path, *more: str) -> list[str]:
    # Not `python -m colonnade`: it would import the sources of the current folder, which lack the compiled extension.
    program = str(Path(sys.executable).with_name("colonnade"))
    return [program, "explore", str(study), "--output", str(study.parent / "out"), *more]


def explored(study: Path, *more: str) -> tuple[dict[str, Any], str]:
    done = subprocess.run(command(study, *more), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    content: dict[str, Any] = json.loads((study.parent / "out" / "study.json").read_text())
    return content, done.stdout


def figures(content: dict[str, Any]) -> dict[str, Any]:
    return {point["name"]: (point["figures"], point["workloads"]) for point in content["points"]}


@pytest.mark.matrix
def test_a_study_killed_in_the_middle_continues_gives_the_same_numbers_and_is_extended(
    again: Path, explored_study: Explored
) -> None:
    running = subprocess.Popen(command(again, "--jobs", "1"), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while not (again.parent / "out" / "study.json").exists():
        assert running.poll() is None
        time.sleep(0.02)
    running.send_signal(signal.SIGKILL)
    running.wait()

    continued, printed = explored(again)
    assert continued["jobs"]["cached"] >= 1
    assert continued["jobs"]["run"] + continued["jobs"]["cached"] == 7
    assert continued["jobs"]["failed"] == 0
    assert "report.html" in printed
    out = again.parent / "out"
    assert len(list((out / "pictures").iterdir())) == 3
    assert (out / "report.html").stat().st_size > 100_000
    assert "16b16s32d" in (out / "points.csv").read_text()
    assert figures(continued) == explored_study.figures

    again.write_text(again.read_text().replace('["16b16s32d", ', '["16b16s32d", "24b24s32d", '))
    extended, _ = explored(again)
    assert [point["name"] for point in extended["points"]] == ["16b16s32d", "24b24s32d", "32b32s64d"]
    assert extended["jobs"]["cached"] == 7
    assert extended["jobs"]["run"] == 3
    assert extended["points"][2]["figures"]["psnr_baseline_min"] == 100.0


def test_tests_are_counted_and_a_picture_that_differs_fails_its_point(study: Path) -> None:
    text = STUDY.replace('objectives = ["psnr_min", "psnr_baseline_min"]', "")
    text = text.replace("[quality]\ndists = false", "[tests]\nsame_pictures = true")
    text = text.replace("size =", "reduce = [20, 12]\nsize =")
    point = '[[point]]\nname = "none"\nset = { "geometry.bvh" = false }\n'
    study.write_text(text.replace("[axes]", f"{point}[axes]"))
    content, _ = explored(study)
    frames = {point["name"]: point["workloads"]["cube, 20"] for point in content["points"]}
    tree, none = frames["32b32s64d"], frames["none"]
    assert none["counters"]["boxTests"] == none["records"]["nodes"] == 0
    assert none["counters"]["triangleTests"] > tree["counters"]["triangleTests"] > 0
    assert tree["records"]["nodes"] > 0 and tree["counters"]["boxTests"] >= tree["counters"]["nodeReads"] > 0
    failures = {point["name"]: point["failures"] for point in content["points"]}
    assert failures["none"] == failures["32b32s64d"] == []
    reason = "its picture differs from that of 32b32s64d"
    found = [(failure["workload"], failure["reason"]) for failure in failures["16b16s32d"]]
    assert found == [("cube, 20", reason), ("cube, 12", reason)]
    assert (study.parent / "out" / "report.html").is_file()
    forget(Exploration(load_study(study), {}))


def test_an_interrupt_ends_all_jobs(study: Path) -> None:
    running = subprocess.Popen(command(study), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    while not (jobs := descendants(running.pid)):
        assert running.poll() is None
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    _, errors = running.communicate()
    assert running.returncode == 130
    assert errors.splitlines()[-1] == "colonnade: error: interrupted"
    assert not any(Path(f"/proc/{job}/cmdline").exists() for job in jobs)


def descendants(number: int) -> list[int]:
    """The processes of jobs below a process. Threads and processes may end while their files are read."""
    found = []
    for threads in Path(f"/proc/{number}/task").iterdir():
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            children = (threads / "children").read_text().split()
            found += [int(child) for child in children if b"explore.worker" in command_line(int(child))]
    return found


def command_line(number: int) -> bytes:
    """The arguments of a process, each ended by a zero byte; nothing of one that has ended."""
    with contextlib.suppress(FileNotFoundError, ProcessLookupError):
        return Path(f"/proc/{number}/cmdline").read_bytes()
    return b""


@contextlib.contextmanager
def cluster(folder: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and two workers of one thread each, as the documentation starts them."""
    dask = Path(sys.executable).parent / "dask"
    file = folder / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    local = ["--host", "127.0.0.1"]
    scheduler = subprocess.Popen(
        [dask, "scheduler", *local, "--port", "0", "--no-dashboard", "--scheduler-file", file], **quiet
    )
    workers: list[subprocess.Popen[bytes]] = []
    try:
        while not file.exists():
            assert scheduler.poll() is None
            time.sleep(0.1)
        resources = ["--nthreads", "1", "--no-dashboard", "--resources", "memory=4000 java=1"]
        for _ in range(2):
            place = ["--scheduler-file", file, "--local-directory", folder]
            workers.append(subprocess.Popen([dask, "worker", *local, *place, *resources], **quiet))
        yield json.loads(file.read_text())["address"], workers
    finally:
        for process in (*workers, scheduler):
            process.terminate()
        for process in (*workers, scheduler):
            process.wait()


@pytest.mark.matrix
def test_a_cluster_that_loses_a_worker_gives_the_same_numbers(again: Path, explored_study: Explored) -> None:
    with cluster(again.parent) as (address, workers):
        patient = "from colonnade_lab.explore import runners; runners.CONNECT_SECONDS = 100_000"
        code = f"{patient}; from colonnade.cli.main import cli; cli()"
        running = subprocess.Popen(
            [sys.executable, "-I", "-c", code, *command(again, "--scheduler", address)[1:]],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        while not (again.parent / "out" / "study.json").exists():
            assert running.poll() is None
            time.sleep(0.02)
        kill_with_children(workers[0].pid)
        _, errors = running.communicate()
        assert running.returncode == 0, errors
    there = json.loads((again.parent / "out" / "study.json").read_text())
    assert there["jobs"]["failed"] == 0
    assert there["jobs"]["cached"] == 0
    assert figures(there) == explored_study.figures


def kill_with_children(number: int) -> None:
    """SIGKILL for a worker's nanny and the worker, so that nothing restarts."""
    children = Path(f"/proc/{number}/task/{number}/children").read_text().split()
    for process in (number, *map(int, children)):
        os.kill(process, signal.SIGKILL)


def test_a_scheduler_that_is_not_there_is_one_line(study: Path) -> None:
    result = CliRunner().invoke(
        cli, ["explore", str(study), "--output", str(study.parent / "out"), "--scheduler", "tcp://127.0.0.1:9"]
    )
    assert result.exit_code == 2
    hostile.one_error_line(result.stderr, "no Dask scheduler at tcp://127.0.0.1:9")
    assert not (study.parent / "out").exists()


def test_what_is_no_address_of_a_scheduler_is_one_line(study: Path) -> None:
    addresses = ["", "x://", "x://h:1", "inproc://", "tcp://", "127.0.0.1", "tcp://h:1 x", "tls://127.0.0.1:9"]
    # In a process of its own, whose end shows what Dask's finalisers print
    code = (
        "import json, sys; from click.testing import CliRunner; from colonnade.cli.main import cli\n"
        "done = [CliRunner().invoke(cli, [*sys.argv[2:], '--scheduler', one]) for one in json.loads(sys.argv[1])]\n"
        "print(json.dumps([(each.exit_code, each.stderr) for each in done]))"
    )
    arguments = [json.dumps(addresses), *command(study)[1:]]
    done = subprocess.run([sys.executable, "-I", "-c", code, *arguments], capture_output=True, text=True, check=True)
    assert done.stderr == ""
    for status, line in json.loads(done.stdout):
        assert status == 2
        hostile.one_error_line(line, "scheduler")
    assert not (study.parent / "out").exists()


@pytest.mark.parametrize(
    "answer", [b"", b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n"], ids=["silent", "web"]
)
def test_a_server_of_another_kind_is_one_line(study: Path, answer: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runners, "CONNECT_SECONDS", 0.5)
    connections = []
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            with contextlib.suppress(OSError):
                while True:
                    connections.append(server.accept()[0])
                    connections[-1].sendall(answer)

        threading.Thread(target=serve, daemon=True).start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(UserError, match=f"no Dask scheduler at {address}: "):
            runners.ClusterRunner(address)
        server.shutdown(socket.SHUT_RDWR)
    for connection in connections:
        connection.close()


def filled(out: Path, change: Callable[[], object]) -> None:
    """The output folder of an earlier study, and a change in it."""
    output = Output(out)
    for name in ("study.json", "points.csv", "report.html", "pictures/a.png", "plots/a.svg"):
        output.write(out / name, name.encode())
    change()


def relinked(path: Path) -> None:
    """Move a file or folder out of its folder, and put a link in its place."""
    path.rename(path.parent.parent / "moved")
    path.symlink_to(path.parent.parent / "moved")


def test_an_earlier_study_is_continued_also_after_a_kill(tmp_path: Path) -> None:
    out = tmp_path / "out"
    filled(out, lambda: None)
    # Killed between the line of a file and the file, within a line, and within a file
    with (out / ".colonnade.sha256").open("a") as marker:
        marker.write(f"{64 * '0'}  points.csv\n{64 * '0'}  pictu")
    (out / ".colonnade.abc").write_text("half")
    (out / "plots" / "a.svg").unlink()
    check_output(out)
    Output(out).write(out / "points.csv", b"new")
    check_output(out)


def test_an_output_never_replaces_an_input(tmp_path: Path) -> None:
    with ledger.opened():
        filled(tmp_path / "out", lambda: None)
    with ledger.opened():
        read_input(tmp_path / "out" / "points.csv", "the mesh")
        before = hostile.snapshot(tmp_path)
        with pytest.raises(UserError, match=r"the output .*points\.csv would replace .*which this command reads"):
            Output(tmp_path / "out")
        assert hostile.snapshot(tmp_path) == before


@pytest.mark.parametrize("name", [300 * "x", "x" + 40 * f"/{100 * 'y'}"])
def test_names_that_are_too_long_are_refused_before_the_first_job(study: Path, name: str) -> None:
    result = CliRunner().invoke(cli, ["explore", str(study), "--output", str(study.parent / name)])
    assert result.exit_code == 2
    hostile.one_error_line(result.stderr, "File name too long")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda out: out.write_text("x"), "is a file"),
        (lambda out: out.symlink_to("elsewhere"), "is a symbolic link: --output names a folder"),
        (lambda out: (out.mkdir(), (out / "thesis.txt").write_text("x")), "holds files, but no .colonnade.sha256"),
        (lambda out: (out.mkdir(), (out / "study.json").write_text('{"version": 1}')), "but no .colonnade.sha256"),
        (lambda out: filled(out, lambda: (out / "thesis.txt").write_text("x")), "holds thesis.txt, which colonnade"),
        (lambda out: filled(out, lambda: (out / "points.csv").write_text("x")), "points.csv, which was changed after"),
        (
            lambda out: filled(out, lambda: relinked(out / "report.html")),
            "holds report.html, which colonnade",
        ),
        (
            lambda out: filled(out, lambda: relinked(out / "pictures")),
            "holds pictures, which colonnade",
        ),
        (lambda out: filled(out, lambda: relinked(out / ".colonnade.sha256")), "but no .colonnade.sha256"),
        (lambda out: filled(out, lambda: (out / "plots" / "more").mkdir()), "holds plots/more, which colonnade"),
    ],
)
def test_other_peoples_folders_are_refused(study: Path, make: Any, message: str) -> None:
    out = study.parent / "out"
    make(out)
    before = hostile.snapshot(study.parent)
    result = CliRunner().invoke(cli, ["explore", str(study), "--output", str(out)])
    assert result.exit_code == 2
    hostile.one_error_line(result.stderr, message)
    assert hostile.snapshot(study.parent) == before


def test_check_lists_the_points_and_writes_nothing(study: Path) -> None:
    result = CliRunner().invoke(cli, ["explore", str(study), "--output", str(study.parent / "out"), "--check"])
    assert result.output.splitlines() == ["16b16s32d", "32b32s64d", "2 points, 7 jobs"]
    assert not (study.parent / "out").exists()
    assert CliRunner().invoke(cli, ["explore", str(study), "--check"]).output == result.output
    missing = CliRunner().invoke(cli, ["explore", str(study)])
    assert missing.exit_code == 2
    hostile.one_error_line(missing.stderr, "--output DIR is missing; --check does without")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('["cube"]', '["kube"]', ":13: "),
        ("scene.toml", "none.toml", ":12: "),
        ("[quality]", "[area]\n[quality]", None),
        ('"Try <b>"\n', '"Try"\nlibraries = ["cells"]\n', ":2: the library cells has no files: --library cells=FILE"),
    ],
)
def test_what_is_missing_is_refused_before_the_first_job(
    study: Path, old: str, new: str, message: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    study.write_text(study.read_text().replace(old, new))
    if message is None:
        monkeypatch.setitem(sys.modules, "pyosys", None)
        message = "area needs Yosys: run tools/environment ppa"
    result = CliRunner().invoke(cli, ["explore", str(study), "--output", str(study.parent / "out")])
    assert result.exit_code == 2
    hostile.one_error_line(result.stderr, message)
    assert not (study.parent / "out").exists()
