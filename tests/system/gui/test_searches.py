"""Searches and their panels: the fit, causes of misfits, the room that scans show, and several scans at once."""

import itertools
import math
import os
import re
import select
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPoint
from PySide6.QtWidgets import QFileDialog, QGraphicsTextItem, QListWidget, QStyle, QStyleOptionViewItem
from sonarhw_cli.app import run
from sonarhw_compare import processes as pool
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.match import Kind
from sonarhw_compare.processes import Processes
from sonarhw_compare.rooms import outcome
from sonarhw_compare.rooms import search as unknown_poses
from sonarhw_compare.two_scans import ScanChange
from sonarhw_gui.jobs import searches
from sonarhw_gui.jobs.searches import ACCURACIES, FindState, RoomAnswer, fitted
from sonarhw_gui.model.edits import sensor_at
from sonarhw_gui.model.rows import CLASSES
from sonarhw_gui.model.scene import Scene, scene_with
from sonarhw_gui.model.shown import SHOWN
from sonarhw_gui.session.session import WindowSession
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

import sonarhw
from sonarhw.errors import InputError
from sonarhw.log import LogMetadata, read_log
from sonarhw.log.writer import write_scan
from tests.checkout import CHECKOUT
from tests.fixtures.rooms_for_tests import write_yard
from tests.system.gui.conftest import OpenSession, OpenWith
from tests.system.gui.driving import keep_pictures, key, log_name, predicted, push, until

EXACT = ACCURACIES["exact"]


def click_row(rows: QListWidget, row: int) -> None:
    push(rows.viewport(), rows.visualItemRect(rows.item(row)).center() + QPoint(0, 1))


# the fit


@pytest.fixture
def beside(scene: Scene) -> Scene:
    """Figure 9 with the sensor 12 cm and 9° away from its true pose."""
    moved, _ = sensor_at(scene, (0.69, 0.17))
    return replace(moved, place=replace(moved.place, heading=math.radians(9)))


def test_a_pose_is_found_and_accepted(open_with: OpenWith, recorded: Path, scene: Scene, beside: Scene) -> None:
    window = open_with(scene=beside, source=read_log(recorded))
    key(window, "F9")
    panel, session, fitting = window.fit_panel, window.session, window.session.fitting
    until(panel.isVisible)
    checked = [box for box in panel.free.values() if box.isChecked()]
    for _ in range(2):  # without a free parameter no fit can start
        for box in checked:
            box.setFocus()
            key(box, "Space")
        assert panel.begin.isEnabled() is checked[0].isChecked()
    push(panel.begin)
    until(panel.cancel.isVisible)
    assert not panel.begin.isEnabled()
    push(panel.cancel)
    assert (panel.cancel.isVisible(), panel.begin.isEnabled(), fitting.state.answer) == (False, True, None)

    push(panel.begin)
    until(lambda: fitting.state.answer is not None)
    assert panel.accept.isVisible()
    until(lambda: panel.accept.visibleRegion().boundingRect().height() == panel.accept.height())  # scrolled to
    # a position has the unit of its deviation, because m beside mm is misread
    assert len(re.findall(r"\d mm</td><td>&nbsp;&nbsp;± [\d.]+ mm", panel.table.text())) >= 2
    assert "within 5 cm: " in panel.notes.text()
    found = fitting.state.answer
    assert found.within_5cm < 0.7 < found.fitted_within_5cm[0]
    place = fitted(beside, found.solutions[0], beside.board)[0].place
    assert place.position == pytest.approx(scene.pose.position, abs=0.005)
    assert abs(math.remainder(place.heading - scene.pose.heading, math.tau)) < math.radians(1)
    drawn = session.shown.proposal  # the pose, before it is accepted
    assert drawn.posts[0, :2] == pytest.approx(place.position, abs=1e-9)
    along = drawn.walls[0, 2:] - drawn.walls[0, :2]
    assert math.atan2(*along[::-1]) == pytest.approx(math.remainder(place.heading, math.tau), abs=1e-9)
    keep_pictures(window, "found_pose")
    push(panel.discard)
    assert not panel.accept.isVisible()
    assert (session.shown.scene, session.shown.proposal) == (beside, None)

    key(panel.where, "Down")  # the whole room, which is symmetric
    push(panel.begin)
    until(lambda: fitting.state.answer is not None)
    assert panel.solutions.isVisible()
    assert panel.solutions.count() == 2
    assert "the room may be symmetric" in panel.notes.text()
    assert "°" not in panel.notes.text()  # both poses are in the list, with headings as everywhere in the window
    key(panel.solutions, "Down")
    assert "± " not in panel.table.text()
    push(panel.accept)
    wide, deep = scene.room.walls.reshape(-1, 2).max(axis=0)
    (x, y), heading, place = scene.pose.position, scene.pose.heading, session.shown.scene.pose
    poses = [((x, y), heading), ((wide - x, deep - y), heading + math.pi)]
    at, heading = min(poses, key=lambda pose: math.dist(pose[0], place.position))
    assert place.position == pytest.approx(at, abs=0.01)
    assert abs(math.remainder(place.heading - heading, math.tau)) < math.radians(2)
    assert not panel.accept.isVisible()
    assert (window.commands.undo.text(), session.shown.proposal) == ("Undo finding the pose", None)
    key(window, "Ctrl+Z")
    assert session.shown.scene is beside

    push(panel.begin)
    session.leave_replay()  # other readings
    assert not fitting.state.running
    assert (panel.begin.isEnabled(), panel.cancel.isVisible()) == (False, False)


def test_a_scan_with_angles_read_the_wrong_way_is_read_again_and_found(open_with: OpenWith, tmp_path: Path) -> None:
    corners = [[0, 0], [1.6, 0], [1.6, 0.7], [0.9, 0.7], [0.9, 1.2], [0, 1.2]]
    room, board = sonarhw.room_from_arrays(corners, places={"here": (0.4, 0.4)}), load_board("lego-nxt")
    angles = np.radians(np.arange(0.0, 360.0, 10.0))
    ranges = sonarhw.predict_ranges(room, [(0.55, 0.5, 1.7)], angles, board)[0]
    scan = sonarhw.scan_from_arrays(-angles[::-1], ranges[::-1])
    metadata = LogMetadata("import", 1e9, "room.toml", room.text, board=board.name, board_text=board.text)
    write_scan(tmp_path / "scan.mcap", metadata, scan.readings)
    window = open_with(scene=scene_with(board, room, room.place("here"), "room.toml"))
    session, panel, fitting = window.session, window.fit_panel, window.session.fitting
    session.open_file(str(tmp_path / "scan.mcap"))
    until(lambda: len(session.shown.readings) == len(angles))
    window.find_pose_anywhere()
    until(lambda: fitting.state.answer is not None)
    assert "probably read wrongly: with clockwise angles" in panel.notes.text()
    push(panel.reread)
    until(lambda: Path(session.log_file).parent.name == "recordings")
    until(lambda: fitting.state.running)  # the pose of the new log
    read = {round(math.degrees(one.angle)) % 360: one.range for one in session.shown.readings}
    assert [read[round(math.degrees(angle))] for angle in angles] == pytest.approx(ranges.tolist(), abs=1e-5)


# causes of misfits


def test_a_missing_plate_is_found_and_tried(open_with: OpenWith, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = write_yard(tmp_path_factory.mktemp("yard")).parent
    room = load_room(folder / "yard.toml")
    scene = scene_with(load_board("polaroid-6500"), room, room.place(None), "yard.toml")
    window = open_with(scene=scene, source=read_log(folder / "scan.mcap"))
    panel, session, plan = window.causes, window.session, window.views.plan.drawing

    def share() -> float:
        """Return how many more percent of the echoes are within 5 cm now, as the panel says."""
        before, now = (float(part.split("%")[0].split()[-1]) for part in panel.shares.text().split(","))
        return now - before

    until(lambda: predicted(window))
    key(window, "F11")
    until(panel.isVisible)
    push(panel.begin)
    push(panel.cancel)
    assert (panel.begin.isEnabled(), session.causes.state.answer, panel.list.isVisible()) == (True, None, False)
    push(panel.begin)
    assert panel.progress.isVisible()
    until(lambda: session.causes.state.answer is not None)
    assert "a wall" in panel.list.item(0).text()
    assert panel.try_it.isEnabled()  # the cause is selected and drawn without a click
    until(lambda: session.shown.proposal is not None and len(plan.proposal.rings.getData()[0]) > 0)
    cause, rows = session.causes.state.answer.result.causes[0], session.shown.rows
    misfits = [row for row in cause.readings if CLASSES[rows.classes[row]] is not Kind.MATCH]
    session.showing.choose(next(row for row in range(len(rows.classes)) if row not in misfits))
    click_row(panel.list, 0)
    assert session.shown.chosen == misfits[0]
    assert len(plan.proposal.rings.getData()[0]) == len(misfits)
    assert plan.proposal.surfaces.getData()[0][0] == pytest.approx(0.8, abs=0.02)  # of the plate
    keep_pictures(window, "causes")

    push(panel.try_it)
    assert session.shown.scene.room.names[-1] == "wall 1"
    assert window.commands.undo.text() == "Undo trying a cause"
    until(lambda: predicted(window) and share() > 10)
    assert not panel.try_it.isEnabled()
    assert panel.list.item(0).text().endswith("tried")
    push(panel.undo)
    assert session.shown.scene is scene
    until(panel.try_it.isEnabled)
    panel.list.setFocus()
    key(panel.list, "Return")
    until(lambda: session.shown.scene is not scene)


# the room that scans show

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
Line = tuple[tuple[float, float], tuple[float, float]]
EAST, NORTH = ((2.0, 0.0), (0.0, 1.0)), ((0.2, 1.6), (1.0, 0.0))  # a point of each wall, and its direction


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write scans of a corner at two places, and one of place b in a corner 25 mm off."""
    folder = tmp_path_factory.mktemp("corner")
    (folder / "corner.toml").write_text(CORNER)
    (folder / "off.toml").write_text(CORNER.replace("2.0", "2.02").replace("1.6", "1.585"))
    for room, place, log in (("corner", "a", "a"), ("corner", "b", "b"), ("off", "b", "off")):
        command = ["simulate", str(folder / f"{room}.toml"), "--place", place, "--step", "10", "--out"]
        assert run([*command, str(folder / f"{log}.mcap")]) == 0
    return folder


@pytest.fixture(scope="module")
def known() -> list[RoomAnswer]:
    return []


@pytest.fixture
def first_search_once(monkeypatch: pytest.MonkeyPatch, known: list[RoomAnswer]) -> None:
    """Answer a first search in scans a and b at once if another test has completed it."""
    search = searches.search_room

    def search_room(scans: Any, air: Any, accuracy: Any, start: object, *rest: Any) -> RoomAnswer:
        if start is not None:
            return search(scans, air, accuracy, start, *rest)
        assert sorted(scan.name for scan in scans) == ["a", "b"]
        if not known:
            known.append(search(scans, air, accuracy, start, *rest))
        return replace(known[0])

    monkeypatch.setattr(searches, "search_room", search_room)


def with_scans(session: WindowSession, *logs: Path) -> WindowSession:
    """Show the first log in its room, and add the others."""
    session.open_file(str(logs[0]))
    until(lambda: log_name(session) == logs[0].name)
    return with_added(session, *logs[1:])


def with_added(session: WindowSession, *logs: Path) -> WindowSession:
    for count, log in enumerate(logs, len(session.scans.scans) + 1):
        session.scans.open(str(log))
        until(lambda count=count: len(session.scans.scans) == count and len(session.shown.overlays) == count)
    return session


@pytest.fixture
def corner(open_session: OpenSession, folder: Path) -> WindowSession:
    """A session that shows scan a in its room, with scan b added."""
    return with_scans(open_session(), folder / "a.mcap", folder / "b.mcap")


def found(session: WindowSession, accuracy: Any = EXACT) -> FindState:
    """Find the room, and return the state at the end."""
    session.finding.start(accuracy)
    until(lambda: not session.finding.state.running)
    return session.finding.state


def away(points: np.ndarray, wall: Line) -> np.ndarray:
    """Return how far points (n, 2) are from the line of a wall, m."""
    (x, y), (along_x, along_y) = wall
    return np.abs((points[:, 0] - x) * along_y - (points[:, 1] - y) * along_x)


def has_wall(state: FindState, wall: Line) -> bool:
    """Return whether a search has found a wall."""
    return any(away(ends, wall).max() < 0.05 for ends in state.hypotheses.draft.segments.reshape(-1, 2, 2))


def drawn_walls(window: MainWindow) -> list[np.ndarray]:
    """Return both ends of each wall drawn in the plan, (2, 2) m."""
    points = np.column_stack(window.views.plan.drawing.found_room.surfaces.getData())
    lines = np.split(points, np.flatnonzero(np.isnan(points[:, 0])) + 1)
    return [line[:2] for line in lines if len(line) == 3]  # longer ones are posts


def test_walls_appear_with_their_readings(open_with: OpenWith, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    window = open_with()
    panel, plan, session = window.finding, window.views.plan.drawing.found_room, window.session
    finding, legend, states = session.finding, window.legend.explained, list[FindState]()
    window.legend.more.setChecked(True)
    with_scans(session, folder / "a.mcap", folder / "b.mcap")
    until(lambda: predicted(window))
    key(window, "Ctrl+M")
    until(panel.isVisible)
    push(panel.begin)
    assert (panel.progress.isVisible(), panel.begin.isEnabled()) == (True, False)
    until(lambda: panel.list.count() > 0)
    push(panel.cancel)  # keeps its walls
    assert panel.list.count() > 0
    assert panel.begin.isEnabled()
    assert panel.go_on.isEnabled()
    # walls are not refined, and have no standard deviations
    assert not any((finding.state.running, panel.accept.isEnabled(), panel.progress.isVisible()))

    finding.changed.connect(states.append)
    push(panel.begin)
    until(lambda: not finding.state.running)
    finding.changed.disconnect(states.append)
    on_the_way = [len(one.hypotheses.supports) for one in states if one.running and one.hypotheses is not None]
    assert {1, 2} <= set(on_the_way)
    assert on_the_way == sorted(on_the_way)
    assert not panel.poses.isVisible()  # both places are known

    # against the walls of the room in which the scans were simulated
    assert panel.list.count() == 2
    walls = states[-1].hypotheses.draft.segments.reshape(-1, 2, 2)  # of the result; before it, others are drawn
    until(lambda: len(drawn_walls(window)) == len(walls) == 2 and np.allclose(drawn_walls(window), walls))
    for row, ends in enumerate(drawn_walls(window)):
        (wall,) = (wall for wall in (EAST, NORTH) if away(ends, wall).max() < 0.03)
        click_row(panel.list, row)
        until(lambda ends=ends: np.array_equal(np.column_stack(plan.chosen.getData())[:2], ends))
        said = int(panel.list.item(row).text().split("\n")[1].split(" readings for")[0])
        rings = np.column_stack(plan.rings.getData())
        assert 0 < len(rings) <= said
        assert legend["wall found"].isVisible()
        assert legend["for it"].isVisible()
        assert np.median(away(rings, wall)) < 0.05  # the others are in the margins of the beam, and ghosts
    keep_pictures(window, "found")
    item = panel.list.item(1)
    size = panel.list.visualItemRect(item)
    item.setText(f"{'post 1 · radius 0.150 m · ± 13.4 mm, ± 13.4 mm ' * 3}\n{item.text()}")  # wrapped, not cut
    taller = panel.list.visualItemRect(item)
    assert (taller.height() - size.height()) / panel.list.fontMetrics().height() > 1.9
    assert taller.width() <= panel.list.viewport().width()

    tried, held, predict = itertools.count(), threading.Event(), outcome.predict_scan

    def held_after_ten(*scene: object) -> object:
        if next(tried) == 10:
            held.wait(60.0)
        return predict(*scene)

    with monkeypatch.context() as patch:
        patch.setattr(outcome, "predict_scan", held_after_ten)
        push(panel.plan)
        until(lambda: finding.state.share > 0.1 and plan.next_scan.isVisible())
        assert (finding.state.running, panel.progress.isVisible()) == ("planning", True)
        assert panel.next.text().startswith("Best so far, while other places are tried: scan next at x ")
        keep_pictures(window, "next_so_far")
        held.set()
        until(lambda: not finding.state.running and panel.next.text().startswith("Scan next at x "))
    best = finding.state.places[0]
    assert f"x {best.position[0]:.3f} m, y {best.position[1]:.3f} m: gain {best.gain:.1f} nats" in panel.next.text()
    until(lambda: np.column_stack(plan.next_scan.getData()) == pytest.approx(np.array([best.position])))
    push(panel.plan)
    push(panel.cancel)
    keep_pictures(window, "next_scan")

    # walls are not drawn in another room, nor while the panel is closed
    session.open_file(str(CHECKOUT / "rooms" / "corridor.toml"))
    until(lambda: session.shown.scene.room_file == "corridor.toml" and not drawn_walls(window))
    assert not legend["wall found"].isVisible()
    assert "another room" in panel.note.text()
    keep_pictures(window, "found_elsewhere")
    assert panel.list.count() == 2  # nothing is lost
    session.open_file(str(folder / "corner.toml"))
    until(lambda: len(drawn_walls(window)) == 2)
    key(window, "Ctrl+M")
    until(lambda: not plan.surfaces.isVisible() and not plan.next_scan.isVisible())
    assert not any(legend[name].isVisible() for name in ("wall found", "for it", "against it"))


@pytest.mark.usefixtures("first_search_once")
def test_the_room_is_accepted_undone_edited_and_searched_further(open_with: OpenWith, folder: Path) -> None:
    window = open_with(scene=Scene(None, None, load_board("polaroid-6500")))
    panel, session, controller = window.finding, window.session, window.views.plan.drawing.controller
    key(window, "Ctrl+M")
    with_added(session, folder / "a.mcap")
    until(lambda: "Scans: 1" in panel.scans.text())
    assert "One place alone does not determine a room" in panel.scans.text()
    with_added(session, folder / "b.mcap")
    until(lambda: "Scans: 2" in panel.scans.text())
    assert "One place alone" not in panel.scans.text()
    push(panel.begin)
    until(lambda: not session.finding.state.running)
    push(panel.accept)
    room = session.shown.scene.room
    assert room.name == "Found room"
    assert session.shown.scene.place.position == pytest.approx((0.8, 0.7))  # of scan a, whose place is exact
    assert window.commands.undo.text() == "Undo accepting the found room"
    until(lambda: not panel.accept.isEnabled() and session.shown.outline is not None)
    keep_pictures(window, "found_accepted")
    key(window, "Ctrl+Z")
    assert session.shown.scene.room is None
    until(panel.accept.isEnabled)
    key(window, "Ctrl+Shift+Z")
    assert session.shown.scene.room is room

    east = next(k for k, wall in enumerate(room.walls) if away(wall.reshape(2, 2), EAST).max() < 0.03)
    controller.choose_surface(room.names[east])
    controller.remove_chosen()
    push(panel.go_on)
    until(lambda: not session.finding.state.running)
    assert (has_wall(session.finding.state, EAST), has_wall(session.finding.state, NORTH)) == (False, True)


@pytest.mark.usefixtures("first_search_once")
def test_a_rejected_wall_is_not_found_again(corner: WindowSession) -> None:
    state, finding = found(corner), corner.finding
    walls = state.hypotheses.draft.segments.reshape(-1, 2, 2)
    finding.reject(next(row for row, ends in enumerate(walls) if away(ends, EAST).max() < 0.03))
    assert len(finding.state.hypotheses.supports) == 1
    assert not finding.state.whole
    finding.go_on(EXACT)
    until(lambda: not finding.state.running)
    assert (has_wall(finding.state, EAST), has_wall(finding.state, NORTH)) == (False, True)


def test_places_are_as_well_known_as_the_user_says(
    open_session: OpenSession, corner: WindowSession, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def between(state: FindState) -> np.ndarray:
        """Return the way from the first place of a found room to the second, (2,) m."""
        first, second = (place.position for place in state.answer.result.draft.places)
        return np.subtract(second, first)

    # the room of the second scan is 25 mm off, so that its place is off in that of the first
    off = with_added(
        open_session(scene=Scene(None, None, load_board("polaroid-6500"))), folder / "a.mcap", folder / "off.mcap"
    )
    assert between(found(off)) == pytest.approx(np.array([0.5, -0.2]))  # exact places stay
    true = np.array([1.3 - 0.02 - 0.8, 0.5 + 0.015 - 0.7])
    assert between(found(off, ACCURACIES["within 3 cm and 2°"])) == pytest.approx(true, abs=0.012)

    corner.finding.start(ACCURACIES["unknown but for the first"])  # `test_room_finding.py` finds such places
    until(lambda: corner.finding.state.hypotheses is not None)
    hypotheses = corner.finding.state.hypotheses
    corner.finding.cancel()
    assert [scan.name for scan in hypotheses.scans] == ["a"]
    assert [place.position for place in hypotheses.draft.places] == [(0.8, 0.7)]

    given: list[object] = []

    def search(_scans: object, _board: object, _air: object, spreads: object, *_: object) -> None:
        given.append(spreads)
        raise InputError("enough is known")

    monkeypatch.setattr(unknown_poses, "find_room_and_poses", search)
    corner.finding.start(ACCURACIES["only headings, within 5°"])
    until(lambda: "enough is known" in corner.notices.shown.text)
    assert given == [[PoseSpread(), PoseSpread(math.inf, math.radians(5))]]


def test_a_session_closes_while_processes_search(
    corner: WindowSession, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
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
    corner.finding.start(EXACT)
    until(at_work.is_set)
    corner.close()  # open_session checks that no thread is left
    assert len(started) == 1
    for pid in started[0].pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
    assert not caplog.records


# several scans


@pytest.fixture(scope="module")
def posts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write scans from before and after a post was put up."""
    folder = tmp_path_factory.mktemp("scans")
    post = '[[posts]]\nname = "chair"\ncenter = [0.3, 0.4]\nradius = 0.03\nmaterial = "shelving"\n'
    (folder / "with_post.toml").write_text((CHECKOUT / "rooms" / "simple.toml").read_text() + post)
    for room, log in (("simple", "before"), (str(folder / "with_post.toml"), "after")):
        command = ["simulate", room, "--place", "figure9", "--step", "5", "--out", str(folder / f"{log}.mcap")]
        assert run(command) == 0
    return folder


def test_a_scan_is_compared_with_one_from_before_a_post_was_put_up(open_with: OpenWith, posts: Path) -> None:
    window = open_with(source=read_log(posts / "after.mcap"))
    panel, session, view = window.scans, window.session, window.views.differences
    plan, ranges = window.views.plan.drawing.overlays, window.views.ranges.overlays
    until(lambda: predicted(window))
    key(window, "F12")
    until(panel.isVisible)

    # without a second scan, a sentence instead of empty axes
    next(one for one in window.views.openers if one.text() == "Differences").trigger()
    until(view.isVisible)
    texts = (item for item in view.canvas.scene().items() if isinstance(item, QGraphicsTextItem))
    sentence = next(item for item in texts if item.isVisible())

    def axes() -> list[bool]:
        return [view.plot.getAxis(side).isVisible() for side in ("left", "bottom")]

    assert sentence.toPlainText().startswith("No scan to compare with: ")
    assert view.canvas.sceneRect().contains(sentence.sceneBoundingRect())
    assert axes() == [False, False]
    push(panel.keep)
    until(lambda: axes() == [True, True])
    assert not sentence.isVisible()
    assert "same" in view.summary.text()
    push(panel.remove)
    until(lambda: sentence.isVisible() and axes() == [False, False])

    push(panel.add)
    until(lambda: any(one.isVisible() for one in window.findChildren(QFileDialog)))
    (dialog,) = (one for one in window.findChildren(QFileDialog) if one.isVisible())
    dialog.selectFile(str(posts / "before.mcap"))
    dialog.accept()
    until(lambda: panel.list.count() == 1)
    shown = session.shown
    assert session.scans.pair == (0, SHOWN)
    until(lambda: bool(session.shown.overlays))
    style = session.shown.overlays[0].style
    until(lambda: plan.scatters[style].isVisible() and ranges.scatters[style].isVisible())
    # the plan shows its echoes from the same place: 36 of 72 are those of the scan shown
    sensor = np.array(shown.scene.pose.position)
    far = np.hypot(*(np.column_stack(plan.scatters[style].getData()) - sensor).T)
    before = [reading.range for reading in read_log(posts / "before.mcap").readings if reading.range is not None]
    assert sorted(far) == pytest.approx(sorted(before), abs=1e-6)
    until(lambda: view.difference is not None and view.difference.changes[ScanChange.NEARER] > 20)
    assert view.difference.changes[ScanChange.FARTHER] == 0
    assert f"{view.difference.changes[ScanChange.NEARER]} nearer" in view.summary.text()
    keep_pictures(window, "scans")

    item = QStyleOptionViewItem()  # the check box of the scan hides it
    panel.list.initViewItemOption(item)
    item.rect = panel.list.visualItemRect(panel.list.item(0))
    item.features |= QStyleOptionViewItem.ViewItemFeature.HasCheckIndicator
    box = panel.list.style().subElementRect(QStyle.SubElement.SE_ItemViewItemCheckIndicator, item, panel.list)
    push(panel.list.viewport(), box.center() + QPoint(1, 0))
    until(lambda: not plan.scatters[style].isVisible() and not ranges.scatters[style].isVisible())

    panel.first.setFocus()  # the other way round, with keys
    key(panel.first, "Up")
    key(panel.second, "Down")
    until(lambda: view.difference is not None and view.difference.changes[ScanChange.FARTHER] > 20)
    push(panel.remove)
    until(lambda: view.difference is None and panel.list.count() == 0)
    push(panel.keep)  # a kept scan stays when another log is opened
    session.open_file(str(posts / "before.mcap"))
    until(lambda: log_name(window) == "before.mcap" and predicted(window))
    until(lambda: view.difference is not None and view.difference.changes[ScanChange.FARTHER] > 20)
