"""The prediction of the window, without a window: stale results are dropped, and it equals that of the command."""

import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pytestqt.qtbot import QtBot
from sonarhw_compare.match import compare_readings
from sonarhw_gui.jobs.forecast import (
    EFFORTS,
    FIRST_LEVEL,
    LATE,
    REST,
    SHORT_REST,
    ComparedScan,
    Effort,
    Forecast,
    PathsFound,
    compare_stretches,
    find_paths,
    next_level,
)
from sonarhw_gui.jobs.jobs import Jobs
from sonarhw_gui.model.scene import Scene
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan

from sonarhw.log import read_log
from tests.hang_guard import HANG
from tests.system.gui.driving import until


@pytest.fixture
def jobs(qtbot: QtBot) -> Iterator[Jobs]:
    jobs = Jobs()
    yield jobs
    jobs.close()


@pytest.fixture
def forecast(jobs: Jobs) -> Forecast:
    return Forecast(jobs)


def finished(qtbot: QtBot, forecast: Forecast) -> None:
    def settled() -> bool:
        forecast.take()
        return not forecast.searching and not forecast._jobs.busy("compare readings")

    until(qtbot, settled)


def test_answers_of_another_scene_or_scan_are_dropped(
    qtbot: QtBot, forecast: Forecast, scene: Scene, recorded: Path
) -> None:
    readings = read_log(recorded).readings
    forecast.set_scene(scene)
    forecast.follow(readings)
    finished(qtbot, forecast)
    stale_paths = find_paths(0, scene, scene.options)
    stale_rows = compare_stretches(stale_paths, ((0, readings[:2]),))
    outline, compared = forecast.outline, forecast.compared
    forecast._accept(stale_paths)
    forecast._comparer._take(0, stale_rows)
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
    draft = find_paths(1, scene, Effort(2, 720, 36).limit(scene.options))
    whole = find_paths(1, scene, scene.options)
    assert isinstance(draft, PathsFound)
    assert draft.draft
    assert not whole.draft
    assert draft.paths.bounces.max() <= 2
    assert len(whole.paths) > len(draft.paths)
    known = ~np.isnan(whole.outline.ranges)
    assert known.sum() >= (~np.isnan(draft.outline.ranges)).sum()


def test_the_ranges_of_the_boards_receiver_replace_those_of_a_quick_draft(
    qtbot: QtBot, jobs: Jobs, scene: Scene
) -> None:
    """A quick draft may use the ideal receiver, which reports millimetres less than that of the board."""
    scene = replace(scene, board=load_board("polaroid-6500"))
    clock = Clock()
    forecast = Forecast(jobs, clock)
    forecast.change_scene(scene, moving=True)
    until(qtbot, forecast.take)
    draft = forecast.outline
    exact = predict_scan(scene.room, scene.pose, scene.board, draft.headings)
    assert draft.receiver is Receiver.FIRST_ECHO
    assert not np.allclose(draft.ranges, exact.ranges, atol=1e-4, equal_nan=True)
    clock.now += REST  # the hand rests
    finished(qtbot, forecast)
    assert np.allclose(forecast.outline.ranges, exact.ranges, atol=1e-9, equal_nan=True)


def test_no_path_detectable_at_any_heading_is_left_out(scene: Scene) -> None:
    kept = find_paths(1, scene, scene.options).paths
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


def test_a_moving_sensor_gets_drafts_and_a_resting_one_the_full_prediction(
    qtbot: QtBot, jobs: Jobs, scene: Scene
) -> None:
    clock = Clock()
    forecast = Forecast(jobs, clock)
    forecast.change_scene(moved(scene, 0.1), moving=True)
    until(qtbot, forecast.take)
    draft = forecast.outline
    assert draft.place.position == moved(scene, 0.1).place.position
    clock.now += 0.5 * REST
    forecast.take()
    assert not jobs.busy("find paths")
    assert forecast.searching
    clock.now += 0.6 * REST
    finished(qtbot, forecast)
    assert len(forecast.outline.paths) > len(draft.paths)


@pytest.mark.parametrize(("between", "rest"), [(0.01, SHORT_REST), (0.04, 0.08), (0.2, REST)])
def test_a_drag_rests_after_twice_the_time_between_its_movements(
    jobs: Jobs, scene: Scene, between: float, rest: float
) -> None:
    clock = Clock()
    forecast = Forecast(jobs, clock)
    for step in range(3):
        clock.now = between * step
        forecast.change_scene(moved(scene, 0.01 * step), moving=True)
    clock.now += 0.9 * rest
    forecast.take()
    assert forecast.dragging
    clock.now += 0.2 * rest
    forecast.take()
    assert not forecast.dragging


def test_a_late_draft_is_shown_but_never_after_a_newer_one(qtbot: QtBot, forecast: Forecast, scene: Scene) -> None:
    forecast.set_scene(scene)
    finished(qtbot, forecast)
    answers = [
        find_paths(generation, moved(scene, 0.01 * generation), Effort(1, 720, 36).limit(scene.options))
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
    qtbot: QtBot, jobs: Jobs, scene: Scene, recorded: Path
) -> None:
    clock = Clock()
    forecast = Forecast(jobs, clock)
    forecast.set_scene(scene)
    forecast.follow(read_log(recorded).readings)
    finished(qtbot, forecast)
    gate, begun = threading.Event(), threading.Event()
    jobs.run("compare readings", lambda: begun.set() or gate.wait())  # blocks the comparison
    assert begun.wait(HANG)
    forecast.change_scene(moved(scene, 0.1))
    for now, outdated in ((0.0, False), (0.9 * LATE, False), (LATE, True), (0.0, True)):
        clock.now = now
        forecast.take()
        assert forecast.outdated is outdated
    gate.set()
    finished(qtbot, forecast)
    assert not forecast.outdated


@pytest.mark.parametrize(("late", "outdated"), [(0.5 * LATE, False), (LATE, True)])
def test_late_drafts_of_a_moving_sensor_are_outdated(
    jobs: Jobs, scene: Scene, recorded: Path, late: float, outdated: bool
) -> None:
    clock = Clock()
    forecast = Forecast(jobs, clock)
    readings = read_log(recorded).readings[:3]
    found = find_paths(1, scene, Effort(1, 720, 36).limit(scene.options))
    forecast.set_scene(scene)
    observed = []
    for generation in range(2, 12):  # the sensor moves again as soon as the last draft has arrived
        forecast.change_scene(moved(scene, 0.001 * generation), moving=True)
        clock.now += late
        stretches = compare_stretches(replace(found, generation=generation - 1), ((0, readings),))
        forecast._comparer.compared = (forecast.compared or ComparedScan(())).with_newer(stretches)
        forecast._forget_changes(generation - 1)
        forecast._update_outdated()
        observed.append(forecast.outdated)
    assert observed == [outdated] * len(observed)


def test_slow_drafts_get_fewer_bounces_and_fast_ones_more(scene: Scene) -> None:
    usual = EFFORTS[FIRST_LEVEL]
    level = next_level(FIRST_LEVEL, 0.1)
    assert EFFORTS[level].max_bounces < usual.max_bounces
    for _ in range(10):
        level = next_level(level, 0.001)
    assert EFFORTS[level].max_bounces > usual.max_bounces
    assert EFFORTS[level].limit(scene.options).receiver is scene.options.receiver
    assert usual.limit(scene.options).receiver is Receiver.FIRST_ECHO
    assert next_level(level, 0.010) == level


def test_probabilities_follow_the_complete_outline_of_a_board_with_spreads(
    qtbot: QtBot, forecast: Forecast, jobs: Jobs, scene: Scene
) -> None:
    uncertain = replace(scene, board=replace(scene.board, threshold_sd_db=3.0))
    forecast.set_scene(uncertain)
    until(qtbot, lambda: forecast.take() and forecast.chances is not None)
    chances, outline = forecast.chances, forecast.outline
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
    assert not jobs.busy("probabilities")
    assert forecast.chances is None
