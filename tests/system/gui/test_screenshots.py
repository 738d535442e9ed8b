"""Pictures of the window in the demo room that docs/screenshots contains: views, panels, a live scan, a replay.

With --soak. SONARHW_SCREENSHOTS=FOLDER writes them to a folder, in both palettes and two sizes; without it, they are
taken in one look. QT_SCALE_FACTOR=2 takes them at 200 %. docs/how_to/window.md explains them.
"""

import io
import os
from dataclasses import replace
from math import radians
from pathlib import Path

import pytest
from PIL import Image
from PySide6.QtCore import QBuffer, Qt
from PySide6.QtWidgets import QWidget
from sonarhw_cli.app import run
from sonarhw_gui.model.look import DARK, LIGHT, Palette
from sonarhw_gui.model.scene import Scene, scene_of_log
from sonarhw_gui.session.scanner import ScanSettings
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.room_echoes import RoomEchoes
from sonarhw_sim.room.room import load_room

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import Pace, serve
from sonarhw.host.scanner import Scanner
from sonarhw.log import read_log
from sonarhw.readings import ScanOrder
from tests.fixtures.window_scan import recorded_scan
from tests.fixtures.window_scene import ROOM
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import dialog_of, ended, pause, predicted, until

FOLDER = os.environ.get("SONARHW_SCREENSHOTS")
SMALL, LARGE = (1280, 800), (1920, 1080)
LOOKS = [(LIGHT, SMALL)] if FOLDER is None else [(paper, size) for size in (SMALL, LARGE) for paper in (LIGHT, DARK)]
EXAMPLE = ROOM.parents[1] / "examples" / "turret.csv"
HEADINGS = 120
ORDER = ScanOrder(0.0, radians(3), HEADINGS, sweeps=2)  # the second sweep leaves time for the picture of the first one
LIVE_UP_TO = 84  # readings in the picture of the running scan
SELECTED, SELECTED_LIVE, SELECTED_FOR_TRACE = 38, 74, 74  # the readings that the pictures explain
# shares of the views on the right
TRACE, PANEL = (500, 120, 60), (60, 60, 600)
pytestmark = pytest.mark.soak


class Album:
    """A folder of pictures NAME.png. The name includes palette, size and scale if they are not the default."""

    def __init__(self, folder: Path, paper: Palette, size: tuple[int, int]) -> None:
        self._folder, self._dark, self._size = folder, paper is DARK, size

    def keep(self, part: QWidget, name: str) -> None:
        """Save a picture of a window or a dialog in 256 colours, which takes a third of the space."""
        if isinstance(part, MainWindow):
            part.turns.all_now()  # during a scan, each view waits for its turn
        image, scale = part.grab().toImage(), part.devicePixelRatioF()
        if part.isWindow() and isinstance(part, MainWindow):
            assert (image.width(), image.height()) == tuple(round(scale * length) for length in self._size)
        unusual = {"-dark": self._dark, f"-{self._size[0]}": self._size != SMALL, f"-at-{100 * scale:.0f}": scale != 1}
        kept = QBuffer()
        kept.open(QBuffer.OpenModeFlag.WriteOnly)
        assert image.save(kept, "PNG")
        self._folder.mkdir(parents=True, exist_ok=True)
        few = in_few_colours(Image.open(io.BytesIO(kept.data().data())).convert("RGB"))
        few.save(self._folder / f"{name}{''.join(word for word in unusual if unusual[word])}.png", optimize=True)


def in_few_colours(picture: Image.Image) -> Image.Image:
    """Reduce a picture to 256 colours: the 128 most frequent ones unchanged, and 128 for the rest."""
    counts = sorted(picture.getcolors(picture.width * picture.height), reverse=True)
    exact = [colour for _, colour in counts[:128]]
    rest = picture.quantize(128, Image.Quantize.MAXCOVERAGE).getpalette()
    palette = Image.new("P", (1, 1))
    palette.putpalette([*(value for colour in exact for value in colour), *rest])
    return picture.quantize(palette=palette, dither=Image.Dither.NONE)


@pytest.fixture(params=LOOKS, ids=lambda look: f"{look[0].name}-{look[1][0]}")
def look(request: pytest.FixtureRequest) -> tuple[Palette, tuple[int, int]]:
    return request.param


@pytest.fixture
def album(look: tuple[Palette, tuple[int, int]], tmp_path: Path) -> Album:
    return Album(Path(FOLDER or tmp_path), *look)


@pytest.fixture
def at_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a recordings folder below a temporary home folder, which the status bar shows as ~."""
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    return tmp_path / ".local" / "share" / "sonarhw" / "recordings"


@pytest.fixture(scope="module")
def bench() -> Scene:
    """Return the laboratory. If no picture is saved, the small room: it takes half of the time."""
    name, place = ("laboratory", "bench") if FOLDER else ("simple", "figure9")
    room = load_room(name)
    return Scene(room, room.place(place), load_board("polaroid-6500"), f"{name}.toml")


@pytest.fixture(scope="module")
def echoes(bench: Scene) -> RoomEchoes:
    echoes = RoomEchoes(bench.room, bench.place, bench.board, seed=1)
    echoes.prepare()
    return echoes


def fake(echoes: RoomEchoes, scene: Scene) -> FakeBoard:
    return FakeBoard(echoes, 1, scene.board.blanking)


@pytest.fixture(scope="module")
def scan(bench: Scene, echoes: RoomEchoes, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record a log of one full turn with traces."""
    settings = ScanSettings(tmp_path_factory.mktemp("scans"), replace(ORDER, sweeps=1))
    return recorded_scan(fake(echoes, bench), bench, settings)


def with_look(window: MainWindow, look: tuple[Palette, tuple[int, int]]) -> MainWindow:
    paper, size = look
    window.session.showing.set_look(replace(window.session.shown.look, palette=paper))
    window.resize(*size)
    return window


def traced(window: MainWindow) -> bool:
    """Return whether the sentence and the trace of the selected reading are shown."""
    shown = window.session.shown
    return (
        shown.chosen_row is not None and shown.trace is not None and shown.trace.heading == shown.heading(shown.chosen)
    )


def share(window: MainWindow, sizes: tuple[int, int, int]) -> None:
    """Set the shares of the height of the views on the right."""
    docks = window.views.docks[: len(sizes)]
    whole = sum(dock.height() for dock in docks)
    window.views.resizeDocks(docks, [round(part * whole / sum(sizes)) for part in sizes], Qt.Orientation.Vertical)


def dock(window: MainWindow, name: str) -> None:
    """Open one panel only, and wait for the layout."""
    for action in window.dock_openers:
        if action.isChecked() != (action.text() == name):
            action.trigger()
    pause(200)


def test_pictures_of_the_demo_live_and_in_replay(
    open_with: OpenWith,
    album: Album,
    look: tuple[Palette, tuple[int, int]],
    bench: Scene,
    echoes: RoomEchoes,
    at_home: Path,
) -> None:
    # saved pictures are taken at the pace of a real board
    pace: Pace = "real" if FOLDER else 4.0
    order = ORDER if FOLDER else replace(ORDER, sweeps=1000)  # stopped early
    with serve(fake(echoes, bench), tcp="127.0.0.1:0", pace=pace) as endpoint:
        window = open_with(scene=bench, order=order, source=lambda: Scanner.open(endpoint.url), recordings=at_home)
        with_look(window, look)
        until(lambda: predicted(window))
        window.commands.scan.trigger()
        until(lambda: len(window.session.shown.readings) >= LIVE_UP_TO)
        window.session.showing.choose(SELECTED_LIVE)
        window.commands.fit.trigger()  # far readings have extended the visible range
        # on a busy machine, the board may have been away for a moment
        until(lambda: traced(window) and window.status_bar.badge.text() == "● live")
        album.keep(window, "live")
        dock(window, "Device")
        until(lambda: window.session.shown.readings[-1].angle < radians(3 * (HEADINGS - 1)))
        album.keep(window, "device")
        dock(window, "")
        until(lambda: len(window.session.shown.readings) >= HEADINGS)
        window.commands.stop.trigger()
        until(lambda: ended(window))
        recording = window.session.status.job.recording
        window.close()
    replay = open_with(scene=bench, source=read_log(recording), source_name=recording.name)
    with_look(replay, look)
    until(lambda: predicted(replay))
    replay.session.replay.seek(0.75 * replay.session.replay.duration)
    replay.session.showing.choose(SELECTED)
    replay.session.replay.toggle()
    until(lambda: replay.status_bar.badge.text() == "replay" and replay.session.status.rate > 0)
    until(lambda: traced(replay))
    album.keep(replay, "replay")


def test_pictures_of_views_panels_and_import(
    open_with: OpenWith, album: Album, look: tuple[Palette, tuple[int, int]], bench: Scene, scan: Path
) -> None:
    window = with_look(open_with(scene=bench, source=read_log(scan), source_name="bench.mcap"), look)
    plan, beside, images = window.commands.views
    session, views = window.session, window.views
    until(lambda: predicted(window))
    session.showing.choose(SELECTED)
    until(lambda: traced(window))
    beside.trigger()
    pause(50)
    album.keep(window, "side-by-side")
    images.trigger()
    views.bscan.choices.actions()[3].trigger()
    until(lambda: session.shown.bscan is not None and not views.bscan.note.text())
    pause(200)
    album.keep(window, "bscan")
    plan.trigger()
    session.showing.choose(SELECTED_FOR_TRACE)
    until(lambda: traced(window))
    share(window, TRACE)
    pause(50)
    album.keep(window, "trace")
    dock(window, "Room")
    views.plan.drawing.controller.choose_surface(session.shown.scene.room.names[0])
    pause(50)
    album.keep(window, "room")
    views.plan.drawing.controller.choose_surface(None)
    share(window, PANEL)
    dock(window, "Fit")
    if FOLDER:  # a fit takes a while
        window.fit_panel.begin.click()
        until(window.fit_panel.accept.isVisible)
        table = window.fit_panel.table
        until(lambda: table.height() >= table.sizeHint().height())
    pause(50)
    album.keep(window, "fit")
    session.open_file(str(EXAMPLE))
    until(lambda: dialog_of(window) is not None)
    dialog = dialog_of(window)
    dialog.fields["no_echo"].setText("255")
    dialog.fields["turn"].setCurrentText("clockwise")
    until(dialog.import_button.isEnabled)
    pause(100)  # the layout follows
    album.keep(dialog, "import")
    dialog.close()


def test_picture_of_a_heading_without_a_reading(
    open_with: OpenWith, album: Album, look: tuple[Palette, tuple[int, int]], tmp_path: Path
) -> None:
    log = tmp_path / "figure9.mcap"
    assert run(["simulate", str(ROOM), "--place", "figure9", "--board", "paper", "--out", str(log)]) == 0
    opened = read_log(log)
    window = open_with(scene=scene_of_log(opened.metadata), source=opened, source_name=log.name)
    with_look(window, look)
    until(lambda: predicted(window))
    window.views.plan.drawing.plot.vb.setRange(yRange=(-0.85, 0.8), padding=0)  # a reading is beyond the wall
    echoes = window.views.echo_list
    next(dock for dock in window.views.docks if dock.isAncestorOf(echoes)).raise_()
    window.session.showing.ask(radians(200))
    until(lambda: echoes.title.text().startswith("200.0°"))
    echoes.table.selectRow(2)
    pause(100)
    album.keep(window, "ask")
