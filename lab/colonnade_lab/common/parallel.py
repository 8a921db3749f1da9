"""Runs independent jobs in parallel threads and returns their results in order."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from colonnade.common.processes import Group

Item = TypeVar("Item")
Result = TypeVar("Result")


def processors() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0))


def in_order(
    work: Callable[[Item], Result],
    items: Sequence[Item],
    jobs: int,
    length: Callable[[Item], float] = lambda item: 0.0,
) -> Iterator[Result]:
    """Yield the results of `work` in the order of `items`; the longest items start first.

    The jobs are threads, meant to wait for programs started with `colonnade.common.processes`. After an exception, or
    when the caller closes the iterator, no new job starts and these programs end.

    Args:
        work: called once for each item.
        items: the arguments of `work`.
        jobs: number of parallel jobs.
        length: estimated duration of an item, in any unit; items of equal length start in their order.
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
    # All jobs are done
    pool.shutdown()
