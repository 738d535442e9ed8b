"""Predicted traces and B-scans, without a window: the newest is shown, and answers of another scan are dropped."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from pytestqt.qtbot import QtBot
from sonarhw_gui.jobs.jobs import Jobs
from sonarhw_gui.jobs.traces import BScanSettings, Pane
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.session.showing import TraceForecast
from sonarhw_sim.predict.prediction import predict_scan

from sonarhw.errors import NotALog
from sonarhw.readings import FloatArray, Reading, Trace
from tests.system.gui.driving import until

SETTINGS = BScanSettings((Pane.MEASURED,), polar=False, decibels=True)


class Unreadable(Trace):
    @property
    def times(self) -> FloatArray:
        raise NotALog("scan.mcap: can no longer be read")


def readings(count: int, trace: type[Trace] = Trace) -> tuple[Reading, ...]:
    angles = (math.radians(10.0 * k) for k in range(count))
    made = trace(np.full(500, 0.1), 50e3, 0.0)
    return tuple(Reading(k, 0, 0, angle, 0.1 * k, (), 343.2, trace=made) for k, angle in enumerate(angles))


@pytest.fixture
def jobs(qtbot: QtBot) -> Iterator[Jobs]:
    jobs = Jobs()
    yield jobs
    jobs.close()


@pytest.fixture
def failures() -> list[str]:
    return []


@pytest.fixture
def forecast(jobs: Jobs, failures: list[str]) -> TraceForecast:
    return TraceForecast(jobs, failures.append)


def taken(qtbot: QtBot, forecast: TraceForecast, enough: Callable[[], bool]) -> None:
    def ready() -> bool:
        forecast.take()
        return enough()

    until(qtbot, ready)


def degrees(forecast: TraceForecast) -> float | None:
    return None if forecast.trace is None else round(math.degrees(forecast.trace.heading), 3)


def test_the_trace_belongs_to_the_last_chosen_reading(
    qtbot: QtBot, forecast: TraceForecast, failures: list[str], scene: Scene
) -> None:
    for chosen in range(30):
        forecast.follow(Shown(scene, readings=readings(30), chosen=chosen))
    taken(qtbot, forecast, lambda: degrees(forecast) == 290.0)
    assert not failures


def test_an_unreadable_trace_is_reported_and_the_next_is_shown(
    qtbot: QtBot, forecast: TraceForecast, failures: list[str], scene: Scene
) -> None:
    forecast.follow(Shown(scene, readings=readings(1, Unreadable), chosen=0))
    taken(qtbot, forecast, lambda: bool(failures))
    assert failures == ["scan.mcap: can no longer be read"]
    assert forecast.trace is None
    forecast.follow(Shown(scene, readings=readings(3), chosen=2))
    taken(qtbot, forecast, lambda: degrees(forecast) == 20.0)


def test_another_scan_drops_the_requests_of_the_last_one(qtbot: QtBot, forecast: TraceForecast, scene: Scene) -> None:
    forecast.request_bscan(SETTINGS)
    forecast.follow(Shown(scene, readings=readings(30), chosen=29))
    forecast.begin_scan()
    forecast.follow(Shown(scene, readings=readings(2), chosen=1))
    taken(qtbot, forecast, lambda: forecast.bscan is not None and forecast.trace is not None)
    assert degrees(forecast) == 10.0
    assert len(forecast.bscan.measured.headings) == 2


def test_a_trace_that_arrives_after_its_scan_is_dropped(
    qtbot: QtBot, jobs: Jobs, forecast: TraceForecast, scene: Scene
) -> None:
    forecast.follow(Shown(scene, readings=readings(1), chosen=0))
    forecast.begin_scan()
    taken(qtbot, forecast, lambda: not jobs.busy("traces"))
    assert forecast.trace is None


def test_without_a_reading_there_is_no_trace(qtbot: QtBot, forecast: TraceForecast, scene: Scene) -> None:
    forecast.follow(Shown(scene, readings=readings(1), chosen=0))
    taken(qtbot, forecast, lambda: forecast.trace is not None)
    forecast.follow(Shown(scene))
    assert forecast.trace is None


def test_a_bscan_is_computed_completely_and_only_while_visible(
    qtbot: QtBot, forecast: TraceForecast, scene: Scene
) -> None:
    outline = predict_scan(scene.room, scene.pose, scene.board, np.radians(np.arange(0.0, 360.0, 2.0)))
    shown = Shown(scene, outline=outline, readings=readings(36), chosen=None)
    forecast.follow(shown)
    assert not forecast.take()
    forecast.request_bscan(replace(SETTINGS, panes=tuple(Pane)))
    taken(qtbot, forecast, lambda: forecast.bscan is not None and forecast.bscan.rows.done == 1)
    assert len(forecast.bscan.predicted.headings) == 180
    assert len(forecast.bscan.measured.headings) == 36
    forecast.request_bscan(None)
    before = forecast.bscan
    forecast.follow(replace(shown, readings=readings(2)))
    forecast.take()
    assert forecast.bscan is before
