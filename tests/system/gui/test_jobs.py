"""Background jobs: the newest waiting one runs, results and errors reach the GUI thread, closing ends the threads."""

import threading
import time
from collections.abc import Callable, Iterator
from weakref import ref

import pytest
from pytestqt.exceptions import capture_exceptions
from pytestqt.qtbot import QtBot
from sonarhw_gui.jobs.jobs import BackgroundJob, Jobs

from sonarhw.errors import InputError
from tests.hang_guard import HANG
from tests.system.gui.conftest import working_threads
from tests.system.gui.driving import until


@pytest.fixture
def jobs(qtbot: QtBot) -> Iterator[Jobs]:
    jobs = Jobs()
    yield jobs
    jobs.close()


class Held:
    """A function that waits until it is let go."""

    def __init__(self) -> None:
        self.begun, self.gate = threading.Event(), threading.Event()

    def __call__(self, result: object = "held") -> object:
        self.begun.set()
        assert self.gate.wait(HANG)
        return result


def raising(error: Exception) -> Callable[[], None]:
    def work() -> None:
        raise error

    return work


def echo(word: object) -> object:
    return word


def test_only_the_newest_waiting_job_of_a_key_runs(qtbot: QtBot, jobs: Jobs) -> None:
    held, results = Held(), []
    jobs.run("word", held, then=results.append)
    assert held.begun.wait(HANG)
    for word in ("old", "older", "new"):
        jobs.run("word", echo, word, then=results.append)
    held.gate.set()
    until(qtbot, lambda: not jobs.busy("word"))
    assert results == ["held", "new"]


def test_jobs_of_one_lane_run_one_after_another_and_keep_each_key(qtbot: QtBot, jobs: Jobs) -> None:
    held, results = Held(), []
    jobs.run("first", held, then=results.append, lane="files")
    assert held.begun.wait(HANG)
    for key in ("log", "room", "log"):
        jobs.run(key, echo, key, then=results.append, lane="files")
    jobs.run("elsewhere", echo, "elsewhere", then=results.append)
    until(qtbot, lambda: results == ["elsewhere"])
    held.gate.set()
    until(qtbot, lambda: not jobs.busy("files"))
    assert results == ["elsewhere", "held", "room", "log"]


def test_results_and_errors_arrive_in_the_gui_thread(qtbot: QtBot, jobs: Jobs) -> None:
    threads, messages = [], []
    jobs.failed.connect(messages.append)
    jobs.run("error", raising(InputError("no such thing")))
    until(qtbot, lambda: messages == ["no such thing"])
    jobs.run("error", raising(InputError("reported elsewhere")), failed=messages.append)
    jobs.run("name", lambda: threads.append(threading.current_thread().name) or "done", then=messages.append)
    until(
        qtbot, lambda: messages[1:] == ["reported elsewhere", "done"] or messages[1:] == ["done", "reported elsewhere"]
    )
    assert threads == ["name"]


def test_a_defect_is_raised_instead_of_becoming_a_message(qtbot: QtBot, jobs: Jobs) -> None:
    messages = []
    with capture_exceptions() as raised:
        jobs.run("defect", raising(ZeroDivisionError("defect")), failed=messages.append)
        until(qtbot, lambda: not jobs.busy("defect"))
    assert [kind for kind, _, _ in raised] == [ZeroDivisionError]
    assert messages == [""]


class Large:
    """Stands for a B-scan of tens of megabytes."""


def test_a_waiting_thread_keeps_no_result(qtbot: QtBot, jobs: Jobs) -> None:
    results = []
    jobs.run("large", Large, then=results.append)
    until(qtbot, lambda: bool(results))
    kept = ref(results.pop())
    until(qtbot, lambda: kept() is None)


def test_progress_is_passed_on_until_the_job_is_cancelled(qtbot: QtBot, jobs: Jobs) -> None:
    seen, results, reported, ended = [], [], threading.Event(), threading.Event()

    def work(progress: BackgroundJob) -> str:
        progress.report(0.5, "half")
        progress.part = "a wall"
        reported.set()
        while not progress.cancelled:
            ended.wait(0.001)
        ended.set()
        return "too late"

    jobs.run("search", work, then=results.append, progress=lambda now: seen.append((now.share, now.step, now.part)))
    assert reported.wait(HANG)
    jobs.tick()
    assert seen == [(0.5, "half", "a wall")]
    jobs.cancel("search")
    jobs.tick()
    assert ended.wait(HANG)
    until(qtbot, lambda: not jobs.busy("search"))
    assert (len(seen), results) == (1, [])


def test_a_full_lane_refuses_further_jobs(qtbot: QtBot, jobs: Jobs) -> None:
    held, messages, results = Held(), [], []
    jobs.failed.connect(messages.append)
    jobs.run("held", held, lane="files")
    assert held.begun.wait(HANG)
    for number in range(70):
        jobs.run(f"save {number}", echo, number, then=results.append, lane="files")
    assert messages == ["files: 64 jobs are waiting; try again later"] * 6
    held.gate.set()
    until(qtbot, lambda: not jobs.busy("files"))
    assert results == list(range(64))


def test_a_job_that_never_ends_does_not_hold_the_window_and_a_file_is_saved(qtbot: QtBot, jobs: Jobs) -> None:
    held, slow, saved = Held(), Held(), []
    jobs.run("search", held)
    jobs.run("save", lambda: saved.append(slow()), at_close=True)
    assert held.begun.wait(HANG)
    threading.Timer(0.3, slow.gate.set).start()
    jobs.close(until=time.monotonic() + 0.1)
    assert saved == ["held"]
    held.gate.set()


def test_closing_does_what_must_be_done_drops_the_rest_and_ends_the_threads(qtbot: QtBot, jobs: Jobs) -> None:
    held, done, before = Held(), [], working_threads()
    jobs.run("held", held, lane="files")
    assert held.begun.wait(HANG)
    assert [module for thread, module in working_threads().items() if thread not in before] == ["sonarhw_gui.jobs.jobs"]
    jobs.run("read", done.append, "read", lane="files")
    jobs.run("save", done.append, "saved", lane="files", at_close=True)
    threading.Timer(0.05, held.gate.set).start()
    jobs.close()
    jobs.run("late", done.append, "late")
    assert done == ["saved"]
    assert working_threads().keys() <= before.keys()
