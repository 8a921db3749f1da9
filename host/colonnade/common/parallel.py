"""Independent pieces of work, some at a time, with their results in order."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from colonnade.common.processes import Group

Item = TypeVar("Item")
Result = TypeVar("Result")


def processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0))


def in_order(
    work: Callable[[Item], Result],
    items: Sequence[Item],
    jobs: int,
    length: Callable[[Item], float] = lambda item: 0.0,
) -> Iterator[Result]:
    """Results of `work` in the order of `items`, up to `jobs` of them at a time; the longest begin first.

    Threads: the work is meant to wait for other programs, which it starts with `colonnade.common.processes`. After an
    exception, or when no more results are wanted, nothing new is begun and these programs end.

    Args:
        work: done for each item.
        items: what to do.
        jobs: at a time.
        length: how long an item takes, in any unit; those of equal length begin in their order.
    """
    group = Group()
    pool = ThreadPoolExecutor(max(1, min(jobs, len(items))), thread_name_prefix="job", initializer=group.join)
    longest_first = sorted(range(len(items)), key=lambda index: -length(items[index]))
    futures = {index: pool.submit(work, items[index]) for index in longest_first}
    try:
        for index in range(len(items)):
            yield futures[index].result()
    except BaseException:
        pool.shutdown(wait=False, cancel_futures=True)
        group.end()
        raise
    # All results are there
    pool.shutdown()
