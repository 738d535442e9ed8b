"""The fit in the panel, with mouse and keys: accepted, undone, cancelled, rejected."""

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from sonarhw_compare.fit import free_parameters
from sonarhw_gui.jobs.jobs import BackgroundJob
from sonarhw_gui.jobs.searches import FitFound, fitted, value_text
from sonarhw_gui.model.edits import sensor_at
from sonarhw_gui.model.look import LengthUnit
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.model.shown import Shown
from sonarhw_gui.session import session
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.board.profile import parse_board

from sonarhw.log import read_log
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import until

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def equal_fits_once(monkeypatch: pytest.MonkeyPatch, known: dict[object, FitFound]) -> None:
    """Answer a fit that another test has completed at once, because it takes seconds; the scene is the same."""
    fit = session.find_pose

    def find_pose(shown: Shown, free: tuple[str, ...], everywhere: bool, job: BackgroundJob) -> FitFound:
        if (free, everywhere) not in known:
            known[free, everywhere] = fit(shown, free, everywhere, job)
        return replace(known[free, everywhere], scene=shown.scene)

    monkeypatch.setattr(session, "find_pose", find_pose)


@pytest.fixture(scope="module")
def known() -> dict[object, FitFound]:
    return {}


def opened(qtbot: QtBot, open_with: OpenWith, recorded: Path, scene: Scene) -> MainWindow:
    """Open a scan of figure 9 with the sensor 12 cm and 9° away from its true pose."""
    beside, _ = sensor_at(scene, (0.69, 0.17))
    beside = replace(beside, place=replace(beside.place, heading=math.radians(9)))
    window = open_with(scene=beside, source=read_log(recorded))
    qtbot.keyClick(window, Qt.Key.Key_F9)
    until(qtbot, window.fit_panel.isVisible)
    return window


def find(qtbot: QtBot, window: MainWindow) -> None:
    qtbot.mouseClick(window.fit_panel.begin, LEFT)
    until(qtbot, lambda: window.session.fitting.state.answer is not None)


@pytest.mark.usefixtures("equal_fits_once")
def test_the_pose_is_found_with_its_deviation_accepted_and_undone(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, scene: Scene
) -> None:
    window = opened(qtbot, open_with, recorded, scene)
    panel, before = window.fit_panel, window.session.shown.scene
    find(qtbot, window)
    assert panel.accept.isVisible()
    # a position has the unit of its deviation, because m beside mm is misread
    assert len(re.findall(r"\d mm</td><td>&nbsp;&nbsp;± [\d.]+ mm", panel.table.text())) >= 2
    assert "within 5 cm: " in panel.notes.text()
    assert window.session.shown.scene is before
    found = window.session.fitting.state.answer
    assert found.within_5cm < 0.7 < found.fitted_within_5cm[0]
    qtbot.mouseClick(panel.accept, LEFT)
    place = window.session.shown.scene.pose
    assert place.position == pytest.approx(scene.pose.position, abs=0.005)
    assert abs(math.remainder(place.heading - scene.pose.heading, math.tau)) < math.radians(1)
    assert not panel.accept.isVisible()
    assert window.commands.undo.text() == "Undo finding the pose"
    until(qtbot, window.commands.undo.isEnabled)
    qtbot.keyClick(window, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    until(qtbot, lambda: window.session.shown.scene is before)


def test_in_a_symmetric_room_every_solution_is_listed_and_can_be_accepted(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, scene: Scene
) -> None:
    window = opened(qtbot, open_with, recorded, scene)
    panel = window.fit_panel
    qtbot.keyClick(panel.where, Qt.Key.Key_Down)
    find(qtbot, window)
    assert panel.solutions.isVisible()
    assert panel.solutions.count() == 2
    assert "the room may be symmetric" in panel.notes.text()
    assert "°" not in panel.notes.text()  # both poses are in the list, with headings as everywhere in the window
    wide, deep = scene.room.walls.reshape(-1, 2).max(axis=0)
    (x, y), turned = scene.pose.position, scene.pose.heading + math.pi
    poses = [((x, y), scene.pose.heading), ((wide - x, deep - y), turned)]
    qtbot.keyClick(panel.solutions, Qt.Key.Key_Down)
    assert "± " not in panel.table.text()
    qtbot.mouseClick(panel.accept, LEFT)
    place = window.session.shown.scene.pose
    at, heading = min(poses, key=lambda pose: math.dist(pose[0], place.position))
    assert place.position == pytest.approx(at, abs=0.01)
    assert abs(math.remainder(place.heading - heading, math.tau)) < math.radians(2)


@pytest.mark.usefixtures("equal_fits_once")
def test_a_cancelled_or_discarded_fit_changes_nothing(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, scene: Scene
) -> None:
    window = opened(qtbot, open_with, recorded, scene)
    panel, before = window.fit_panel, window.session.shown.scene
    qtbot.mouseClick(panel.begin, LEFT)
    until(qtbot, panel.cancel.isVisible)
    assert not panel.begin.isEnabled()
    qtbot.mouseClick(panel.cancel, LEFT)
    assert not panel.cancel.isVisible()
    assert panel.begin.isEnabled()
    find(qtbot, window)
    qtbot.mouseClick(panel.discard, LEFT)
    assert not panel.accept.isVisible()
    assert window.session.shown.scene is before


def test_another_scan_cancels_a_running_fit(qtbot: QtBot, open_with: OpenWith, recorded: Path, scene: Scene) -> None:
    window = opened(qtbot, open_with, recorded, scene)
    qtbot.mouseClick(window.fit_panel.begin, LEFT)
    window.session.leave_replay()
    assert not window.session.fitting.state.running
    assert not window.fit_panel.begin.isEnabled()
    assert not window.fit_panel.cancel.isVisible()


def test_an_impossible_fit_shows_a_banner(qtbot: QtBot, open_with: OpenWith, recorded: Path, scene: Scene) -> None:
    log = read_log(recorded)
    silent = tuple(replace(reading, echo_times=()) for reading in log.readings)
    window = open_with(scene=scene, source=replace(log, scans=(replace(log.scans[0], readings=silent),)))
    qtbot.keyClick(window, Qt.Key.Key_J, Qt.KeyboardModifier.ControlModifier)
    until(qtbot, lambda: "no reading of this scan has an echo" in window.banner.message)
    assert window.fit_panel.isVisible()


def test_without_a_free_parameter_no_fit_can_start(
    qtbot: QtBot, open_with: OpenWith, recorded: Path, scene: Scene
) -> None:
    panel = opened(qtbot, open_with, recorded, scene).fit_panel
    for box in panel.free.values():
        box.setFocus()
        if box.isChecked():
            qtbot.keyClick(box, Qt.Key.Key_Space)
    assert not panel.begin.isEnabled()


def test_values_below_zero_have_a_minus_sign_and_zero_has_none(scene: Scene) -> None:
    found = {"heading": math.radians(-0.01), "offset": -0.00001, "temperature": -5.04, "x": -0.00001}
    free = free_parameters(("position", "heading", "offset", "temperature"), ["scan"], scene.room, scene.board)
    values = {one: found.get(one.name, 0.5) for one in free}
    texts = {one.name: value_text(one, value, LengthUnit.M) for one, value in values.items()}
    assert texts == {
        "x": "0.000 m",
        "y": "0.500 m",
        "heading": "−0.01°",
        "offset": "+0.0 mm",
        "temperature": "−5.0 °C",
    }
    heading = next(one for one in free if one.name == "heading")
    assert value_text(heading, math.radians(-90), LengthUnit.M) == "−90.00°"


def test_found_values_are_stored_in_room_and_profile(scene: Scene) -> None:
    found_at = {"x": 0.5, "y": 0.25, "heading": math.radians(90), "offset": 0.012, "temperature": 23.4}
    free = free_parameters(("position", "heading", "offset", "temperature"), ["scan"], scene.room, scene.board)
    after, _ = fitted(scene, {one: found_at[one.name] for one in free}, scene.board)
    assert (after.place.position, after.place.heading) == ((0.5, 0.25), math.radians(90))
    assert "temperature_c = 23.4" in after.room.text
    assert after.room.air.temperature_c == 23.4
    assert parse_board(after.board.text, "the profile").range_offset == after.board.range_offset == -0.012
