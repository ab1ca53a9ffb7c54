"""Independent calls in worker processes: order, failure, death, cancellation. Called are functions every process has."""

import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from strandline.core.errors import Cancelled, InputError, MissingDependency, StrandlineError
from strandline.core.parallel import run_calls, worker_count
from strandline.core.progress import SILENT, Progress, Silent


def gone(process_id: int) -> bool:
    """Tell whether a process has ended; one whose parent does not collect it stays as a zombie."""
    try:
        return Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True


def wait_until(condition, seconds=20.0):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.05)
    return True


def test_worker_count():
    assert worker_count(3) == 3
    assert worker_count(0) == len(os.sched_getaffinity(0))


@pytest.mark.parametrize("workers", [1, 2])
def test_every_call_is_answered_once(workers):
    answers = dict(run_calls(math.factorial, ((n,) for n in range(9)), workers=workers, progress=SILENT, total=9))
    assert answers == {n: math.factorial(n) for n in range(9)}


def test_two_workers_are_other_processes():
    ids = {pid for _, pid in run_calls(os.getpid, [()] * 20, workers=2, progress=SILENT, total=20)}
    assert os.getpid() not in ids
    assert 1 <= len(ids) <= 2
    assert wait_until(lambda: all(gone(i) for i in ids))


def test_no_calls():
    assert list(run_calls(math.sqrt, [], workers=2, progress=SILENT, total=0)) == []


def test_calls_are_taken_only_as_needed():
    taken = []

    def calls():
        for n in range(50):
            taken.append(n)
            yield (n,)

    results = run_calls(math.sqrt, calls(), workers=2, progress=SILENT, total=50)
    next(results)
    assert len(taken) <= 6
    results.close()


@pytest.mark.parametrize("workers", [1, 2])
def test_an_exception_of_a_call_is_passed_on(workers):
    with pytest.raises(ValueError, match="math domain error|nonnegative"):
        list(run_calls(math.sqrt, [(4.0,), (-1.0,)], workers=workers, progress=SILENT, total=2))


def test_a_dead_worker_is_a_sentence():
    with pytest.raises(StrandlineError, match="fewer WORKERS") as caught:
        list(run_calls(os._exit, [(9,)] * 2, workers=2, progress=SILENT, total=2))
    assert not isinstance(caught.value, InputError)


def test_cancel_ends_the_workers():
    class Impatient(Silent):
        def __init__(self):
            self.asked = False

        def cancelled(self):
            return self.asked

    listener, seen = Impatient(), []

    def work():
        for _, pid in run_calls(os.getpid, [()] * 1000, workers=2, progress=Progress(listener), total=1000):
            seen.append(pid)
            listener.asked = True

    pytest.raises(Cancelled, work)
    assert len(seen) < 1000
    assert wait_until(lambda: all(gone(i) for i in seen))


def test_workers_end_when_their_parent_is_killed():
    program = """
import multiprocessing, threading, time
from strandline.core.parallel import run_calls
from strandline.core.progress import SILENT
def tell():
    while len(multiprocessing.active_children()) < 2:
        time.sleep(0.05)
    time.sleep(2.0)  # until they are at work
    print(*(p.pid for p in multiprocessing.active_children()), flush=True)
threading.Thread(target=tell, daemon=True).start()
list(run_calls(time.sleep, [(300,)] * 2, workers=2, progress=SILENT, total=2))
"""
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as process:
        workers = [int(word) for word in process.stdout.readline().split()]
        assert len(workers) == 2
        assert not any(gone(i) for i in workers)
        os.kill(process.pid, signal.SIGKILL)
    assert wait_until(lambda: all(gone(i) for i in workers))


def test_a_scheduler_needs_its_package():
    with pytest.raises(MissingDependency, match="distributed"):
        list(run_calls(math.sqrt, [(4.0,)], workers=1, scheduler="tcp://nowhere:1", progress=SILENT, total=1))
