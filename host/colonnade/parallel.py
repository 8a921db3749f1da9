"""Independent pieces of work, some at a time, with their results in order."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from colonnade.processes import Group

Item = TypeVar("Item")
Result = TypeVar("Result")


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0))


def in_order(work: Callable[[Item], Result], items: Sequence[Item], jobs: int) -> Iterator[Result]:
    """Results of `work` in the order of `items`, up to `jobs` of them at a time.

    Threads: the work is meant to wait for other programs, which it starts with `colonnade.processes`. After an
    exception, or when no more results are wanted, nothing new is begun and these programs end.
    """
    group = Group()
    pool = ThreadPoolExecutor(max(1, min(jobs, len(items))), thread_name_prefix="job", initializer=group.join)
    futures = [pool.submit(work, item) for item in items]
    try:
        for future in futures:
            yield future.result()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        group.end()
        raise
    # All results are there
    pool.shutdown()
