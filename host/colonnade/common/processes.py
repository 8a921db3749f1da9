"""Starts child programs, and ends all of them on a signal.

Each program runs in its own process group, so that its children end with it. SIGINT, SIGTERM, SIGHUP and SIGXCPU raise
`Interrupted` in the main thread; `guarded` then ends every program, removes temporary files and exits. While the main
thread is in a call of a library that does not return, another thread does so, as soon as the library lets it run. Where
there is util-linux, a program also ends when this process is killed.
"""

from __future__ import annotations

import contextlib
import functools
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, NoReturn

from colonnade.common import machine_limits
from colonnade.common.errors import UserError

#: Seconds between SIGTERM and SIGKILL.
GRACE = 0.5

#: Seconds that threads have for cleaning up after their programs ended.
CLEANUP_SECONDS = 0.7

#: Seconds in which further signals are ignored, because `timeout` and terminals may send several.
REPEAT_SECONDS = 3.0

#: Seconds after which another thread exits for a main thread that has not received a signal.
PATIENCE = 0.8

#: Seconds after which a signal interrupts again: a library may have caught the first exception.
INSIST_SECONDS = 2.0

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGXCPU)

_WORDS = {
    signal.SIGINT: "interrupted",
    signal.SIGXCPU: "this machine's limit of processor time is reached: raise ulimit -t",
}

_Stream = int | IO[str] | None


class Interrupted(BaseException):
    """A signal requests the end of this process."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


class Ended(RuntimeError):
    """The program's group has ended: no program can start in it."""


class Group:
    """Programs that end together, e.g. of one thread pool."""

    def __init__(self) -> None:
        self.is_ended = False

    def join(self) -> None:
        """Put the programs that this thread starts from now on into the group."""
        _thread_state.group = self

    def end(self) -> None:
        """End the group's programs; no more can start."""
        self.is_ended = True
        with _lock:
            members = [process for process, group in _running.items() if group is self]
        _end(members)


class _ThreadState(threading.local):
    def __init__(self) -> None:
        self.group: Group | None = None


_thread_state = _ThreadState()
_lock = threading.RLock()
_running: dict[subprocess.Popen[str], Group | None] = {}
_when_leaving: list[Callable[[], None]] = []


@dataclass
class _Process:
    """What this process knows of its own end.

    Attributes:
        signal: The received signal.
        signal_time: When it came, `time.monotonic` seconds.
        is_deferred: Signals are deferred while the main thread starts and registers a program.
        is_leaving: All programs end, and no more can start.
        is_over: The program has ended, and Python ends: nothing would catch an exception.
    """

    signal: int | None = None
    signal_time: float = 0.0
    is_deferred: bool = False
    is_leaving: bool = False
    is_over: bool = False


_this = _Process()


@contextlib.contextmanager
def started(
    command: Sequence[object],
    *,
    cwd: Path | None = None,
    env: Mapping[str, str] | None = None,
    stdin: _Stream = subprocess.DEVNULL,
    stdout: _Stream = None,
    stderr: _Stream = None,
) -> Iterator[subprocess.Popen[str]]:
    """Start a program and wait for it after the block; an error in the block ends it.

    Args:
        command: the program and its arguments, strings or paths.
        cwd: see `subprocess.Popen`, as for the next four.
        env: the environment.
        stdin: where its input comes from; by default it has none.
        stdout: where its output goes.
        stderr: where its errors go.

    Raises:
        Ended: this thread's group ended before or during the run.
    """
    group = _thread_state.group
    process: subprocess.Popen[str] | None = None
    try:
        with signals_deferred():
            process = _start(group, command, cwd, env, stdin, stdout, stderr)
        yield process
        process.wait()
        _refuse_ended(group)
    except BaseException:
        if process is not None:
            _end([process])
        raise
    finally:
        if process is not None:
            for stream in (process.stdin, process.stdout, process.stderr):
                if stream is not None:
                    with contextlib.suppress(BrokenPipeError):
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
    """Run a program to its end, like `subprocess.run`; captures its output as text unless redirected.

    Raises:
        UserError: A limit of this machine ended the program.
    """
    with started(command, cwd=cwd, env=env, stdout=stdout, stderr=stderr) as process:
        output, errors = process.communicate()
    limit = machine_limits.reached(process.returncode, f"{output or ''}{errors or ''}")
    if limit is not None:
        raise UserError(f"{Path(str(command[0])).name} reached this machine's limit of {limit}")
    return subprocess.CompletedProcess(list(map(str, command)), process.returncode, output, errors)


def _start(
    group: Group | None,
    command: Sequence[object],
    cwd: Path | None,
    env: Mapping[str, str] | None,
    stdin: _Stream,
    stdout: _Stream,
    stderr: _Stream,
) -> subprocess.Popen[str]:
    # Under the lock, so that ending a group finds all of its programs
    with _lock:
        _refuse_ended(group)
        # The error of a program that is not there is to come from here
        before = _end_with_parent() if shutil.which(str(command[0])) else ()
        process = subprocess.Popen(
            [*before, *map(str, command)],
            cwd=cwd,
            env=env,
            stdin=stdin,
            stdout=stdout,
            stderr=stderr,
            text=True,
            errors="replace",
            start_new_session=True,
        )
        _running[process] = group
        return process


@functools.cache
def _end_with_parent() -> tuple[str, ...]:
    """Words before a command that the kernel ends with its parent; none without util-linux.

    A function of Python's between fork and exec would do the same, but could wait for ever for a lock of a thread.
    """
    words = (shutil.which("setpriv") or "", "--pdeathsig", "TERM")
    try:
        done = subprocess.run([*words, "true"], capture_output=True, check=False)
    except OSError:
        return ()
    return words if done.returncode == 0 else ()


def _refuse_ended(group: Group | None) -> None:
    if _this.is_leaving or (group is not None and group.is_ended):
        raise Ended("the group of this program has ended")


def _end(processes: Iterable[subprocess.Popen[str]]) -> None:
    """Send SIGTERM to these programs' process groups, and SIGKILL to those left after `GRACE` seconds."""
    left = [process for process in processes if _send(process, signal.SIGTERM)]
    deadline = time.monotonic() + GRACE
    while left and time.monotonic() < deadline:
        time.sleep(0.01)
        left = [process for process in left if _send(process, 0)]
    for process in left:
        _send(process, signal.SIGKILL)
        process.wait()


def _send(process: subprocess.Popen[str], number: int) -> bool:
    """Send a signal to a program's process group; False if the group is gone."""
    process.poll()
    try:
        os.killpg(process.pid, number)
    except ProcessLookupError:
        return False
    return True


@contextlib.contextmanager
def signals_deferred() -> Iterator[None]:
    """Defer signals to the end of the block, so that what it makes is always registered: a program, a folder."""
    if threading.current_thread() is not threading.main_thread() or _this.is_deferred:
        yield
        return
    _this.is_deferred = True
    try:
        yield
    finally:
        _this.is_deferred = False
    if _this.signal is not None:
        raise Interrupted(_this.signal)


def when_leaving(function: Callable[[], None]) -> None:
    """Register a function that runs when a signal ends the process, after its programs ended."""
    _when_leaving.append(function)


def guarded(program: Callable[[], object]) -> NoReturn:
    """Run a command line's main program and exit; a signal gives one error line and status 128 plus its number."""
    for number in SIGNALS:
        # nohup ignores SIGHUP: keep it so
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, _receive)
    _watch_signals()
    try:
        try:
            program()
        finally:
            _this.is_over = True
    except Interrupted as interrupted:
        _leave(interrupted.number)
    except BaseException:
        # A failure after a signal is a consequence of the signal
        if _this.signal is None:
            raise
    if _this.signal is not None:
        _leave(_this.signal)
    sys.exit(0)


def tool(program: Callable[[], object]) -> NoReturn:
    """As `guarded`, for a program of `tools`: wrong input gives one error line and status 2."""

    def run() -> None:
        try:
            program()
        except UserError as error:
            print(f"colonnade: error: {error}", file=sys.stderr)
            raise SystemExit(2) from None

    guarded(run)


def _watch_signals() -> None:
    """Start the thread that exits where the main thread does not receive a signal.

    Python writes the number of a signal to a pipe when it arrives, and calls `_receive` when the main thread is back.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)
    # A signal to a copy of this process is not one to this process
    os.register_at_fork(after_in_child=lambda: signal.set_wakeup_fd(-1))

    def watch() -> None:
        while True:
            (number,) = os.read(reader, 1)
            if number not in SIGNALS:
                continue
            time.sleep(PATIENCE)
            if _this.signal is None:
                _leave(number)

    threading.Thread(target=watch, name="signals", daemon=True).start()


def _receive(number: int, frame: object) -> None:
    now = time.monotonic()
    if _this.signal is not None:
        if now - _this.signal_time > REPEAT_SECONDS:
            for process in list(_running):
                _send(process, signal.SIGKILL)
            os._exit(128 + number)
        return
    _this.signal, _this.signal_time = number, now
    signal.signal(signal.SIGALRM, _insist)
    signal.setitimer(signal.ITIMER_REAL, INSIST_SECONDS, INSIST_SECONDS)
    _insist(number, frame)


def _insist(number: int, frame: object) -> None:
    if _this.signal is None or _this.is_deferred or _this.is_leaving:
        return
    if _this.is_over:
        _leave(_this.signal)
    raise Interrupted(_this.signal)


def _leave(number: int) -> NoReturn:
    """End all programs, give the threads time to clean up, run the exit functions, and exit."""
    with _lock:
        is_second, _this.is_leaving = _this.is_leaving, True
        members = list(_running)
    if is_second:  # the first thread exits
        threading.Event().wait()
    _end(members)
    deadline = time.monotonic() + CLEANUP_SECONDS
    for thread in threading.enumerate():
        if thread not in (threading.current_thread(), threading.main_thread()) and not thread.daemon:
            thread.join(max(0.0, deadline - time.monotonic()))
    for function in _when_leaving:
        with contextlib.suppress(Exception):
            function()
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
    with contextlib.suppress(OSError, ValueError):
        print(f"colonnade: error: {_WORDS.get(signal.Signals(number), 'terminated')}", file=sys.stderr, flush=True)
    os._exit(128 + number)
