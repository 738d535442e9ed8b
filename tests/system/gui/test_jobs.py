"""Work beside the window, without a window: jobs, predictions, traces, messages, turns of updates, and garbage."""

import gc
import math
import sys
import threading
import time
import weakref
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QObject
from pytestqt.exceptions import capture_exceptions
from sonarhw_compare.match import compare_readings
from sonarhw_gui.jobs.forecast import LATE, REST, Forecast
from sonarhw_gui.jobs.jobs import BackgroundJob, Jobs
from sonarhw_gui.jobs.traces import BScanSettings, Pane
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.session.notices import Notices
from sonarhw_gui.session.session import Turns
from sonarhw_gui.session.showing import TraceForecast
from sonarhw_gui.window.bars import Banner
from sonarhw_gui.window.garbage import collected_between_events
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan

from sonarhw.errors import InputError, NotALog
from sonarhw.log import read_log
from sonarhw.readings import FloatArray, Reading, Trace
from tests.conftest import Count
from tests.fixtures.leaks import working_threads
from tests.hang_guard import HANG
from tests.system.gui.conftest import NEAR, ORDER
from tests.system.gui.driving import pause, push, until

# jobs


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


def test_only_the_newest_waiting_job_of_a_key_runs_and_a_lane_keeps_each_key(jobs: Jobs) -> None:
    held, results = Held(), []
    jobs.run("word", held, then=results.append, lane="files")
    assert held.begun.wait(HANG)
    for key in ("log", "room", "log", "word", "word"):
        jobs.run(key, echo, key, then=results.append, lane="files")
    jobs.run("elsewhere", echo, "elsewhere", then=results.append)
    until(lambda: results == ["elsewhere"])
    held.gate.set()
    until(lambda: not jobs.busy("files"))
    assert results == ["elsewhere", "held", "room", "log", "word"]


def test_results_and_errors_arrive_in_the_gui_thread_and_a_defect_is_raised(jobs: Jobs) -> None:
    threads, messages = [], []
    jobs.failed.connect(messages.append)
    jobs.run("error", raising(InputError("no such thing")))
    until(lambda: messages == ["no such thing"])
    jobs.run("error", raising(InputError("reported elsewhere")), failed=messages.append)
    until(lambda: messages[1:] == ["reported elsewhere"])
    jobs.run("name", lambda: threads.append(threading.current_thread().name) or "done", then=messages.append)
    until(lambda: messages[2:] == ["done"])
    assert threads == ["name"]
    with capture_exceptions() as raised:
        jobs.run("defect", raising(ZeroDivisionError("defect")), failed=messages.append)
        until(lambda: not jobs.busy("defect"))
    assert [kind for kind, _, _ in raised] == [ZeroDivisionError]
    assert messages[3:] == [""]


class Large:
    """Stands for a B-scan of tens of megabytes."""


def test_a_waiting_thread_keeps_no_result(jobs: Jobs) -> None:
    results = []
    jobs.run("large", Large, then=results.append)
    until(lambda: bool(results))
    kept = weakref.ref(results.pop())
    until(lambda: kept() is None)


def test_progress_is_passed_on_until_the_job_is_cancelled(jobs: Jobs) -> None:
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
    until(lambda: not jobs.busy("search"))
    assert (len(seen), results) == (1, [])


def test_a_job_that_never_ends_does_not_hold_the_window_and_a_file_is_saved(jobs: Jobs) -> None:
    held, slow, saved, before = Held(), Held(), [], working_threads(NEAR)
    jobs.run("search", held)
    jobs.run("save", lambda: saved.append(slow()), at_close=True)
    assert held.begun.wait(HANG)
    threading.Timer(0.3, slow.gate.set).start()
    jobs.close(until=time.monotonic() + 0.1)
    assert saved == ["held"]
    held.gate.set()
    until(lambda: working_threads(NEAR).keys() <= before.keys())  # reports nothing: its window is closed


def test_closing_does_what_must_be_done_drops_the_rest_and_ends_the_threads(jobs: Jobs) -> None:
    held, done, before = Held(), [], working_threads(NEAR)
    jobs.run("held", held, lane="files")
    assert held.begun.wait(HANG)
    assert [module for thread, module in working_threads(NEAR).items() if thread not in before] == [
        "sonarhw_gui.jobs.jobs"
    ]
    jobs.run("read", done.append, "read", lane="files")
    jobs.run("save", done.append, "saved", lane="files", at_close=True)
    threading.Timer(0.05, held.gate.set).start()
    jobs.close()
    jobs.run("late", done.append, "late")
    assert done == ["saved"]
    assert working_threads(NEAR).keys() <= before.keys()


# predictions


class Clock:
    """A clock that the test sets."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def forecast(jobs: Jobs, clock: Clock) -> Forecast:
    return Forecast(jobs, clock)


@pytest.fixture
def readings(recorded: Path) -> tuple[Reading, ...]:
    return read_log(recorded).readings


def moved(scene: Scene, by: float) -> Scene:
    x, y = scene.place.position
    return replace(scene, place=replace(scene.place, position=(x - by, y)))


def finished(forecast: Forecast, jobs: Jobs) -> None:
    def settled() -> bool:
        forecast.take()
        return not forecast.searching and not jobs.busy("compare readings")

    until(settled)


def test_the_window_and_the_command_compare_alike_and_the_old_values_stay_until_the_new_ones(
    forecast: Forecast, jobs: Jobs, clock: Clock, scene: Scene, readings: tuple[Reading, ...]
) -> None:
    """Paths not detected at any heading are left out; classes, ranges and explanations are the same."""
    elsewhere = replace(scene, place=scene.room.place("figure7"))
    forecast.set_scene(elsewhere)  # replaced at once, and not predicted
    forecast.set_scene(scene)
    forecast.follow(readings)
    finished(forecast, jobs)
    assert forecast.outline.place.name == "figure9"
    slow = compare_readings(readings, scene.room, scene.pose, scene.board)
    fast = forecast.compared.stretches[0].comparison
    for one, other in zip(fast.rows, slow.rows, strict=True):
        assert (one.kind, one.measured, one.predicted) == (other.kind, other.measured, other.predicted)
        if other.path is not None:
            assert fast.prediction.paths.lengths[one.path] == slow.prediction.paths.lengths[other.path]
    assert len(fast.prediction.paths) <= len(slow.prediction.paths)

    outline, compared, held = forecast.outline, forecast.compared, Held()
    jobs.run("compare readings", held)  # blocks the comparison
    assert held.begun.wait(HANG)
    forecast.change_scene(moved(scene, 0.1))
    assert (forecast.outline, forecast.compared) == (outline, compared)
    for now, outdated in ((0.0, False), (0.9 * LATE, False), (LATE, True), (0.0, True)):
        clock.now = now
        forecast.take()
        assert forecast.outdated is outdated
    held.gate.set()
    finished(forecast, jobs)
    assert not forecast.outdated
    assert forecast.outline is not outline
    assert forecast.compared.stretches[0].comparison.prediction.place.position == moved(scene, 0.1).place.position
    forecast.begin_scan()
    assert forecast.compared is None


def test_a_moving_sensor_gets_drafts(forecast: Forecast, jobs: Jobs, clock: Clock, scene: Scene) -> None:
    """A quick draft may use the ideal receiver, which reports millimetres less than that of the board."""
    scene = replace(scene, board=load_board("polaroid-6500"))
    forecast.change_scene(moved(scene, 0.1), moving=True)
    until(forecast.take)
    draft = forecast.outline
    exact = predict_scan(scene.room, moved(scene, 0.1).pose, scene.board, draft.headings)
    assert draft.place.position == moved(scene, 0.1).place.position
    assert draft.receiver is Receiver.FIRST_ECHO
    assert not np.allclose(draft.ranges, exact.ranges, atol=1e-4, equal_nan=True)
    clock.now += 0.5 * REST
    forecast.take()
    assert not jobs.busy("find paths")
    assert forecast.searching
    clock.now += 0.6 * REST  # the hand rests
    finished(forecast, jobs)
    assert np.allclose(forecast.outline.ranges, exact.ranges, atol=1e-9, equal_nan=True)
    assert len(forecast.outline.paths) > len(draft.paths)


# traces

SETTINGS = BScanSettings((Pane.MEASURED,), polar=False, decibels=True)


class Unreadable(Trace):
    @property
    def times(self) -> FloatArray:
        raise NotALog("scan.mcap: can no longer be read")


def traced(count: int, trace: type[Trace] = Trace) -> tuple[Reading, ...]:
    made = trace(np.full(500, 0.1), 50e3, 0.0)
    return tuple(Reading(k, 0, 0, math.radians(10.0 * k), 0.1 * k, (), 343.2, trace=made) for k in range(count))


def test_the_trace_belongs_to_the_last_chosen_reading_of_the_last_scan(jobs: Jobs, scene: Scene) -> None:
    failures: list[str] = []
    traces = TraceForecast(jobs, failures.append)

    def taken(enough: Callable[[], bool]) -> None:
        until(lambda: traces.take() is not None and enough())

    def degrees() -> float | None:
        return None if traces.trace is None else round(math.degrees(traces.trace.heading), 3)

    for chosen in range(30):
        traces.follow(Shown(scene, readings=traced(30), chosen=chosen))
    taken(lambda: degrees() == 290.0)
    assert not failures
    traces.follow(Shown(scene))
    assert traces.trace is None  # without a reading there is none
    traces.begin_scan()
    traces.follow(Shown(scene, readings=traced(1, Unreadable), chosen=0))
    taken(lambda: failures == ["scan.mcap: can no longer be read"])
    assert traces.trace is None
    traces.follow(Shown(scene, readings=traced(3), chosen=2))
    taken(lambda: degrees() == 20.0)
    traces.follow(Shown(scene, readings=traced(1), chosen=0))
    traces.begin_scan()  # drops what arrives later
    taken(lambda: not jobs.busy("traces"))
    assert traces.trace is None
    traces.request_bscan(SETTINGS)
    traces.follow(Shown(scene, readings=traced(30), chosen=29))
    traces.begin_scan()
    traces.follow(Shown(scene, readings=traced(2), chosen=1))
    taken(lambda: traces.bscan is not None and traces.trace is not None)
    assert (degrees(), len(traces.bscan.measured.headings)) == (10.0, 2)


# messages


def test_the_state_comes_first_then_the_newest_error_then_the_newest_warning_each_once(qapp: object) -> None:
    notices = Notices()
    banner = Banner(notices)

    def shown() -> tuple[str, int]:
        assert banner.isHidden() is (notices.shown.text == "")
        assert banner.message.removeprefix("⚠ ") == notices.shown.text
        return notices.shown.text, notices.more

    for message in ("first", "second", "first"):
        notices.warn(message)
    assert shown() == ("first", 1)
    notices.dismiss()
    assert shown() == ("second", 0)
    notices.fail("no such file", "connected")
    assert shown() == ("no such file", 1)
    assert "1 more" in banner.more_button.text()
    for expected in ("second", "no such file"):
        push(banner.more_button)
        assert shown()[0] == expected
    notices.set_state("the cable is out")
    assert shown() == ("the cable is out", 2)
    notices.show_next()
    notices.dismiss()  # removes the message that is shown
    assert [notice.text for notice in notices.all] == ["the cable is out", "second"]
    notices.set_state("")
    assert shown() == ("second", 0)
    notices.set_state("the cable is out")
    notices.dismiss()
    notices.set_state("reconnecting")
    assert shown() == ("second", 0)  # a dismissed state is shown again only after it has ended
    notices.set_state("")
    notices.set_state("the cable is out")
    notices.clear()
    assert shown() == ("the cable is out", 0)
    notices.set_state("")
    notices.fail("no answer", "connected")
    notices.warn("the disk is nearly full")
    notices.end("search changed")
    assert shown() == ("no answer", 1)
    notices.end("connected")
    assert shown() == ("the disk is nearly full", 0)
    push(banner.close_button)
    assert banner.isHidden()


# turns, repaints and garbage


def test_parts_of_an_update_take_turns_and_each_shows_the_last_change(qapp: object) -> None:
    owner, state, drawn = QObject(), [0], []

    def draw(part: int) -> None:
        drawn.append((part, state[0]))
        if len(drawn) == 1:  # a change after the first part was drawn
            state[0] = 1
            turns.soon()

    turns = Turns([partial(draw, part) for part in range(3)], 1, owner)
    turns.soon()
    until(lambda: len(drawn) >= 4)
    assert drawn == [(0, 0), (1, 1), (2, 1), (0, 1)]
    turns.soon()
    turns.all_now()
    assert [part for part, _ in drawn[4:]] == [0, 1, 2]
    pause(20)
    assert len(drawn) == 7  # without a change, nothing is due
    frames: list[int] = []
    turns = Turns([partial(frames.append, part) for part in range(3)], 1, owner)
    turns.advance()
    turns.advance()
    assert frames == [0, 1]
    until(lambda: len(frames) >= 4)
    pause(20)
    assert frames == [0, 1, 2, 0]  # each part was updated after the last frame


def test_repaints_do_not_leak_references_to_none(window: MainWindow, count: Count) -> None:
    """Some PySide6 versions lose or leak references: one or more per item and repaint."""
    views = (window.views.plan.drawing, window.views.trace.canvas, window.views.ranges)

    def repaint(times: int) -> int:
        for k in range(times):
            window.session.showing.choose(k % ORDER.readings)
            for view in views:
                view.viewport().repaint()
        gc.collect()
        return sys.getrefcount(None)

    before = repaint(ORDER.readings)
    assert abs(repaint(count(120, 10_000)) - before) < 60  # the normal variation


class Ring:
    """A reference cycle, which only the collector frees."""

    def __init__(self) -> None:
        self.myself = self


def test_garbage_is_freed_in_the_thread_of_the_window(qapp: object, monkeypatch: pytest.MonkeyPatch) -> None:
    def is_searched(ring: Ring) -> bool:
        return any(known is ring for known in gc.get_objects())

    freed_by: list[threading.Thread] = []
    kept: list[list[int]] = []
    early = Ring()
    assert is_searched(early)
    with collected_between_events():
        assert not gc.isenabled()
        late = Ring()
        assert (is_searched(early), is_searched(late)) == (False, True)
        weakref.finalize(Ring(), lambda: freed_by.append(threading.current_thread()))
        # enough objects to start automatic collection
        thread = threading.Thread(target=lambda: kept.extend([] for _ in range(200_000)))
        thread.start()
        thread.join()
        assert freed_by == []
        until(lambda: freed_by == [threading.main_thread()])
        for number in range(20):
            monkeypatch.setitem(sys.modules, f"imported_{number}", sys)
        until(lambda: not is_searched(late))
    assert gc.isenabled()
