"""Signals end a command and all processes that it started, also if only its own process gets the signal."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from colonnade_lab.common.parallel import in_order

from colonnade.common import processes

#: Imitates a study: two threads, each with a temporary folder and a stand-in for the simulator with a child process.
STUDY = """
import sys, time
from pathlib import Path
from colonnade.common import processes
from colonnade_lab.common.parallel import in_order
from colonnade.common.temporary import temporary_folder

def one(number):
    with temporary_folder(".job.", Path(sys.argv[1])) as place:
        code = "import subprocess, sys; subprocess.run(['sleep', '100000'])"
        processes.run([sys.executable, "-c", code])

def main():
    if sys.argv[2] == "alone":
        one(0)
    elif sys.argv[2] == "busy":
        list(in_order(lambda number: time.sleep(100_000), range(4), 2))
    else:
        processes.CLEANUP_SECONDS = 100_000
        for result in in_order(one, range(4), 2):
            pass

processes.guarded(main)
"""


def children(pid: int) -> list[int]:
    """All descendants of a process, from /proc."""
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, task.read_text().split()):
            found += [child, *children(child)]
    return found


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_for(condition: Callable[[], bool]) -> None:
    while not condition():
        time.sleep(0.02)


@pytest.fixture
def begun() -> Iterator[list[subprocess.Popen[str]]]:
    running: list[subprocess.Popen[str]] = []
    yield running
    for process in running:
        process.kill()


@pytest.mark.parametrize(
    ("kind", "programs", "number"),
    [
        *(("pool", 4, number) for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGXCPU)),
        *((kind, programs, signal.SIGINT) for kind, programs in (("alone", 2), ("busy", 0))),
        *((kind, programs, signal.SIGTERM) for kind, programs in (("alone", 2), ("busy", 0))),
    ],
)
def test_a_signal_to_the_parent_ends_everything(
    kind: str, programs: int, number: signal.Signals, tmp_path: Path, begun: list[subprocess.Popen[str]]
) -> None:
    command = [sys.executable, "-c", STUDY, str(tmp_path), kind]
    # `nohup make test` ignores hangups
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, text=True, preexec_fn=lambda: signal.signal(number, signal.SIG_DFL)
    )
    begun.append(process)
    wait_for(lambda: len(children(process.pid)) == programs)
    if programs == 0:
        wait_for(lambda: len(list(Path(f"/proc/{process.pid}/task").iterdir())) > 2)
    below = children(process.pid)
    time.sleep(0.1)
    process.send_signal(number)
    _, said = process.communicate()
    assert process.returncode == 128 + number
    assert said == f"colonnade: error: {processes._WORDS.get(number, 'terminated')}\n"
    assert not [pid for pid in below if is_running(pid)]
    assert list(tmp_path.iterdir()) == []


def test_a_program_that_ignores_sigterm_is_killed(tmp_path: Path) -> None:
    group = processes.Group()
    code = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('ready', flush=True); signal.pause()"
    ended = []

    def work() -> None:
        group.join()
        try:
            with processes.started([sys.executable, "-c", code], stdout=subprocess.PIPE) as process:
                assert process.stdout is not None
                process.stdout.readline()
                ready.set()
        except processes.Ended:
            ended.append(process.returncode)

    ready = threading.Event()
    thread = threading.Thread(target=work)
    thread.start()
    ready.wait()
    group.end()
    thread.join()
    assert ended == [-signal.SIGKILL]


def test_an_ended_group_starts_nothing(tmp_path: Path) -> None:
    group = processes.Group()
    group.end()
    raised = []

    def work() -> None:
        group.join()
        try:
            processes.run(["touch", str(tmp_path / "file")])
        except processes.Ended as ended:
            raised.append(ended)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert raised
    assert list(tmp_path.iterdir()) == []


def test_an_error_in_one_task_ends_the_others() -> None:
    def work(seconds: int) -> None:
        if seconds == 0:
            time.sleep(0.2)
            raise ValueError("wrong")
        processes.run(["sleep", str(seconds)])

    with pytest.raises(ValueError, match="wrong"):
        list(in_order(work, [0, 100_000, 100_000], 2))
    wait_for(lambda: not processes._running)


def test_runs_programs_as_subprocess_does(tmp_path: Path) -> None:
    done = processes.run(["sh", "-c", "echo out; echo err >&2; pwd; exit 3"], cwd=tmp_path, env=os.environ)
    assert (done.returncode, done.stdout, done.stderr) == (3, f"out\n{tmp_path}\n", "err\n")
    with (tmp_path / "log").open("w") as log:
        assert processes.run(["echo", "text"], stdout=log, stderr=subprocess.STDOUT).stdout is None
    assert (tmp_path / "log").read_text() == "text\n"
    assert processes._running == {}


def test_a_program_ends_when_its_block_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "GRACE", 100_000)
    with pytest.raises(KeyError), processes.started(["sleep", "100000"]) as process:
        raise KeyError
    assert process.returncode == -signal.SIGTERM


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells programs of their parent's end")
def test_programs_end_when_their_parent_is_killed(tmp_path: Path, begun: list[subprocess.Popen[str]]) -> None:
    code = "from colonnade.common import processes; processes.run(['sleep', '100000'])"
    process = subprocess.Popen([sys.executable, "-c", code], text=True)
    begun.append(process)
    wait_for(lambda: len(children(process.pid)) == 1)
    (below,) = children(process.pid)
    time.sleep(0.1)
    process.kill()
    wait_for(lambda: not is_running(below))


def test_a_signal_at_a_new_folder_leaves_nothing(tmp_path: Path) -> None:
    program = """
import os, signal, sys, tempfile
from pathlib import Path
from colonnade.common import processes, temporary

make = tempfile.mkdtemp

def interrupted(**options):
    folder = make(**options)
    os.kill(os.getpid(), signal.SIGINT)
    return folder

def main():
    with temporary.temporary_folder(".job.", Path(sys.argv[1])):
        pass

tempfile.mkdtemp = interrupted
processes.guarded(main)
"""
    assert interrupted(program, tmp_path)
    assert list(tmp_path.iterdir()) == []


def interrupted(program: str, folder: Path) -> bool:
    """Run a program, with the installed package; whether it ends as an interrupted one, in one line."""
    done = processes.run([sys.executable, "-c", program, folder], cwd=folder)
    return (done.returncode, done.stderr) == (130, "colonnade: error: interrupted\n")


def test_a_signal_whose_exception_is_caught_interrupts_again(tmp_path: Path) -> None:
    program = """
import os, signal, time
from colonnade.common import processes

def main():
    try:
        os.kill(os.getpid(), signal.SIGINT)
    except BaseException:
        pass
    time.sleep(100_000)

processes.INSIST_SECONDS = 0.1
processes.guarded(main)
"""
    assert interrupted(program, tmp_path)


def test_a_signal_while_a_library_does_not_return_is_obeyed(tmp_path: Path) -> None:
    """The call waits for a lock without end, and without Python's; the files that it writes go."""
    program = """
import ctypes, os, signal, threading
from pathlib import Path
from colonnade.common import processes
from colonnade.common.atomic_files import replacing
from colonnade.common.temporary import temporary_folder

def main():
    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
    with temporary_folder(".job.", Path()), replacing(Path("picture.png")):
        library, lock = ctypes.CDLL(None), ctypes.create_string_buffer(256)
        library.pthread_mutex_lock(lock)
        library.pthread_mutex_lock(lock)

processes.guarded(main)
"""
    assert interrupted(program, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_signal_at_the_end_of_python_does_not_wait_for_threads(tmp_path: Path) -> None:
    program = """
import os, queue, signal, threading
from colonnade.common import processes

def main():
    threading.Thread(target=queue.SimpleQueue().get).start()
    threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT)).start()

processes.guarded(main)
"""
    assert interrupted(program, tmp_path)


def test_wrong_input_of_a_tool_is_one_line(tmp_path: Path) -> None:
    program = """
from colonnade.common import processes
from colonnade.common.errors import UserError

def main():
    raise UserError("no scene")

processes.tool(main)
"""
    done = processes.run([sys.executable, "-c", program], cwd=tmp_path)
    assert (done.returncode, done.stderr) == (2, "colonnade: error: no scene\n")


def test_signals_are_handled_before_the_commands_are_imported() -> None:
    code = (
        "import importlib.metadata as m, sys; s, = m.entry_points(group='console_scripts', name='colonnade'); s.load();"
        "print([name for name in sys.modules if name.startswith(('click', 'numpy', 'colonnade.cli'))])"
    )
    assert processes.run([sys.executable, "-c", code]).stdout == "[]\n"
