"""Workers: who makes the parts of a study: this process, several beside it, or a Dask cluster.

Takes a `Study` and the numbers of its parts; hands on each `Part` as it is done, in any order. A part is the same
whoever makes it.
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

from sonarhw.errors import InputError, WorkersLost
from sonarhw_compare.study.parts import Part, make_part
from sonarhw_compare.study.spec import Study
from sonarhw_compare.study.worker_process import begin_worker

_ONE_THREAD = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_ANSWER_WITHIN = 10.0  # s, a scheduler that is there


def parts_here(study: Study, numbers: Sequence[int], workers: int) -> Generator[Part, None, None]:
    """The parts, made by so many processes of this machine. Raises WorkersLost where one of them is killed."""
    workers = min(workers, len(numbers))
    if workers <= 1:
        yield from (make_part(study, number) for number in numbers)
        return
    # the first is made here: what is compiled for it the others find compiled
    first, *others = numbers
    yield make_part(study, first)
    # spawned, not forked: alike on every system, and no thread of this process is cut in half
    context = multiprocessing.get_context("spawn")
    listener, teller = context.Pipe(duplex=False)
    with _one_thread_each():
        with _interrupts_held():
            pool = ProcessPoolExecutor(workers, context, initializer=begin_worker, initargs=(listener,))
        try:
            with _interrupts_held():
                waiting = [pool.submit(make_part, study, number) for number in others]
            for done in as_completed(waiting):
                yield done.result()
        except BrokenProcessPool as error:
            raise WorkersLost("a process of the study was killed; what is done is kept: add --resume") from error
        finally:
            # whatever they are at: what is not done by now is not wanted
            teller.close()
            pool.shutdown(wait=True, cancel_futures=True)
            listener.close()


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back until the end; processes begun meanwhile hold it from their first moment, while they import."""
    handler = signal.getsignal(signal.SIGINT)
    # Windows has no masks; only the main thread may set a handler, and none that C code has set can be put back
    main = threading.current_thread() is threading.main_thread()
    if not hasattr(signal, "pthread_sigmask") or not main or handler is None:
        yield
        return
    # begun with the first process otherwise, which lets Ctrl-C through again
    resource_tracker.ensure_running()
    came: list[int] = []
    # processes inherit the mask, but other threads here have none: what they take is noted
    signal.signal(signal.SIGINT, lambda number, _: came.append(number))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        signal.signal(signal.SIGINT, handler)
        if came:
            signal.raise_signal(signal.SIGINT)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let processes begun meanwhile compute in one thread each: there is one for every core already."""
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
    """The parts, made by the Dask cluster whose scheduler is at a URL. A worker lost, its parts go to the others.

    Raises InputError where Dask is not installed or nobody answers there, WorkersLost where a part is given up.
    """
    distributed = _distributed()
    # what is lost is told here, in one line; Dask would add tracebacks of its own
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(scheduler, timeout=_ANSWER_WITHIN, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as error:
        raise InputError(
            f"--scheduler {scheduler}: no Dask scheduler answers there; expected tcp://HOST:PORT"
        ) from error
    with client:
        waiting = client.map(make_part, [study] * len(numbers), list(numbers), pure=False)
        finished: Any = distributed.as_completed(waiting, loop=client.loop)
        try:
            for done in finished:
                yield done.result()
                # its bytes need not stay on the worker
                done.release()
        except (distributed.KilledWorker, CancelledError) as error:
            raise WorkersLost("the cluster was lost, or its workers; what is done is kept: add --resume") from error


def _distributed() -> Any:
    try:
        import distributed
    except ImportError as error:
        raise InputError(
            "--scheduler: Dask is not installed; install sonarhw with its extra: pip install 'sonarhw[study]'"
        ) from error
    return distributed
