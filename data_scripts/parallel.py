"""Many pieces of work at once: on the cores of this machine, or on a Dask cluster."""

import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from functools import cache

from joblib import Parallel, delayed, parallel_config

from lib.datasets import DataError


def in_parallel(
    function: Callable, jobs: Iterable[tuple], count: int, scheduler: str | None = None
) -> Iterator[object]:
    """function(*job, parent) of each job, whichever is ready first; see `workers` for where, and for what is raised.

    parent  the process that waits for the results, or None on a cluster: for `end_with`.
    """
    parent = None if scheduler else os.getpid()
    with warnings.catch_warnings(), workers(count, scheduler):
        warnings.filterwarnings("ignore", ".* tasks which were still being processed")  # joblib, at Ctrl-C
        tasks = (delayed(function)(*job, parent) for job in jobs)
        yield from Parallel(return_as="generator_unordered", batch_size=1)(tasks)


@contextmanager
def workers(count: int, scheduler: str | None) -> Iterator[None]:
    """Where joblib works: `count` processes (-1: one for each core), or a running Dask cluster.

    Raises DataError for a cluster that is not there, and for workers that end before their work does.
    """
    with parallel_config("loky", n_jobs=count) if scheduler is None else _cluster(scheduler):
        try:
            yield
        except BrokenExecutor as error:
            raise DataError(
                "a worker was ended from outside, perhaps for want of memory; the same command goes on from here, "
                "fewer --workers need less memory"
            ) from error


@contextmanager
def _cluster(scheduler: str) -> Iterator[None]:
    try:
        from distributed import Client, KilledWorker  # optional: pip install -e '.[cluster]'
    except ImportError as error:
        raise DataError(f"--scheduler needs Dask: pip install -e '.[cluster]' ({error})") from error
    try:
        client = Client(scheduler, timeout=10)
    except (OSError, ValueError) as error:
        raise DataError(f"no Dask scheduler answers at {scheduler} ({error})") from error
    try:
        with client, parallel_config("dask", n_jobs=-1):
            yield
    except KilledWorker as error:
        raise DataError(
            f"the cluster's workers ended ({error}); the same command goes on from here"
        ) from error


@cache  # one watch a process
def end_with(parent: int | None) -> None:
    """Ends this process, unless it is its own parent, soon after that one: joblib's workers would wait for ever."""
    if parent is None or os.getpid() == parent:
        return
    signal.signal(
        signal.SIGINT, signal.SIG_IGN
    )  # a terminal's Ctrl-C comes here too: the parent ends its workers

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
