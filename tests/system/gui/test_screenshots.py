"""Pictures of the window in the demo room: every view, the panels, a live scan, a replay.

With --soak; `test_screens.py` opens every view and panel too, `test_application.py` scans and replays.
SONARHW_SCREENSHOTS=FOLDER writes them to a folder, in both palettes and two sizes. Without it, they are taken in one
look and not saved. QT_SCALE_FACTOR=2 takes them at 200 %. docs/screenshots contains some of them, and
docs/how_to/window.md explains them.
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
from sonarhw_gui.session.scanner import ScannerTarget, ScanSettings
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.room_echoes import RoomEchoes
from sonarhw_sim.room.room import load_room

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import Pace, serve
from sonarhw.errors import InputError
from sonarhw.host.scanner import Scanner
from sonarhw.link import Port, Usb
from sonarhw.log import read_log
from sonarhw.readings import ScanOrder
from tests.fixtures.window_scan import recorded_scan
from tests.fixtures.window_scene import ROOM
from tests.system.gui.conftest import OpenWith
from tests.system.gui.driving import click, dialog_of, drawn, ended, pause, predicted, until

FOLDER = os.environ.get("SONARHW_SCREENSHOTS")
SMALL, LARGE = (1280, 800), (1920, 1080)
LOOKS = [(LIGHT, SMALL)] if FOLDER is None else [(paper, size) for size in (SMALL, LARGE) for paper in (LIGHT, DARK)]
EXAMPLE = ROOM.parents[1] / "examples" / "turret.csv"
HEADINGS = 120
ORDER = ScanOrder(0.0, radians(3), HEADINGS, sweeps=2)  # the second sweep leaves time for the picture of the first one
LIVE_UP_TO = 84  # readings in the picture of the running scan
SELECTED, SELECTED_LIVE, SELECTED_FOR_TRACE = 38, 74, 74  # the readings that the pictures explain
# shares of the views on the right
TRACE, RANGES, TABLE, PANEL = (500, 120, 60), (60, 560, 60), (60, 240, 400), (60, 60, 600)
PORTS = [Port("/dev/ttyACM0", "ttyACM0", Usb(0x2341, 0x0042, "1234", None)), Port("/dev/ttyS0", "n/a")]


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
        if FOLDER is None:
            return  # compressing would take a third of the time
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
    file, place = (ROOM.with_name("laboratory.toml"), "bench") if FOLDER else (ROOM, "figure9")
    room = load_room(file)
    return Scene(room, room.place(place), load_board("polaroid-6500"), file.name)


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


@pytest.mark.soak
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
    show_replay(with_look(replay, look), album)


def show_replay(window: MainWindow, album: Album) -> None:
    until(lambda: predicted(window))
    window.session.replay.seek(0.75 * window.session.replay.duration)
    window.session.showing.choose(SELECTED)
    window.session.replay.toggle()
    until(lambda: window.status_bar.badge.text() == "replay" and window.session.status.rate > 0)
    until(lambda: traced(window))
    album.keep(window, "replay")


@pytest.mark.soak
def test_pictures_of_every_view(
    open_with: OpenWith, album: Album, look: tuple[Palette, tuple[int, int]], bench: Scene, scan: Path
) -> None:
    window = with_look(
        open_with(scene=bench, source=read_log(scan), source_name="bench.mcap", find_scanner=nowhere), look
    )
    until(lambda: predicted(window))
    window.session.showing.choose(SELECTED)
    until(lambda: traced(window))
    album.keep(window, "plan")
    show_large_views(window, album)
    window.session.showing.choose(SELECTED_FOR_TRACE)
    until(lambda: traced(window))
    for sizes, name in ((TRACE, "trace"), (RANGES, "ranges"), (TABLE, "table")):
        share(window, sizes)
        pause(50)
        album.keep(window, name)
    share(window, TRACE)
    window.views.trace.rf.trigger()
    window.views.trace.cursors_shown.trigger()
    pause(50)
    album.keep(window, "trace-rf")
    window.views.trace.cursors_shown.trigger()
    window.views.trace.envelope.trigger()
    show_panels(window, album)
    show_dialogs(window, album)


def test_picture_of_the_question_in_the_readme(
    open_with: OpenWith, album: Album, look: tuple[Palette, tuple[int, int]], tmp_path: Path
) -> None:
    """Why does heading 270° in the simple room read 0.827 m? As in the README: a log, a click, a sentence."""
    log, to = tmp_path / "figure9.mcap", "--place figure9 --board paper --out"
    assert run(["simulate", str(ROOM), *to.split(), str(log)]) == 0
    opened = read_log(log)
    window = open_with(scene=scene_of_log(opened.metadata), source=opened, source_name=log.name)
    with_look(window, look)
    until(lambda: predicted(window))
    ranges = window.views.ranges
    click(ranges, ranges.ranges.vb, drawn(ranges.marks[0])[54])
    until(lambda: traced(window))
    assert window.sentence.text() == (
        "0.827 m at 270.0°: three reflections, bottom, top, bottom; the near wall (0.085 m) lies within blanking"
    )
    window.views.plan.drawing.plot.vb.setRange(yRange=(-0.85, 0.8), padding=0)  # the reading is beyond the wall
    pause(100)
    album.keep(window, "why")
    show_questions(window, album)


def show_questions(window: MainWindow, album: Album) -> None:
    """A heading without a reading, with its echoes; then the sound at 270°."""
    echoes = window.views.echo_list
    next(dock for dock in window.views.docks if dock.isAncestorOf(echoes)).raise_()
    for heading, name in ((200.0, "ask"), (270.0, "sound")):
        window.session.showing.ask(radians(heading))
        until(lambda title=f"{heading}°": echoes.title.text().startswith(title))
        if name == "ask":
            echoes.table.selectRow(2)
        else:
            window.commands.play_sound.trigger()
            until(lambda: window.session.shown.sound is not None)
            window.session.sound.seek(1.35e-3)
        pause(100)
        album.keep(window, name)


def show_large_views(window: MainWindow, album: Album) -> None:
    plan, beside, images = window.commands.views
    beside.trigger()
    pause(50)
    album.keep(window, "side-by-side")
    images.trigger()
    window.views.bscan.choices.actions()[3].trigger()
    until(lambda: window.session.shown.bscan is not None and not window.views.bscan.note.text())
    pause(200)
    album.keep(window, "bscan")
    window.views.bscan.choices.actions()[0].trigger()
    window.views.bscan.polar.trigger()
    until(
        lambda: (
            window.session.shown.bscan.settings == window.views.bscan.settings and not window.views.bscan.note.text()
        )
    )
    pause(200)
    album.keep(window, "bscan-polar")
    plan.trigger()


def show_panels(window: MainWindow, album: Album) -> None:
    dock(window, "Room")
    window.views.plan.drawing.controller.choose_surface(window.session.shown.scene.room.names[0])
    pause(50)
    album.keep(window, "room")
    window.views.plan.drawing.controller.choose_surface(None)
    share(window, PANEL)
    dock(window, "Fit")
    if FOLDER:  # a fit takes a while
        window.fit_panel.begin.click()
        until(window.fit_panel.accept.isVisible)
        table = window.fit_panel.table
        until(lambda: table.height() >= table.sizeHint().height())
    pause(50)
    album.keep(window, "fit")
    dock(window, "")


def nowhere(url: str) -> ScannerTarget:
    raise InputError(f"{url}: leads nowhere")


def show_dialogs(window: MainWindow, album: Album) -> None:
    scanners = window.session.scanners
    scanners.find_ports, scanners.probe = lambda: PORTS, lambda device: (True, "scanner POL-7")
    window.commands.connect_scanner.trigger()
    dialog = dialog_of(window)
    until(lambda: not scanners.busy and dialog.ports.rowCount() == len(PORTS))
    album.keep(dialog, "connect")
    dialog.close()
    window.commands.show_help.trigger()
    pause(50)
    album.keep(dialog_of(window), "help")
    dialog_of(window).close()
    show_import_dialog(window, album)


def show_import_dialog(window: MainWindow, album: Album) -> None:
    window.session.open_file(str(EXAMPLE))
    until(lambda: dialog_of(window) is not None)
    dialog = dialog_of(window)
    dialog.fields["no_echo"].setText("255")
    dialog.fields["turn"].setCurrentText("clockwise")
    until(dialog.import_button.isEnabled)
    pause(100)  # the layout follows
    album.keep(dialog, "import")
    dialog.close()
