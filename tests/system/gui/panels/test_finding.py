"""The dock "Find the room" with mouse and keys: walls appear, are explained, rejected, accepted, undone and edited."""

import itertools
import math
import os
import select
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from pytestqt.qtbot import QtBot
from sonarhw_cli.app import run
from sonarhw_compare import processes as pool
from sonarhw_compare.locate import Pose, PoseSpread
from sonarhw_compare.processes import Processes
from sonarhw_compare.rooms import outcome
from sonarhw_compare.rooms import search as unknown_poses
from sonarhw_gui.jobs import searches
from sonarhw_gui.jobs.searches import Accuracy, FindState, LoadedScan, RoomAnswer
from sonarhw_gui.model.edits import with_board
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import load_board

from sonarhw.errors import InputError
from tests.checkout import CHECKOUT
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import keep_pictures, log_name, predicted, until

LEFT = Qt.MouseButton.LeftButton
CONTROL = Qt.KeyboardModifier.ControlModifier
CORNER = """name = "Corner"
[materials.board]
reflectance = 0.9
[[walls]]
name = "east"
points = [[2.0, 0.0], [2.0, 1.6]]
material = "board"
[[walls]]
name = "north"
points = [[2.0, 1.6], [0.2, 1.6]]
material = "board"
[places.a]
position = [0.8, 0.7]
[places.b]
position = [1.3, 0.5]
"""
EAST, NORTH = ((2.0, 0.0), (0.0, 1.0)), ((0.2, 1.6), (1.0, 0.0))  # a point of each wall, and its direction


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("corner")
    room = folder / "corner.toml"
    room.write_text(CORNER)
    for place in "ab":
        out = str(folder / f"{place}.mcap")
        assert run(["simulate", str(room), "--place", place, "--step", "10", "--out", out]) == 0
    return folder


@pytest.fixture(scope="module")
def known() -> list[RoomAnswer]:
    return []


@pytest.fixture
def first_search_once(monkeypatch: pytest.MonkeyPatch, known: list[RoomAnswer]) -> None:
    """Answer a first search in scans a and b at once if another test has completed it."""
    search = searches.search_room

    def search_room(
        scans: tuple[LoadedScan, ...], air: Air, accuracy: Accuracy, start: object, *rest: Any
    ) -> RoomAnswer:
        if start is not None:
            return search(scans, air, accuracy, start, *rest)
        assert sorted(scan.name for scan in scans) == ["a", "b"]
        if not known:
            known.append(search(scans, air, accuracy, start, *rest))
        return replace(known[0])

    monkeypatch.setattr(searches, "search_room", search_room)


@pytest.fixture
def window(qtbot: QtBot, open_with: OpenWith, folder: Path) -> MainWindow:
    """Return a window with scan a shown in its room, scan b added, and the panel open."""
    window = open_with()
    window.session.open_file(str(folder / "a.mcap"))
    until(qtbot, lambda: log_name(window) == "a.mcap" and predicted(window))
    add_scans(qtbot, window, folder / "b.mcap")
    return window


def add_scans(qtbot: QtBot, window: MainWindow, *logs: Path) -> None:
    """Add logs, and open the panel with its key."""
    for count, log in enumerate(logs, len(window.session.scans.scans) + 1):
        window.session.scans.open(str(log))
        until(qtbot, lambda count=count: len(window.session.scans.scans) == count)
    qtbot.keyClick(window, Qt.Key.Key_M, CONTROL)
    until(qtbot, window.finding.isVisible)


def find(qtbot: QtBot, window: MainWindow) -> list[FindState]:
    """Find the room with the button; return the states on the way."""
    states: list[FindState] = []
    window.session.finding.changed.connect(states.append)
    qtbot.mouseClick(window.finding.begin, LEFT)
    until(qtbot, lambda: not window.session.finding.state.running)
    window.session.finding.changed.disconnect(states.append)
    return states


def click_row(qtbot: QtBot, window: MainWindow, row: int) -> None:
    found = window.finding.list
    qtbot.mouseClick(found.viewport(), LEFT, pos=found.visualItemRect(found.item(row)).center() + QPoint(0, 1))


def away(points: np.ndarray, wall: tuple[tuple[float, float], tuple[float, float]]) -> np.ndarray:
    """Return how far points (n, 2) are from the line of a wall, m."""
    (x, y), (along_x, along_y) = wall
    return np.abs((points[:, 0] - x) * along_y - (points[:, 1] - y) * along_x)


def drawn_walls(window: MainWindow) -> list[np.ndarray]:
    """Return both ends of each wall drawn in the plan, (2, 2) m."""
    points = np.column_stack(window.views.plan.drawing.found_room.surfaces.getData())
    lines = np.split(points, np.flatnonzero(np.isnan(points[:, 0])) + 1)
    return [line[:2] for line in lines if len(line) == 3]  # longer ones are posts


def is_highlighted(window: MainWindow, ends: np.ndarray) -> bool:
    """Return whether the wall with these ends, (2, 2) m, is the highlighted one."""
    points = np.column_stack(window.views.plan.drawing.found_room.chosen.getData())
    return len(points) == 3 and np.allclose(points[:2], ends)


def rings(window: MainWindow) -> np.ndarray:
    """Return the points with rings in the plan, (n, 2) m."""
    return np.column_stack(window.views.plan.drawing.found_room.rings.getData())


def test_walls_appear_and_each_shows_its_readings(qtbot: QtBot, window: MainWindow) -> None:
    panel, plan = window.finding, window.views.plan.drawing.found_room
    qtbot.mouseClick(panel.begin, LEFT)
    assert panel.progress.isVisible()
    assert not panel.begin.isEnabled()
    qtbot.mouseClick(panel.cancel, LEFT)
    states = find(qtbot, window)
    on_the_way = [len(one.hypotheses.supports) for one in states if one.running and one.hypotheses is not None]
    assert {1, 2} <= set(on_the_way)
    assert on_the_way == sorted(on_the_way)

    # against the walls of the room in which the scans were simulated
    assert panel.list.count() == 2
    walls = states[-1].hypotheses.draft.segments.reshape(-1, 2, 2)  # of the result; before it, others are drawn
    until(qtbot, lambda: len(drawn_walls(window)) == len(walls) == 2 and np.allclose(drawn_walls(window), walls))
    true = {0: EAST, 1: NORTH}
    for row, ends in enumerate(drawn_walls(window)):
        (wall,) = (wall for wall in true.values() if away(ends, wall).max() < 0.03)
        click_row(qtbot, window, row)
        until(qtbot, lambda ends=ends: is_highlighted(window, ends))
        said = int(panel.list.item(row).text().split("\n")[1].split(" readings for")[0])
        assert 0 < len(rings(window)) <= said
        assert window.legend.explained["wall found"].isVisible()
        assert window.legend.explained["for it"].isVisible()
        assert np.median(away(rings(window), wall)) < 0.05  # the others are in the margins of the beam, and ghosts
    keep_pictures(qtbot, window, "found")
    item = panel.list.item(1)
    lines, size = item.text(), panel.list.visualItemRect(item)
    item.setText(f"post 1 · radius 0.150 m · ± 13.4 mm, ± 13.4 mm\n{lines}")  # too wide for the panel: wrapped, not cut
    taller = panel.list.visualItemRect(item)
    assert (taller.height() - size.height()) / panel.list.fontMetrics().height() > 1.9
    assert taller.width() <= panel.list.viewport().width()

    panel.list.setFocus()
    qtbot.keyClick(panel.list, Qt.Key.Key_Up)
    until(qtbot, lambda: is_highlighted(window, drawn_walls(window)[0]))

    qtbot.mouseClick(panel.plan, LEFT)
    assert panel.progress.isVisible()
    until(qtbot, lambda: not window.session.finding.state.running and plan.next_scan.isVisible())
    best = window.session.finding.state.places[0]
    assert f"x {best.position[0]:.3f} m, y {best.position[1]:.3f} m: gain {best.gain:.1f} nats" in panel.next.text()
    assert np.column_stack(plan.next_scan.getData()) == pytest.approx(np.array([best.position]))
    keep_pictures(qtbot, window, "next_scan")

    # the drawing is in the plan while the panel is open
    qtbot.keyClick(window, Qt.Key.Key_M, CONTROL)
    until(qtbot, lambda: not plan.surfaces.isVisible() and not plan.next_scan.isVisible())
    assert not any(window.legend.explained[name].isVisible() for name in ("wall found", "for it", "against it"))


@pytest.mark.usefixtures("first_search_once")
def test_the_best_place_so_far_is_shown_while_others_are_tried(
    qtbot: QtBot, window: MainWindow, monkeypatch: pytest.MonkeyPatch
) -> None:
    panel, plan, finding = window.finding, window.views.plan.drawing.found_room, window.session.finding
    find(qtbot, window)
    tried, held = itertools.count(), threading.Event()
    predict = outcome.predict_scan

    def held_after_ten(*scene: object) -> object:
        if next(tried) == 10:
            held.wait(60.0)
        return predict(*scene)

    monkeypatch.setattr(outcome, "predict_scan", held_after_ten)
    qtbot.mouseClick(panel.plan, LEFT)
    until(qtbot, lambda: finding.state.share > 0.1 and plan.next_scan.isVisible())
    assert finding.state.running == "planning"
    assert panel.next.text().startswith("Best so far, while other places are tried: scan next at x ")
    assert panel.progress.isVisible()
    keep_pictures(qtbot, window, "next_so_far")
    (best, *_) = finding.state.places

    qtbot.mouseClick(panel.cancel, LEFT)  # the best one so far stays
    held.set()
    until(qtbot, lambda: panel.next.text().startswith("Scan next at x "))
    assert finding.state.places[0] is best
    assert not panel.progress.isVisible()
    assert plan.next_scan.isVisible()


@pytest.mark.usefixtures("first_search_once")
def test_found_walls_are_not_drawn_in_another_room(qtbot: QtBot, window: MainWindow, folder: Path) -> None:
    panel = window.finding
    find(qtbot, window)
    until(qtbot, lambda: len(drawn_walls(window)) == 2)
    window.session.open_file(str(CHECKOUT / "rooms" / "corridor.toml"))
    until(qtbot, lambda: window.session.shown.scene.room_file == "corridor.toml")
    until(qtbot, lambda: not drawn_walls(window))
    assert not window.legend.explained["wall found"].isVisible()
    assert "another room" in panel.note.text()
    keep_pictures(qtbot, window, "found_elsewhere")
    assert panel.list.count() == 2  # nothing is lost

    window.session.open_file(str(folder / "corner.toml"))
    until(qtbot, lambda: len(drawn_walls(window)) == 2)


@pytest.mark.usefixtures("first_search_once")
def test_a_rejected_wall_is_not_found_again(qtbot: QtBot, window: MainWindow) -> None:
    panel = window.finding
    find(qtbot, window)
    until(qtbot, lambda: len(drawn_walls(window)) == 2)
    row = next(row for row, ends in enumerate(drawn_walls(window)) if away(ends, EAST).max() < 0.03)
    click_row(qtbot, window, row)
    qtbot.mouseClick(panel.reject, LEFT)
    until(qtbot, lambda: len(drawn_walls(window)) == 1)
    assert panel.list.count() == 1
    assert not panel.plan.isEnabled()  # the result is not whole
    qtbot.mouseClick(panel.go_on, LEFT)
    until(qtbot, lambda: not window.session.finding.state.running)
    until(qtbot, lambda: window.session.shown.found_room is not None and len(drawn_walls(window)) >= 1)
    assert any(away(ends, NORTH).max() < 0.05 for ends in drawn_walls(window))
    assert not any(away(ends, EAST).max() < 0.05 for ends in drawn_walls(window))


@pytest.mark.usefixtures("first_search_once")
def test_the_room_is_accepted_undone_edited_and_searched_further(
    qtbot: QtBot, open_with: OpenWith, folder: Path
) -> None:
    window = open_with(scene=Scene(None, None, load_board("polaroid-6500")))
    panel, session, controller = window.finding, window.session, window.views.plan.drawing.controller
    add_scans(qtbot, window, folder / "a.mcap")
    assert "Scans: 1" in panel.scans.text()
    assert "One place alone does not determine a room" in panel.scans.text()
    session.scans.open(str(folder / "b.mcap"))
    until(qtbot, lambda: "Scans: 2" in panel.scans.text())
    assert "One place alone" not in panel.scans.text()
    find(qtbot, window)
    qtbot.mouseClick(panel.accept, LEFT)
    room = session.shown.scene.room
    assert room.name == "Found room"
    assert session.shown.scene.place.position == pytest.approx((0.8, 0.7))  # of scan a, whose place is exact
    assert window.commands.undo.text() == "Undo accepting the found room"
    until(qtbot, lambda: not panel.accept.isEnabled() and session.shown.outline is not None)
    keep_pictures(qtbot, window, "found_accepted")
    qtbot.keyClick(window, Qt.Key.Key_Z, CONTROL)
    assert session.shown.scene.room is None
    until(qtbot, panel.accept.isEnabled)
    qtbot.keyClick(window, Qt.Key.Key_Z, CONTROL | Qt.KeyboardModifier.ShiftModifier)
    assert session.shown.scene.room is room

    east = next(k for k, wall in enumerate(room.walls) if away(wall.reshape(2, 2), EAST).max() < 0.03)
    controller.choose_surface(room.names[east])
    controller.remove_chosen()
    assert len(session.shown.scene.room.walls) == 1
    qtbot.mouseClick(panel.go_on, LEFT)
    until(qtbot, lambda: not session.finding.state.running)
    until(qtbot, lambda: not any(away(ends, EAST).max() < 0.05 for ends in drawn_walls(window)))
    assert any(away(ends, NORTH).max() < 0.05 for ends in drawn_walls(window))


def test_a_cancelled_search_keeps_its_walls(qtbot: QtBot, window: MainWindow) -> None:
    panel = window.finding
    qtbot.mouseClick(panel.begin, LEFT)
    until(qtbot, lambda: panel.list.count() > 0)
    assert panel.cancel.isVisible()
    qtbot.mouseClick(panel.cancel, LEFT)
    assert not window.session.finding.state.running
    assert panel.list.count() > 0
    assert panel.begin.isEnabled()
    assert panel.go_on.isEnabled()
    assert not panel.accept.isEnabled()  # walls are not refined, and have no standard deviations
    assert not panel.progress.isVisible()


def test_a_window_closes_while_processes_search(
    qtbot: QtBot, window: MainWindow, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    started: list[Processes] = []
    at_work = threading.Event()

    class Observed(Processes):
        def __init__(self, count: int, kept: object) -> None:
            super().__init__(count, kept)
            started.append(self)
            self.pids = [process.pid for process in self._processes]

        def results(self, *searched: object) -> list[object]:
            self.keep([])
            at_work.set()
            return super().results(select.select, [([], [])] * 2, searched[-1])  # waits for ever

    monkeypatch.setattr(unknown_poses, "LARGE", 0)
    monkeypatch.setattr(pool, "core_count", lambda: 2)
    monkeypatch.setattr(pool, "Processes", Observed)
    qtbot.mouseClick(window.finding.begin, LEFT)
    until(qtbot, at_work.is_set)
    assert window.close()
    assert len(started) == 1
    assert "find the room" not in [thread.name for thread in threading.enumerate()]
    for pid in started[0].pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
    assert not caplog.records


def test_what_cannot_be_searched_is_reported(qtbot: QtBot, window: MainWindow, folder: Path) -> None:
    window.session.scans.open(str(folder / "a.mcap"))
    until(qtbot, lambda: len(window.session.scans.scans) == 2)
    qtbot.mouseClick(window.finding.begin, LEFT)
    until(qtbot, lambda: "contain the same readings" in window.banner.message)
    assert not window.session.finding.state.running
    window.session.scans.remove(1)
    until(qtbot, lambda: window.banner.message == "")
    window.session.showing.edit(*with_board(window.session.shown.scene, load_board("hc-sr04")))
    qtbot.mouseClick(window.finding.begin, LEFT)
    until(qtbot, lambda: "is of board 'hc-sr04'" in window.banner.message)
    window.session.showing.undo()
    until(qtbot, lambda: window.banner.message == "")


def test_a_place_that_is_off_is_found_with_the_room(qtbot: QtBot, open_with: OpenWith, folder: Path) -> None:
    window = open_with(scene=Scene(None, None, load_board("polaroid-6500")))
    # in a room that is 25 mm off, so that the place of scan b is off in that of scan a
    off = np.array([0.02, -0.015])
    (folder / "off.toml").write_text(CORNER.replace("2.0", str(2.0 + off[0])).replace("1.6", str(1.6 + off[1])))
    command = ["simulate", str(folder / "off.toml"), "--place", "b", "--step", "10"]
    assert run([*command, "--out", str(folder / "off.mcap")]) == 0
    add_scans(qtbot, window, folder / "a.mcap", folder / "off.mcap")
    panel, true = window.finding, np.array([1.3 - off[0] - 0.8, 0.5 - off[1] - 0.7])  # from a to b
    assert between(find(qtbot, window)) == pytest.approx(np.array([0.5, -0.2]))  # exact places stay
    panel.places.setCurrentText("within 3 cm and 2°")
    assert between(find(qtbot, window)) == pytest.approx(true, abs=0.012)


def test_an_unknown_place_is_not_used(qtbot: QtBot, window: MainWindow) -> None:
    """`test_room_finding.py` finds such places."""
    window.finding.places.setCurrentText("unknown but for the first")
    qtbot.mouseClick(window.finding.begin, LEFT)
    finding = window.session.finding
    until(qtbot, lambda: finding.state.hypotheses is not None)
    found = finding.state.hypotheses
    qtbot.mouseClick(window.finding.cancel, LEFT)
    assert [scan.name for scan in found.scans] == ["a"]
    assert [place.position for place in found.draft.places] == [(0.8, 0.7)]


def test_headings_alone_can_be_known(qtbot: QtBot, window: MainWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[object] = []

    def search(_scans: object, _board: object, _air: object, spreads: object, *_: object) -> None:
        given.append(spreads)
        raise InputError("enough is known")

    monkeypatch.setattr(unknown_poses, "find_room_and_poses", search)
    window.finding.places.setCurrentText("only headings, within 5°")
    qtbot.mouseClick(window.finding.begin, LEFT)
    until(qtbot, lambda: "enough is known" in window.banner.message)
    assert given == [[PoseSpread(), PoseSpread(math.inf, math.radians(5))]]


@pytest.mark.usefixtures("first_search_once")
def test_possible_poses_and_scans_left_out_are_stated(
    qtbot: QtBot, window: MainWindow, known: list[RoomAnswer], monkeypatch: pytest.MonkeyPatch
) -> None:
    find(qtbot, window)
    assert not window.finding.poses.isVisible()  # both places are known
    several = tuple(
        Pose(at, math.radians(turn), 0.0, share, (0.01,) * 3)
        for at, turn, share in (((1.3, 0.5), 0.0, 0.64), ((0.7, 1.1), 180.0, 0.36))
    )
    found = replace(known[0], result=replace(known[0].result, poses={"b": several}, left_out=("c",)))
    monkeypatch.setattr(window.session.finding, "_function", lambda *_: found)
    find(qtbot, window)
    assert window.finding.poses.isVisible()
    assert window.finding.poses.text() == (
        "b: 64% at x 1.300 m, y 0.500 m, 0.0°; 36% at x 0.700 m, y 1.100 m, 180.0°\n"
        "⚠ c is left out: its pose was not found."
    )
    keep_pictures(qtbot, window, "found_poses")


def between(states: list[FindState]) -> np.ndarray:
    """Return the way from the first place of a found room to the second, (2,) m."""
    assert states[-1].answer is not None
    first, second = (place.position for place in states[-1].answer.result.draft.places)
    return np.subtract(second, first)
