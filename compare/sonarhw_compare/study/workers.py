"""Workers that compute the parts of a study: this process, several processes, or a Dask cluster.

Parts are returned as soon as they are complete, in any order. A part is the same from any worker.
"""

import logging
import multiprocessing
import os
import signal
import threading
from collections.abc import Generator, Iterator, Sequence
from concurrent.futures import CancelledError, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import Any

from sonarhw.errors import InputError, MissingExtra, WorkersLost
from sonarhw_compare.study.parts import Part, make_part
from sonarhw_compare.study.spec import Study
from sonarhw_compare.study.worker_process import begin_worker

_ONE_THREAD = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_ANSWER_WITHIN = 10.0  # s, timeout for the scheduler


def parts_here(study: Study, numbers: Sequence[int], workers: int) -> Generator[Part, None, None]:
    """Yield the parts, computed by `workers` processes of this machine. Raises WorkersLost if one is killed."""
    workers = min(workers, len(numbers))
    if workers <= 1:
        yield from (make_part(study, number) for number in numbers)
        return
    # the first part is computed here, so that the workers find the kernels compiled
    first, *others = numbers
    yield make_part(study, first)
    # spawned, not forked: the same on every system, and safe with threads in this process
    context = multiprocessing.get_context("spawn")
    receiving, sending = context.Pipe(duplex=False)
    with _one_thread_each():
        with _interrupts_deferred():
            pool = ProcessPoolExecutor(workers, context, initializer=begin_worker, initargs=(receiving,))
        try:
            with _interrupts_deferred():
                waiting = [pool.submit(make_part, study, number) for number in others]
            for done in as_completed(waiting):
                yield done.result()
        except BrokenProcessPool as error:
            raise WorkersLost("a process of the study was killed; complete parts are kept: resume the study") from error
        finally:
            # ends the workers at once; parts in progress are discarded
            sending.close()
            pool.shutdown(wait=True, cancel_futures=True)
            receiving.close()


@contextmanager
def _interrupts_deferred() -> Iterator[None]:
    """Defer Ctrl-C until the end. Processes started meanwhile defer it from their start, while they import."""
    handler = signal.getsignal(signal.SIGINT)
    # Windows has no masks; only the main thread can set a handler, and one set by C code cannot be restored
    main = threading.current_thread() is threading.main_thread()
    if not hasattr(signal, "pthread_sigmask") or not main or handler is None:
        yield
        return
    # otherwise this tracker would start with the first process and unblock Ctrl-C again
    resource_tracker.ensure_running()
    received: list[int] = []
    # processes inherit the mask, but other threads of this process have none: note the signals that they receive
    signal.signal(signal.SIGINT, lambda number, _: received.append(number))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        signal.signal(signal.SIGINT, handler)
        if received:
            signal.raise_signal(signal.SIGINT)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let processes started meanwhile use one thread each, because there is one process for each core."""
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(dict.fromkeys(_ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def parts_on_cluster(study: Study, numbers: Sequence[int], scheduler: str) -> Generator[Part, None, None]:
    """Yield the parts, computed by the Dask cluster of a scheduler. Parts of a lost worker go to the others.

    Raises MissingExtra without Dask, InputError if the scheduler does not answer, WorkersLost if a part fails.
    """
    distributed = _distributed()
    # a loss is reported here in one line; Dask would add tracebacks
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(scheduler, timeout=_ANSWER_WITHIN, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(f"scheduler {scheduler}: no Dask scheduler answers; expected tcp://HOST:PORT") from error
    with client:
        waiting = client.map(make_part, [study] * len(numbers), list(numbers), pure=False)
        finished: Any = distributed.as_completed(waiting, loop=client.loop)
        try:
            for done in finished:
                yield done.result()
                # frees the memory of the worker
                done.release()
        except (distributed.KilledWorker, CancelledError) as error:
            raise WorkersLost(
                "the connection to the cluster or its workers was lost; complete parts are kept: resume the study"
            ) from error


def _distributed() -> Any:
    try:
        import distributed
    except ImportError as error:
        raise MissingExtra("a scheduler needs Dask", "study") from error
    return distributed
