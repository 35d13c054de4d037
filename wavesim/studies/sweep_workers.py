"""Where the blocks of a sweep are worked on: here, or by workers of Dask, on one machine or many.

A worker that is lost takes nothing along but what it was at, which another begins anew. The sweep
itself writes what comes back, so that workers need no disk in common.
"""

from __future__ import annotations

import logging
import signal
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from itertools import islice
from multiprocessing import resource_tracker
from typing import Any

from wavesim.studies.variation import SweepError

# Dask gives a member up once four workers were lost that had it, at work or waiting; it is handed
# in again so many times before it is taken for what kills them.
_AGAIN = 3
# Members under way at a time, for each worker: so that none waits for this process.
_AHEAD = 2
_ANSWER = 5.0  # s that a scheduler has to answer
# A worker has one thread: runs side by side share the machine best so.
_ONE_THREAD = dict.fromkeys(
    ("NPROC", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"
)

Job = tuple[Any, Any]  # what is worked on, and its argument
Result = tuple[Any, Any]  # the same, and what came of it or an exception


class SweepStoppedError(RuntimeError):
    """A sweep can't go on; the message says why, and what was written stays."""


def here(function: Callable[[Any], Any], jobs: Iterable[Job]) -> Iterator[Result]:
    """Work in this process, one after the other."""
    for name, argument in jobs:
        try:
            yield name, function(argument)
        except Exception as error:
            yield name, error


class Pool:
    """Workers of Dask."""

    def __init__(self, client: Any) -> None:
        self._client = client

    @property
    def workers(self) -> int:
        """How many there are now."""
        return len(self._client.scheduler_info(n_workers=-1).get("workers", ()))

    def __call__(self, function: Callable[[Any], Any], jobs: Iterable[Job]) -> Iterator[Result]:
        """Work on jobs, as many at a time as keep the workers busy; results as they come.

        Raises:
            SweepStoppedError: the scheduler is gone.
        """
        from concurrent.futures import CancelledError

        from distributed import KilledWorker, as_completed
        from distributed.comm import CommClosedError

        jobs, under_way, done = iter(jobs), dict[Any, tuple[Job, int]](), as_completed([])

        def submit(job: Job, given_up: int = 0) -> None:
            future = self._client.submit(function, job[1], pure=False)
            under_way[future.key] = job, given_up
            done.add(future)

        try:
            for job in islice(jobs, max(1, _AHEAD * self.workers)):
                submit(job)
            for future in done:
                job, given_up = under_way.pop(future.key)
                if future.cancelled() or future.status == "lost":
                    raise _gone()
                error = future.exception()
                result = future.result() if error is None else error
                future.release()
                if isinstance(error, KilledWorker) and given_up < _AGAIN:
                    submit(job, given_up + 1)
                    continue
                for following in islice(jobs, 1):
                    submit(following)
                yield job[0], result
        except (CancelledError, CommClosedError, OSError, TimeoutError) as error:
            raise _gone() from error


def _gone() -> SweepStoppedError:
    return SweepStoppedError("the scheduler is gone, and what was under way with it")


@contextmanager
def pool(workers: int | None = None, address: str | None = None) -> Iterator[Pool]:
    """Workers of Dask while a sweep lasts.

    Args:
        workers: number of processes on this machine, of one thread each.
        address: of a scheduler that is there, such as "tcp://10.0.0.5:8786", in place of them.

    Raises:
        SweepError: no scheduler answers at the address, it has no workers, or they have not this
            version of wavesim.
    """
    import dask
    from distributed import Client, LocalCluster

    quiet = logging.CRITICAL
    settings: dict[str, Any] = {
        "distributed.worker.memory.terminate": False,
        "distributed.admin.low-level-log-length": 0,
        "distributed.comm.timeouts.connect": f"{_ANSWER:g}s",
    }
    for name in ("distributed", "distributed.client", "distributed.core", "distributed.nanny"):
        logging.getLogger(name).setLevel(quiet)
    with ExitStack() as until_the_end:
        until_the_end.enter_context(dask.config.set(settings))
        if address is None:
            with _deaf_to_the_terminal():
                cluster = LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    dashboard_address="127.0.0.1:0",  # with None it would be port 8787, for all
                    silence_logs=quiet,
                    memory_limit=0,
                    env=_ONE_THREAD,
                )
            until_the_end.enter_context(cluster)
            yield Pool(until_the_end.enter_context(Client(cluster)))
            return
        try:
            client = until_the_end.enter_context(Client(address, timeout=_ANSWER))
        except (OSError, TimeoutError, ValueError) as error:
            what = str(error).splitlines()[0] if isinstance(error, ValueError) else "none answers"
            raise SweepError(
                f"--scheduler {address}: no scheduler of Dask there ({what}); start one by "
                "`dask scheduler`, or leave --scheduler out for workers on this machine"
            ) from None
        found = Pool(client)
        if not found.workers:
            raise SweepError(
                f"--scheduler {address}: it has no workers; start some by `dask worker {address} "
                "--nthreads 1`"
            )
        _check_version(client, address)
        yield found


@contextmanager
def _deaf_to_the_terminal() -> Iterator[None]:
    """Threads and processes that are begun in here do not hear Ctrl-C, which a terminal sends to
    all: they end with the process that began them."""
    resource_tracker.ensure_running()  # that, when it begins, has this thread hear again
    heard = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, heard)


def _check_version(client: Any, address: str) -> None:
    from importlib.metadata import version

    own = version("wavesim")
    try:
        theirs = set(client.run(version, "wavesim").values())
    except Exception as error:
        raise SweepError(
            f"--scheduler {address}: its workers can't load wavesim ({error}); install it there"
        ) from None
    if theirs != {own}:
        raise SweepError(
            f"--scheduler {address}: its workers have wavesim {', '.join(sorted(theirs))}, and "
            f"this is {own}; install one version everywhere"
        )
