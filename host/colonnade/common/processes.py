"""Programs that the host starts, and how a signal ends all of them.

Each program runs in a process group of its own, so that its own children end with it. SIGINT, SIGTERM and SIGHUP raise
`Interrupted` in the main thread; `guarded` then ends every program, removes what is temporary and leaves.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, NoReturn

#: Seconds between SIGTERM and SIGKILL for a program that is ended.
GRACE = 0.5

#: Seconds that threads have to clean up after their programs have ended.
LAST_WORDS = 0.7

#: Seconds after a signal in which further ones change nothing; `timeout` and terminals may send several.
DEAF = 3.0

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

_Stream = int | IO[str] | None


class Interrupted(BaseException):
    """A signal asks this process to end."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


class Ended(RuntimeError):
    """The group of this program has ended: nothing more is started in it."""


class Group:
    """Programs that end together: those of one pool of threads."""

    def __init__(self) -> None:
        self.is_ended = False

    def join(self) -> None:
        """What this thread starts from now on belongs to the group."""
        _here.group = self

    def end(self) -> None:
        """End the group's programs and start no more of them."""
        self.is_ended = True
        with _lock:
            members = [process for process, group in _running.items() if group is self]
        _end(members)


class _Here(threading.local):
    def __init__(self) -> None:
        self.group: Group | None = None


_here = _Here()
_lock = threading.RLock()
_running: dict[subprocess.Popen[str], Group | None] = {}
_when_leaving: list[Callable[[], None]] = []

#: The signal that came, and when; the main thread is between the start of a program and its entry in `_running`.
_signal: int | None = None
_signal_time = 0.0
_is_held = False
_is_leaving = False


@contextlib.contextmanager
def started(
    command: Sequence[object],
    *,
    cwd: Path | None = None,
    env: Mapping[str, str] | None = None,
    stdout: _Stream = None,
    stderr: _Stream = None,
) -> Iterator[subprocess.Popen[str]]:
    """Start a program, without standard input, and wait for it after the block; it ends if the block fails.

    Args:
        command: the program and its arguments, strings or paths.
        cwd, env, stdout, stderr: as of `subprocess.Popen`.

    Raises:
        Ended: the group of this thread has ended, before or meanwhile.
    """
    group = _here.group
    process: subprocess.Popen[str] | None = None
    try:
        with _held():
            process = _start(group, command, cwd, env, stdout, stderr)
        yield process
        process.wait()
        _refuse_ended(group)
    except BaseException:
        if process is not None:
            _end([process])
        raise
    finally:
        if process is not None:
            for stream in (process.stdout, process.stderr):
                if stream is not None:
                    stream.close()
            with _lock:
                _running.pop(process, None)


def run(
    command: Sequence[object],
    *,
    cwd: Path | None = None,
    env: Mapping[str, str] | None = None,
    stdout: _Stream = subprocess.PIPE,
    stderr: _Stream = subprocess.PIPE,
) -> subprocess.CompletedProcess[str]:
    """Run a program to its end, as `subprocess.run` does; its output as text, unless it goes elsewhere."""
    with started(command, cwd=cwd, env=env, stdout=stdout, stderr=stderr) as process:
        output, errors = process.communicate()
    return subprocess.CompletedProcess(list(map(str, command)), process.returncode, output, errors)


def _start(
    group: Group | None,
    command: Sequence[object],
    cwd: Path | None,
    env: Mapping[str, str] | None,
    stdout: _Stream,
    stderr: _Stream,
) -> subprocess.Popen[str]:
    # Under the lock, so that whoever ends a group finds all of its programs
    with _lock:
        _refuse_ended(group)
        process = subprocess.Popen(
            list(map(str, command)),
            cwd=cwd,
            env=env,
            stdin=subprocess.DEVNULL,
            stdout=stdout,
            stderr=stderr,
            text=True,
            errors="replace",
            start_new_session=True,
        )
        _running[process] = group
        return process


def _refuse_ended(group: Group | None) -> None:
    if _is_leaving or (group is not None and group.is_ended):
        raise Ended("the work that this program belongs to has ended")


def _end(processes: Iterable[subprocess.Popen[str]]) -> None:
    """SIGTERM to the groups of these programs; SIGKILL to what is there `GRACE` seconds later."""
    left = [process for process in processes if _send(process, signal.SIGTERM)]
    deadline = time.monotonic() + GRACE
    while left and time.monotonic() < deadline:
        time.sleep(0.01)
        left = [process for process in left if _send(process, 0)]
    for process in left:
        _send(process, signal.SIGKILL)
        process.wait()


def _send(process: subprocess.Popen[str], number: int) -> bool:
    """Send a signal to a program's group; False if nothing of it is left."""
    process.poll()
    try:
        os.killpg(process.pid, number)
    except ProcessLookupError:
        return False
    return True


@contextlib.contextmanager
def _held() -> Iterator[None]:
    """A signal waits for the end of the block: a program that has just been started must not get lost."""
    global _is_held
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _is_held = True
    try:
        yield
    finally:
        _is_held = False
    if _signal is not None:
        raise Interrupted(_signal)


def when_leaving(function: Callable[[], None]) -> None:
    """Call `function` when a signal ends the process, after its programs have ended."""
    _when_leaving.append(function)


def guarded(program: Callable[[], object]) -> NoReturn:
    """Run the main program of a command line and exit; by a signal with one line and 128 plus its number."""
    for number in SIGNALS:
        # nohup
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _receive)
    try:
        program()
    except Interrupted as interrupted:
        _leave(interrupted.number)
    except BaseException:
        # What fails after a signal fails because of it
        if _signal is None:
            raise
    if _signal is not None:
        _leave(_signal)
    sys.exit(0)


def _receive(number: int, frame: object) -> None:
    global _signal, _signal_time
    now = time.monotonic()
    if _signal is not None:
        if now - _signal_time > DEAF:
            for process in list(_running):
                _send(process, signal.SIGKILL)
            os._exit(128 + number)
        return
    _signal, _signal_time = number, now
    if not _is_held:
        raise Interrupted(number)


def _leave(number: int) -> NoReturn:
    """End all programs, give the threads some time, clean up, and exit without waiting for anything else."""
    global _is_leaving
    with _lock:
        _is_leaving = True
        members = list(_running)
    _end(members)
    deadline = time.monotonic() + LAST_WORDS
    for thread in threading.enumerate():
        if thread is not threading.current_thread() and not thread.daemon:
            thread.join(max(0.0, deadline - time.monotonic()))
    for function in _when_leaving:
        with contextlib.suppress(Exception):
            function()
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
    with contextlib.suppress(OSError, ValueError):
        word = "interrupted" if number == signal.SIGINT else "terminated"
        print(f"colonnade: error: {word}", file=sys.stderr, flush=True)
    os._exit(128 + number)
