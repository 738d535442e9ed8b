"""The prediction behind the window, without a window: newest first, stale dropped, as good as the slow way."""

import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytestqt.qtbot import QtBot

from compare.match import compare_readings
from gui.forecast import Compared, CompareRequest, Forecast, PathsFound, PathsRequest
from gui.scene import Scene
from gui.worker import Failure, Worker
from sim.paths import MAX_BOUNCES
from sim.prediction import predict_scan
from sonarhw.errors import InputError
from sonarhw.log import read_log


@dataclass(frozen=True)
class Waiting:
    gate: threading.Event
    begun: threading.Event

    def answer(self) -> str:
        self.begun.set()
        self.gate.wait()
        return "waited"


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

    qtbot.waitUntil(enough, timeout=10_000)
    return answers


def test_of_the_requests_that_wait_the_newest_is_answered(qtbot: QtBot, worker: Worker) -> None:
    gate, begun = threading.Event(), threading.Event()
    worker.ask(Waiting(gate, begun))
    assert begun.wait(10)
    for word in ("old", "older", "new"):
        worker.ask(Echoed(word))
    gate.set()
    assert taken(qtbot, worker, 2) == ["waited", "new"]


def test_a_failed_request_is_an_answer_too_and_the_next_is_met(qtbot: QtBot, worker: Worker) -> None:
    worker.ask(Echoed(InputError("no such thing")))
    (failure,) = taken(qtbot, worker, 1)
    assert isinstance(failure, Failure)
    assert failure.message == "no such thing"
    worker.ask(Echoed("next"))
    assert taken(qtbot, worker, 1) == ["next"]


def test_a_defect_is_raised_and_not_told_as_a_message(qtbot: QtBot, worker: Worker) -> None:
    worker.ask(Echoed(ZeroDivisionError("defect")))
    (failure,) = taken(qtbot, worker, 1)
    with pytest.raises(ZeroDivisionError):
        _ = failure.message


@pytest.fixture
def forecast() -> Iterator[Forecast]:
    forecast = Forecast()
    yield forecast
    forecast.close()


def finished(qtbot: QtBot, forecast: Forecast) -> None:
    def settled() -> bool:
        forecast.take()
        return not forecast.searching and not forecast._comparer.busy

    qtbot.waitUntil(settled, timeout=30_000)


def test_answers_for_another_scene_or_scan_are_dropped(
    qtbot: QtBot, forecast: Forecast, scene: Scene, recorded: Path
) -> None:
    readings = read_log(recorded).readings
    forecast.set_scene(scene)
    forecast.follow(readings)
    finished(qtbot, forecast)
    stale_paths = PathsRequest(0, scene.room, scene.standing, scene.board, 1).answer()
    stale_rows = CompareRequest(0, scene.room, scene.standing, scene.board, stale_paths, readings[:2], 0).answer()
    outline, compared = forecast.outline, forecast.compared
    for answer in (stale_paths, stale_rows):
        forecast._finder.ask(Echoed(answer))
        finished(qtbot, forecast)
    assert forecast.outline is outline
    assert forecast.compared is compared


def test_a_scene_changed_at_once_leaves_no_trace_of_the_first(qtbot: QtBot, forecast: Forecast, scene: Scene) -> None:
    elsewhere = replace(scene, place=scene.room.place("figure7"))
    forecast.set_scene(scene)
    forecast.set_scene(elsewhere)
    finished(qtbot, forecast)
    assert forecast.outline.place.name == "figure7"


def test_a_new_scan_forgets_the_comparison_of_the_one_before(
    qtbot: QtBot, forecast: Forecast, scene: Scene, recorded: Path
) -> None:
    forecast.set_scene(scene)
    forecast.follow(read_log(recorded).readings)
    finished(qtbot, forecast)
    assert isinstance(forecast.compared, Compared)
    forecast.begin_scan()
    assert forecast.compared is None


def test_what_the_window_compares_is_what_the_command_compares(
    qtbot: QtBot, forecast: Forecast, scene: Scene, recorded: Path
) -> None:
    """The paths that no heading hears are left out; classes, ranges and explanations are the same."""
    readings = read_log(recorded).readings
    forecast.set_scene(scene)
    forecast.follow(readings)
    finished(qtbot, forecast)
    slow = compare_readings(readings, scene.room, scene.standing, scene.board)
    fast = forecast.compared.comparison
    for one, other in zip(fast.rows, slow.rows, strict=True):
        assert (one.kind, one.measured, one.predicted) == (other.kind, other.measured, other.predicted)
        if other.path is not None:
            assert fast.prediction.paths.lengths[one.path] == slow.prediction.paths.lengths[other.path]
    assert len(fast.prediction.paths) <= len(slow.prediction.paths)


def test_a_draft_has_few_bounces_and_the_rest_follows(scene: Scene) -> None:
    draft = PathsRequest(1, scene.room, scene.standing, scene.board, 2).answer()
    whole = PathsRequest(1, scene.room, scene.standing, scene.board, MAX_BOUNCES).answer()
    assert isinstance(draft, PathsFound)
    assert draft.draft
    assert not whole.draft
    assert draft.paths.bounces.max() <= 2
    assert len(whole.paths) > len(draft.paths)
    heard = ~np.isnan(whole.outline.ranges)
    assert heard.sum() >= (~np.isnan(draft.outline.ranges)).sum()


def test_no_path_that_is_loud_at_any_heading_is_left_out(scene: Scene) -> None:
    kept = PathsRequest(1, scene.room, scene.standing, scene.board, MAX_BOUNCES).answer().paths
    headings = np.radians(np.arange(0.25, 360.0, 0.5))  # beside those of the outline
    everything = predict_scan(scene.room, scene.standing, scene.board, headings)
    loud = {everything.paths.lengths[echo.path] for k in range(len(headings)) for echo in everything.echoes(k)}
    assert 0 < len(loud) < len(everything.paths)
    assert loud <= set(kept.lengths)
