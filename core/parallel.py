"""Independent calls over a pool of processes, or over a Dask cluster."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, TypeVar

from .errors import MissingDependency, StrandlineError
from .progress import Progress

T = TypeVar("T")
_AHEAD = 2  # calls queued per worker: enough to keep it busy, few enough to bound memory


def worker_count(workers: int) -> int:
    """Return the number of workers to use; 0 asks for one per processor this process may use."""
    if workers > 0:
        return workers
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, available or 1)


@contextmanager
def executor(workers: int, scheduler: str | None = None) -> Iterator[Executor]:
    """Yield an executor: Dask's at the address ``scheduler``, else a pool of ``workers`` spawned processes.

    Raises
    ------
    MissingDependency
        When a scheduler is named and ``distributed`` is not installed.
    """
    if scheduler:
        try:
            from distributed import Client
        except ImportError as error:
            raise MissingDependency(
                "SCHEDULER names a Dask scheduler, but the engine has no 'distributed' package: "
                "install it in the engine's environment, or leave SCHEDULER empty."
            ) from error
        with Client(scheduler) as client, client.get_executor() as remote:
            yield remote
        return
    pool = ProcessPoolExecutor(worker_count(workers), mp_context=multiprocessing.get_context("spawn"), initializer=_start_worker)
    try:
        yield pool
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def run_calls(
    function: Callable[..., T],
    calls: Iterable[tuple[Any, ...]],
    *,
    workers: int,
    scheduler: str | None = None,
    progress: Progress,
    total: int,
) -> Iterator[tuple[int, T]]:
    """Yield ``(index, function(*call))`` for every call, in the order of completion.

    ``function`` and its arguments must be importable and picklable. With one worker and no scheduler the calls run
    here, one after the other. Not more than a few calls per worker are in flight, so ``calls`` may be lazy.

    Raises
    ------
    StrandlineError
        When a worker process died (out of memory, or a crash of native code).
    """
    count = worker_count(workers)
    progress.at(0.0)
    if not scheduler and (count == 1 or total <= 1):
        for index, call in enumerate(calls):
            yield index, function(*call)
            progress.at((index + 1) / max(total, 1))
        return
    with executor(min(count, total), scheduler) as pool:
        pending: dict[Future[T], int] = {}
        queue, done = enumerate(calls), 0
        room = _AHEAD * (64 if scheduler else count)
        try:
            while True:
                while len(pending) < room and (following := next(queue, None)) is not None:
                    pending[pool.submit(function, *following[1])] = following[0]
                if not pending:
                    return
                finished, _ = wait(pending, return_when=FIRST_COMPLETED)
                for future in finished:
                    index = pending.pop(future)
                    yield index, future.result()
                    done += 1
                    progress.at(done / max(total, 1))
        except BrokenProcessPool as error:
            raise StrandlineError(
                "A worker process ended unexpectedly (most often for want of memory): "
                "run the step again with fewer WORKERS; what is finished is kept."
            ) from error
        finally:
            for future in pending:
                future.cancel()


def _start_worker() -> None:
    """End this worker when its parent dies, however it dies, and keep native threads to one."""
    import cv2

    cv2.setNumThreads(1)
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            parent.join()
        os._exit(1)

    threading.Thread(target=watch, name="parent watch", daemon=True).start()
