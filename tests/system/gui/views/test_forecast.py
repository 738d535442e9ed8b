"""The prediction of the window, without a window: newest request first, stale answers dropped, same results."""

import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from weakref import ref

import numpy as np
import pytest
from pytestqt.qtbot import QtBot
from sonarhw_compare.match import compare_readings
from sonarhw_gui.jobs.forecast import (
    LATE,
    REST,
    SHORT_REST,
    ComparedScan,
    CompareRequest,
    Effort,
    EffortChoice,
    Forecast,
    PathsFound,
    PathsRequest,
    StretchesCompared,
)
from sonarhw_gui.jobs.jobs import Failure, Worker
from sonarhw_gui.model.scene import Scene
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan

from sonarhw.errors import InputError
from sonarhw.log import read_log
from tests.hang_guard import HANG
from tests.system.gui.driving import until


@dataclass(frozen=True)
class Waiting:
    gate: threading.Event
    begun: threading.Event
    result: object = "waited"

    def answer(self) -> object:
        self.begun.set()
        self.gate.wait()
        return self.result


@dataclass(frozen=True)
class Echoed:
    word: object

    def answer(self) -> object:
        if isinstance(self.word, Exception):
            raise self.word
        return self.word


@pytest.fixture
def worker() -> Iterator[Worker]:
    worker = Worker("worker under test")
    yield worker
    worker.close()


def taken(qtbot: QtBot, worker: Worker, count: int) -> list[Any]:
    answers = []

    def enough() -> bool:
        answers.extend(worker.take())
        return len(answers) >= count

    until(qtbot, enough)
    return answers


def test_only_the_newest_waiting_request_is_answered(qtbot: QtBot, worker: Worker) -> None:
    gate, begun = threading.Event(), threading.Event()
    worker.submit(Waiting(gate, begun))
    assert begun.wait(HANG)
    for word in ("old", "older", "new"):
        worker.submit(Echoed(word))
    gate.set()
    assert taken(qtbot, worker, 2) == ["waited", "new"]


def test_a_failed_request_is_answered_and_the_next_one_works(qtbot: QtBot, worker: Worker) -> None:
    worker.submit(Echoed(InputError("no such thing")))
    (failure,) = taken(qtbot, worker, 1)
    assert isinstance(failure, Failure)
    assert failure.message == "no such thing"
    worker.submit(Echoed("next"))
    assert taken(qtbot, worker, 1) == ["next"]


def test_a_defect_is_raised_instead_of_becoming_a_message(qtbot: QtBot, worker: Worker) -> None:
    worker.submit(Echoed(ZeroDivisionError("defect")))
    (failure,) = taken(qtbot, worker, 1)
    with pytest.raises(ZeroDivisionError):
        _ = failure.message


class Large:
    """Stands for a B-scan of tens of megabytes."""


def test_a_waiting_thread_keeps_no_answer(qtbot: QtBot, worker: Worker) -> None:
    worker.submit(Echoed(Large()))
    kept = ref(taken(qtbot, worker, 1)[0])
    until(qtbot, lambda: kept() is None)


@pytest.fixture
def forecast() -> Iterator[Forecast]:
    forecast = Forecast()
    yield forecast
    forecast.close()


def finished(qtbot: QtBot, forecast: Forecast) -> None:
    def settled() -> bool:
        forecast.take()
        return not forecast.searching and not forecast._comparer._worker.busy

    until(qtbot, settled)


def test_answers_of_another_scene_or_scan_are_dropped(
    qtbot: QtBot, forecast: Forecast, scene: Scene, recorded: Path
) -> None:
    readings = read_log(recorded).readings
    forecast.set_scene(scene)
    forecast.follow(readings)
    finished(qtbot, forecast)
    stale_paths = PathsRequest(0, scene, scene.options).answer()
    stale_rows = CompareRequest(0, stale_paths, ((0, readings[:2]),)).answer()
    outline, compared = forecast.outline, forecast.compared
    for worker, answer in ((forecast._finder, stale_paths), (forecast._comparer._worker, stale_rows)):
        worker.submit(Echoed(answer))
        finished(qtbot, forecast)
    assert forecast.outline is outline
    assert forecast.compared is compared


def test_an_immediately_replaced_scene_is_not_predicted(qtbot: QtBot, forecast: Forecast, scene: Scene) -> None:
    elsewhere = replace(scene, place=scene.room.place("figure7"))
    forecast.set_scene(scene)
    forecast.set_scene(elsewhere)
    finished(qtbot, forecast)
    assert forecast.outline.place.name == "figure7"


def test_a_new_scan_drops_the_comparison_of_the_last_one(
    qtbot: QtBot, forecast: Forecast, scene: Scene, recorded: Path
) -> None:
    forecast.set_scene(scene)
    forecast.follow(read_log(recorded).readings)
    finished(qtbot, forecast)
    assert isinstance(forecast.compared, ComparedScan)
    forecast.begin_scan()
    assert forecast.compared is None


def test_the_window_and_the_command_compare_alike(
    qtbot: QtBot, forecast: Forecast, scene: Scene, recorded: Path
) -> None:
    """Paths not detected at any heading are left out; classes, ranges and explanations are the same."""
    readings = read_log(recorded).readings
    forecast.set_scene(scene)
    forecast.follow(readings)
    finished(qtbot, forecast)
    slow = compare_readings(readings, scene.room, scene.pose, scene.board)
    fast = forecast.compared.stretches[0].comparison
    for one, other in zip(fast.rows, slow.rows, strict=True):
        assert (one.kind, one.measured, one.predicted) == (other.kind, other.measured, other.predicted)
        if other.path is not None:
            assert fast.prediction.paths.lengths[one.path] == slow.prediction.paths.lengths[other.path]
    assert len(fast.prediction.paths) <= len(slow.prediction.paths)


def test_a_draft_has_fewer_bounces_than_the_full_prediction(scene: Scene) -> None:
    draft = PathsRequest(1, scene, Effort(2, 720, 36).limit(scene.options)).answer()
    whole = PathsRequest(1, scene, scene.options).answer()
    assert isinstance(draft, PathsFound)
    assert draft.draft
    assert not whole.draft
    assert draft.paths.bounces.max() <= 2
    assert len(whole.paths) > len(draft.paths)
    known = ~np.isnan(whole.outline.ranges)
    assert known.sum() >= (~np.isnan(draft.outline.ranges)).sum()


def test_the_ranges_of_the_boards_receiver_replace_those_of_a_quick_draft(qtbot: QtBot, scene: Scene) -> None:
    """A quick draft may use the ideal receiver, which reports millimetres less than that of the board."""
    scene = replace(scene, board=load_board("polaroid-6500"))
    clock = Clock()
    forecast = Forecast(clock)
    forecast.change_scene(scene, moving=True)
    until(qtbot, forecast.take)
    draft = forecast.outline
    exact = predict_scan(scene.room, scene.pose, scene.board, draft.headings)
    assert draft.receiver is Receiver.FIRST_ECHO
    assert not np.allclose(draft.ranges, exact.ranges, atol=1e-4, equal_nan=True)
    clock.now += REST  # the hand rests
    finished(qtbot, forecast)
    assert np.allclose(forecast.outline.ranges, exact.ranges, atol=1e-9, equal_nan=True)
    forecast.close()


def test_no_path_detectable_at_any_heading_is_left_out(scene: Scene) -> None:
    kept = PathsRequest(1, scene, scene.options).answer().paths
    headings = np.radians(np.arange(0.25, 360.0, 0.5))  # beside those of the outline
    everything = predict_scan(scene.room, scene.pose, scene.board, headings)
    loud = {everything.paths.lengths[echo.path] for k in range(len(headings)) for echo in everything.ping(k).echoes}
    assert 0 < len(loud) < len(everything.paths)
    assert loud <= set(kept.lengths)


class Clock:
    """A clock that the test sets."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def moved(scene: Scene, by: float) -> Scene:
    x, y = scene.place.position
    return replace(scene, place=replace(scene.place, position=(x - by, y)))


def test_a_moving_sensor_gets_drafts_and_a_resting_one_the_full_prediction(qtbot: QtBot, scene: Scene) -> None:
    clock = Clock()
    forecast = Forecast(clock)
    forecast.change_scene(moved(scene, 0.1), moving=True)
    until(qtbot, forecast.take)
    draft = forecast.outline
    assert draft.place.position == moved(scene, 0.1).place.position
    clock.now += 0.5 * REST
    forecast.take()
    assert not forecast._finder.busy
    assert forecast.searching
    clock.now += 0.6 * REST
    finished(qtbot, forecast)
    assert len(forecast.outline.paths) > len(draft.paths)
    forecast.close()


@pytest.mark.parametrize(("between", "rest"), [(0.01, SHORT_REST), (0.04, 0.08), (0.2, REST)])
def test_a_drag_rests_after_twice_the_time_between_its_movements(scene: Scene, between: float, rest: float) -> None:
    clock = Clock()
    forecast = Forecast(clock)
    for step in range(3):
        clock.now = between * step
        forecast.change_scene(moved(scene, 0.01 * step), moving=True)
    clock.now += 0.9 * rest
    forecast.take()
    assert forecast.dragging
    clock.now += 0.2 * rest
    forecast.take()
    assert not forecast.dragging
    forecast.close()


def test_a_late_draft_is_shown_but_never_after_a_newer_one(qtbot: QtBot, forecast: Forecast, scene: Scene) -> None:
    forecast.set_scene(scene)
    finished(qtbot, forecast)
    answers = [
        PathsRequest(generation, moved(scene, 0.01 * generation), Effort(1, 720, 36).limit(scene.options)).answer()
        for generation in (2, 3, 4)
    ]
    forecast._generation = 5
    for answer, shown in ((answers[1], answers[1]), (answers[0], answers[1]), (answers[2], answers[2])):
        forecast._accept(answer)
        assert forecast.outline is shown.outline


def test_the_old_prediction_stays_until_the_changed_scene_is_predicted(
    qtbot: QtBot, forecast: Forecast, scene: Scene, recorded: Path
) -> None:
    forecast.set_scene(scene)
    forecast.follow(read_log(recorded).readings)
    finished(qtbot, forecast)
    outline, compared = forecast.outline, forecast.compared
    forecast.change_scene(moved(scene, 0.1))
    assert forecast.outline is outline
    assert forecast.compared is compared
    finished(qtbot, forecast)
    assert forecast.outline is not outline
    assert forecast.compared.stretches[0].comparison.prediction.place.position == moved(scene, 0.1).place.position


def test_old_values_become_outdated_after_a_delay_until_the_new_ones_arrive(
    qtbot: QtBot, scene: Scene, recorded: Path
) -> None:
    clock = Clock()
    forecast = Forecast(clock)
    forecast.set_scene(scene)
    forecast.follow(read_log(recorded).readings)
    finished(qtbot, forecast)
    gate, begun = threading.Event(), threading.Event()
    forecast._comparer._worker.submit(Waiting(gate, begun, StretchesCompared(-1, ())))  # blocks the comparison
    assert begun.wait(HANG)
    forecast.change_scene(moved(scene, 0.1))
    for now, outdated in ((0.0, False), (0.9 * LATE, False), (LATE, True), (0.0, True)):
        clock.now = now
        forecast.take()
        assert forecast.outdated is outdated
    gate.set()
    finished(qtbot, forecast)
    assert not forecast.outdated
    forecast.close()


@pytest.mark.parametrize(("late", "outdated"), [(0.5 * LATE, False), (LATE, True)])
def test_late_drafts_of_a_moving_sensor_are_outdated(scene: Scene, recorded: Path, late: float, outdated: bool) -> None:
    clock = Clock()
    forecast = Forecast(clock)
    readings = read_log(recorded).readings[:3]
    found = PathsRequest(1, scene, Effort(1, 720, 36).limit(scene.options)).answer()
    forecast.set_scene(scene)
    observed = []
    for generation in range(2, 12):  # the sensor moves again as soon as the last draft has arrived
        forecast.change_scene(moved(scene, 0.001 * generation), moving=True)
        clock.now += late
        request = CompareRequest(0, replace(found, generation=generation - 1), ((0, readings),))
        forecast._comparer.compared = (forecast.compared or ComparedScan(())).with_newer(request.answer().stretches)
        forecast._forget_changes(generation - 1)
        forecast._update_outdated()
        observed.append(forecast.outdated)
    assert observed == [outdated] * len(observed)
    forecast.close()


def test_slow_drafts_get_fewer_bounces_and_fast_ones_more(scene: Scene) -> None:
    choice = EffortChoice()
    usual = choice.effort
    choice.record(0.1)
    assert choice.effort.max_bounces < usual.max_bounces
    for _ in range(10):
        choice.record(0.001)
    assert choice.effort.max_bounces > usual.max_bounces
    assert choice.effort.limit(scene.options).receiver is scene.options.receiver
    assert usual.limit(scene.options).receiver is Receiver.FIRST_ECHO
    deepest = choice.effort
    choice.record(0.010)
    assert choice.effort is deepest


def test_probabilities_follow_the_complete_outline_of_a_board_with_spreads(
    qtbot: QtBot, forecast: Forecast, scene: Scene
) -> None:
    uncertain = replace(scene, board=replace(scene.board, threshold_sd_db=3.0))
    forecast.set_scene(uncertain)
    until(qtbot, lambda: forecast.take() and forecast.chances is not None)
    chances, outline = forecast.chances.shading, forecast.outline
    cells = np.round(outline.ranges / chances.reach * chances.opacities.shape[1] - 0.5)
    heard = np.flatnonzero((outline.over_threshold > 9.0) & (np.diff(cells, append=cells[0]) == 0))
    assert len(heard) > 50
    # echoes three standard deviations over the threshold are almost certain, unless an earlier one may be heard
    opacities = chances.opacities[heard, cells[heard].astype(int)]
    assert np.median(opacities) > 0.95
    assert chances.opacities.max() <= 1.0
    forecast.set_scene(scene)
    assert forecast.chances is None
    finished(qtbot, forecast)
    assert not forecast._weigher.busy
    assert forecast.chances is None
