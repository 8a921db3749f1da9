"""Where jobs run: on this machine, or on a Dask cluster. Both return `concurrent.futures` futures."""

from __future__ import annotations

import asyncio
import dataclasses
import importlib.util
import os
import re
import shutil
from collections.abc import Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Protocol

from colonnade.common.errors import UserError
from colonnade.common.processes import Group

from colonnade_lab.explore import jobs
from colonnade_lab.explore.jobs import Job, JobFailed
from colonnade_lab.explore.result import Content

#: Seconds to wait for the scheduler's answer.
CONNECT_SECONDS = 5

#: Addresses that Dask's clients accept.
_ADDRESS = re.compile(r"((tcp|tls|ws|wss)://)?[^\s/]+:\d{1,5}/?", re.ASCII)

#: Retries of a job whose worker was lost.
RETRIES = 2


class Runner(Protocol):
    """Runs jobs."""

    #: Number of jobs that run at a time, for the estimate of the time.
    parallel: int

    #: State of a job between submission and result, for progress.
    state: str

    def missing(self, job: Job) -> str | None:
        """Why no worker can run the job; None if one can."""

    def has_place(self, job: Job, running: Iterable[Job]) -> bool:
        """Whether to submit the job now."""

    def submit(self, job: Job, inputs: tuple[Content, ...]) -> Future[dict[str, bytes]]:
        """Start a job. The future has its files, or raises `JobFailed`."""

    def close(self) -> None:
        """End all jobs."""


class LocalRunner:
    """Runs jobs on this machine, within its memory."""

    state = "running"

    def __init__(self, parallel: int) -> None:
        self.parallel = parallel
        self._group = Group()
        self._pool = ThreadPoolExecutor(parallel, thread_name_prefix="job", initializer=self._group.join)
        self._memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") >> 20

    def missing(self, job: Job) -> str | None:
        """The program that is not installed here."""
        for name in job.kind.needs:
            if name == "yosys" and importlib.util.find_spec("pyosys") is None:
                return f"{job.kind.name} needs Yosys: run tools/environment ppa"
            if name == "verilator" and shutil.which("verilator") is None:
                return f"{job.kind.name} needs verilator: sudo apt-get install verilator"
        return None

    def has_place(self, job: Job, running: Iterable[Job]) -> bool:
        """Place for `parallel` jobs, and for their memory if more than one runs."""
        others = list(running)
        memory = sum(other.kind.needs["memory"] for other in others) + job.kind.needs["memory"]
        return not others or (len(others) < self.parallel and memory <= self._memory)

    def submit(self, job: Job, inputs: tuple[Content, ...]) -> Future[dict[str, bytes]]:
        """Run the job in a thread that waits for its process."""
        return self._pool.submit(jobs.run, job, inputs)

    def close(self) -> None:
        """End all jobs and their programs."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._group.end()


def check_address(address: str) -> None:
    """Refuse what is no address of a scheduler, before work begins.

    Raises:
        UserError: The address has another form.
    """
    if not _ADDRESS.fullmatch(address):
        raise UserError(f"--scheduler {address!r} is no address of a Dask scheduler: give one such as tcp://HOST:8786")


def _check_scheduler(address: str) -> None:
    """Ask a scheduler who it is. Dask's client waits without end for a server of another kind, and prints tracebacks.

    Raises:
        UserError: Nothing answers in time, or it is no scheduler.
    """
    from distributed.core import rpc
    from distributed.security import Security

    async def kind() -> str:
        async with rpc(address, connection_args=Security().get_connection_args("client")) as server:
            return str((await server.identity())["type"])

    try:
        found = asyncio.run(asyncio.wait_for(kind(), CONNECT_SECONDS))
    except asyncio.TimeoutError:
        found = f"no answer within {CONNECT_SECONDS} s"
    except Exception as error:
        # What a server of another kind sends is read as lengths and types of Dask's messages
        found = " ".join(str(error).split()) or type(error).__name__
    if found != "Scheduler":
        raise UserError(f"no Dask scheduler at {address}: {found}")


class ClusterRunner:
    """Runs jobs on the workers of a Dask scheduler. A job whose worker is lost moves to another one.

    A worker is a checkout of the same sources. It declares what it has: ``dask worker ADDRESS --resources
    "memory=16000 java=2 verilator=2 yosys=2"``, memory in MB.
    """

    state = "submitted"

    def __init__(self, address: str) -> None:
        from distributed import Client

        check_address(address)
        _check_scheduler(address)
        self._client = Client(address, timeout=CONNECT_SECONDS, set_as_default=False)
        self._executors: dict[tuple[tuple[str, int], ...], Any] = {}
        self.parallel = max(1, sum(worker["nthreads"] for worker in self._workers().values()))

    def _workers(self) -> Mapping[str, Any]:
        workers: Mapping[str, Any] = self._client.scheduler_info(n_workers=-1)["workers"]
        return workers

    def missing(self, job: Job) -> str | None:
        """What no worker declares."""
        workers = self._workers().values()
        self.parallel = max(1, sum(worker["nthreads"] for worker in workers))
        if any(
            all(worker["resources"].get(name, 0) >= amount for name, amount in job.kind.needs.items())
            for worker in workers
        ):
            return None
        needs = " ".join(f"{name}={amount}" for name, amount in job.kind.needs.items())
        return f"no worker offers {needs} for {job.kind.name} jobs: start one with --resources"

    def has_place(self, job: Job, running: Iterable[Job]) -> bool:
        """Always: the scheduler queues."""
        return True

    def submit(self, job: Job, inputs: tuple[Content, ...]) -> Future[dict[str, bytes]]:
        """Queue the job for a worker that has what it needs."""
        needs = tuple(job.kind.needs.items())
        if needs not in self._executors:
            self._executors[needs] = self._client.get_executor(resources=dict(needs), retries=RETRIES, pure=False)
        future: Future[dict[str, bytes]] = self._executors[needs].submit(_run_remotely, job, job.key, inputs)
        return future

    def close(self) -> None:
        """Withdraw all jobs; one that runs ends by itself, and its worker keeps the result."""
        for executor in self._executors.values():
            executor.shutdown(wait=False)
        self._client.close(timeout=1)


def _run_remotely(job: Job, key: str, inputs: tuple[Content, ...]) -> dict[str, bytes]:
    """Run a job on a worker, if its sources give the same key."""
    if dataclasses.replace(job).key != key:
        raise JobFailed("the worker has other sources than this checkout: update it")
    return jobs.run(job, inputs)
