"""Limits of this machine (``ulimit``): what a command needs of them, and how a program fails that reaches one."""

from __future__ import annotations

import contextlib
import re
import resource
import signal
from pathlib import Path

from colonnade.common.errors import UserError

#: Open files that a command needs, and that it asks for.
MIN_FILES, WANTED_FILES = 64, 1024

#: Address space that a command needs, in MB; the pictures of a study's report are drawn by V8, which reserves much.
MIN_MEGABYTES = 2048
MEGABYTES = {"explore": 16_384}

#: What programs and libraries print at a limit, and the limit.
_MEMORY = "memory or address space (ulimit -v)"
_SIGNS = (
    (re.compile(r"Too many open files"), "open files (ulimit -n)"),
    (re.compile(r"unable to create (?:new )?native thread|pthread_create failed|fork: retry"), "processes (ulimit -u)"),
    (re.compile(r"CPU time limit exceeded"), "processor time (ulimit -t)"),
    (re.compile(r"File size limit exceeded|File too large"), "file size (ulimit -f)"),
    (
        re.compile(
            r"Cannot allocate memory|OutOfMemoryError|bad_alloc|insufficient memory|[Cc]ould not (?:reserve|allocate)"
            r"|[Uu]nable to allocate|virtual memory exhausted|failed to map segment|out of memory"
        ),
        _MEMORY,
    ),
)
_SIGNALS = {
    signal.SIGXCPU: "processor time (ulimit -t)",
    signal.SIGXFSZ: "file size (ulimit -f)",
    signal.SIGKILL: "memory or processor time, or was killed by hand",
}


def check(command: str) -> None:
    """Refuse to run a command for which this machine's limits are too low; raises limits that may be raised.

    Raises:
        UserError: A limit is too low; the message names it.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if _is_below(soft, WANTED_FILES):
        soft = WANTED_FILES if hard == resource.RLIM_INFINITY else min(hard, WANTED_FILES)
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    if _is_below(soft, MIN_FILES):
        raise UserError(f"this machine allows {soft} open files, a command needs {MIN_FILES}: raise ulimit -n")
    needed = MEGABYTES.get(command, MIN_MEGABYTES)
    space, _ = resource.getrlimit(resource.RLIMIT_AS)
    if _is_below(space, needed << 20):
        raise UserError(
            f"this machine allows {space >> 20:,} MB of address space, colonnade {command} needs {needed:,}:"
            " raise ulimit -v"
        )
    # At the hard limit the kernel kills without a word: get SIGXCPU a second before
    soft, hard = resource.getrlimit(resource.RLIMIT_CPU)
    if soft == hard and hard != resource.RLIM_INFINITY and hard > 1:
        resource.setrlimit(resource.RLIMIT_CPU, (hard - 1, hard))


def reached(status: int, text: str) -> str | None:
    """The limit that ended a program, by its exit status and what it printed; None if it failed otherwise."""
    if status < 0 and -status in _SIGNALS:
        return _SIGNALS[signal.Signals(-status)]
    return next((limit for sign, limit in _SIGNS if sign.search(text)), None) if status else None


def limit_this_process(memory: int, seconds: int) -> None:
    """Limit this process, where the system can: memory, bytes beside what it has now, and processor time."""
    pages = Path("/proc/self/statm")
    own = int(pages.read_text().split()[0]) * resource.getpagesize() if pages.exists() else 0
    for kind, limit in (
        (resource.RLIMIT_AS, own + memory),
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_CORE, 0),
    ):
        hard = resource.getrlimit(kind)[1]
        limit = limit if hard == resource.RLIM_INFINITY else min(limit, hard)
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(kind, (limit, limit))


def _is_below(limit: int, needed: int) -> bool:
    return limit != resource.RLIM_INFINITY and limit < needed
