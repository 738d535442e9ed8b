"""Measurements of the window: real windows, real mouse events, real paints; each job in its own process.

Most jobs measure times. `journeys` counts the files of the product whose functions run on the way from an event to its
paint, in all threads: the number of places that a reader must know to follow it.

Each job returns its results as `Figure`s. `benchmarks.window` runs the jobs and prints them.
"""

import gc
import math
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from types import FrameType
from typing import NamedTuple
from unittest.mock import patch

from PySide6.QtCore import QEvent, QEventLoop, QObject, QPoint, QPointF, Qt, QTimer
from PySide6.QtTest import QTest
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.window.garbage import collected_between_events
from sonarhw_gui.window.start import WindowStart, open_application, open_window
from sonarhw_gui.window.window import MainWindow
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

from benchmarks.cases.office import PLACE, office_floor
from benchmarks.cases.synthetic_scan import synthetic_scan
from sonarhw.host.driver import Driver
from sonarhw.host.scanner import Scanner
from sonarhw.log import Log, LogMetadata, read_log
from sonarhw.log.writer import write_scan
from sonarhw.readings import Reading, ScanOrder

ROOMS = Path(__file__).parents[2] / "rooms"
SONARHW = (sys.executable, "-c", "from sonarhw_cli.entry import main; main()")
WALLS = 64
RATE = 50.0  # readings per second of the live scan
PING = 0.1  # s, of the fake scanner in simulated time
NEAR = 2.0  # m: range of the live scan
SPEED = 50.0  # of the long replay
PATIENCE = 120.0  # s
_RESTS, _SHORT_DRAG = 10, 0.5  # s
_FEW = 10.0  # readings per second, so that the window paints each
WARM_UP = 3.0  # s, for compilers and caches
PACKAGES = ("sonarhw", "sonarhw_sim", "sonarhw_compare", "sonarhw_gui", "sonarhw_cli")


@dataclass(frozen=True)
class Figure:
    """One line of the table."""

    what: str
    measured: float
    unit: str
    target: float | None = None
    at_least: bool = False  # otherwise at most
    note: str = ""


class Paints(QObject):
    """Calls back after each paint of a window has reached the screen."""

    def __init__(self, window: MainWindow, painted: Callable[[], None]) -> None:
        super().__init__(window)
        self._painted = painted
        window.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Let the window paint, then call back."""
        if event.type() is not QEvent.Type.UpdateRequest:
            return False
        watched.event(event)
        self._painted()
        return True


class Moment(NamedTuple):
    """A time by three clocks, or the difference of two times."""

    wall: float  # s
    process: float  # s of processor time, all threads
    thread: float  # s of processor time, calling thread

    def since(self, earlier: "Moment") -> "Moment":
        """Return the time since an earlier moment."""
        return Moment(*(after - before for after, before in zip(self, earlier, strict=True)))


def moment() -> Moment:
    """Return the current time."""
    return Moment(time.perf_counter(), time.process_time(), time.thread_time())


def memory() -> float:
    """Return the current memory of this process, MB."""
    if sys.platform == "win32":
        raise NotImplementedError("Windows, which has no /proc")
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@contextmanager
def opened(all_docks: bool = True, **start: object) -> Iterator[MainWindow]:
    """Open a window with all docks, or as it first opens; reference cycles are collected as in the application."""
    open_application()
    with tempfile.TemporaryDirectory() as folder:
        settings = {"recordings": Path(folder), **start}
        window = open_window(WindowStart(**settings))  # type: ignore[arg-type]  # checked by the callers
        window.resize(1280, 800)
        for dock in window.dock_openers:
            if all_docks and not dock.isChecked():
                dock.trigger()
        window.show()
        with collected_between_events():
            work(0.5)  # until the layout is done
            yield window
            window.close()


def work(seconds: float) -> None:
    """Run the event loop for some seconds."""
    loop = QEventLoop()
    QTimer.singleShot(round(1000 * seconds), loop.quit)
    loop.exec()


def work_until(condition: Callable[[], bool]) -> None:
    """Run the event loop until a condition is true. Raises TimeoutError after PATIENCE."""
    deadline = time.monotonic() + PATIENCE
    while not condition():
        work(0.01)
        if time.monotonic() > deadline:
            raise TimeoutError(f"the window did not reach the expected state within {PATIENCE:g} s")


def settled(window: MainWindow) -> bool:
    """Return whether prediction and comparison are complete."""
    shown, status = window.session.shown, window.session.status
    compared = not shown.readings or shown.row(len(shown.readings) - 1) is not None
    return compared and not status.prediction.searching and shown.outline is not None


def ms(seconds: list[float], share: float) -> float:
    """Return the quantile `share` of times, ms."""
    ordered = sorted(seconds)
    return 1000 * ordered[min(len(ordered) - 1, math.floor(share * len(ordered)))]


def write_log(path: Path, hours: float) -> None:
    """Write a log of ten readings per second with traces, in another process with its own memory."""
    command = [sys.executable, "-m", "benchmarks.logs", str(hours), "write", str(path)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


@contextmanager
def served(room_file: str, place: str, pace: float) -> Iterator[str]:
    """Run a fake scanner in another process; yields its URL."""
    command = [*SONARHW, "fake", str(ROOMS / room_file), "--place", place, "--pace", str(pace), "--tcp", "127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as fake:
        assert fake.stdout is not None
        try:
            yield fake.stdout.readline().strip()
        finally:
            fake.terminate()


def scanned(scene: Scene, folder: Path) -> Log:
    """Return a log of a whole turn in a scene."""
    assert scene.room is not None
    assert scene.place is not None
    path = folder / "turn.mcap"
    readings = synthetic_scan(scene.room, scene.place, scene.board, seed=1, readings=360)
    write_scan(path, LogMetadata("import", 0.0), readings)
    return read_log(path)


# the jobs


def dragging(lasts: float) -> list[Figure]:
    """Drag the sensor with the mouse in a room of many walls."""
    scene = Scene(office_floor(WALLS), PLACE, load_board("polaroid-6500"))
    with tempfile.TemporaryDirectory() as folder, opened(scene=scene, source=scanned(scene, Path(folder))) as window:
        work_until(lambda: settled(window))
        drag = _Drag(window)
        drag.run(WARM_UP)
        drag.updates.clear()
        began = moment()
        drag.run(lasts)
        wall, process, thread = moment().since(began)
        count = len(drag.updates)
        rests = [drag.rest() for _ in range(_RESTS)]
        drag.end()
    what = f"drag the sensor, {WALLS} walls, 360 headings: "
    return [
        Figure(f"{what}new outlines painted", count / wall, "/s", 30, True),
        Figure(f"{what}new outlines painted per second of GUI thread", count / thread, "/s", 30, True),
        Figure(f"{what}mouse to paint, median", ms(drag.updates, 0.5), "ms"),
        Figure(f"{what}all threads", process / wall, "cores"),
        *_of_rests(what, rests),
    ]


def laboratory() -> list[Figure]:
    """Drag the sensor with the mouse in the laboratory, where a search takes longer than among many walls."""
    room = load_room(ROOMS / "laboratory.toml")
    scene = Scene(room, room.place("bench"), load_board("polaroid-6500"))
    with tempfile.TemporaryDirectory() as folder, opened(scene=scene, source=scanned(scene, Path(folder))) as window:
        work_until(lambda: settled(window))
        drag = _Drag(window)
        drag.run(WARM_UP)
        rests = [drag.rest() for _ in range(_RESTS)]
        drag.end()
    return _of_rests("drag the sensor, laboratory, 360 headings: ", rests)


def _of_rests(what: str, rests: list[Moment]) -> list[Figure]:
    wall, process = (ms([getattr(rest, kind) for rest in rests], 0.5) for kind in ("wall", "process"))
    return [
        Figure(f"{what}hand rests to complete outline painted, median", wall, "ms", 300),
        Figure(f"{what}the same, processor of all threads, median", process, "ms"),
    ]


class _Drag:
    """Drags the sensor with the mouse in a circle, a hundred moves per second."""

    def __init__(self, window: MainWindow) -> None:
        self.updates: list[float] = []  # from a mouse move to the paint of its outline, s
        self._window, self._plan = window, window.views.plan.drawing
        self._moved: dict[tuple[float, float], float] = {}
        self._painted: object = None
        self._completed: Moment | None = None
        self._middle = window.session.shown.scene.pose.position
        QTest.mousePress(self._plan.viewport(), Qt.MouseButton.LeftButton, pos=self._pixel(*self._middle))
        self._timer = QTimer(window, interval=10)
        self._timer.timeout.connect(self._move)
        self._step = 0
        self._paints = Paints(window, self._note_paint)
        window.views.plan.gestures.edited.connect(self._note_move)

    def run(self, lasts: float) -> None:
        """Drag for some seconds."""
        self._timer.start()
        work(lasts)
        self._timer.stop()

    def rest(self) -> Moment:
        """Drag a little, and return the time from the last movement to the paint of the complete outline."""
        self.run(_SHORT_DRAG)
        began, self._completed = moment(), None
        work_until(lambda: self._completed is not None)
        assert self._completed is not None
        return self._completed.since(began)

    def end(self) -> None:
        """Release the mouse."""
        QTest.mouseRelease(self._plan.viewport(), Qt.MouseButton.LeftButton)

    def _pixel(self, x: float, y: float) -> QPoint:
        at: QPoint = self._plan.mapFromScene(self._plan.plot.vb.mapViewToScene(QPointF(x, y)))
        return at

    def _move(self) -> None:
        self._step += 1
        turn, radius = 0.05 * self._step, 0.3
        x, y = self._middle
        QTest.mouseMove(self._plan.viewport(), self._pixel(x + radius * math.sin(turn), y + radius * math.cos(turn)))

    def _note_move(self, scene: Scene) -> None:
        self._moved[scene.pose.position] = time.perf_counter()

    def _note_paint(self) -> None:
        if self._completed is None and not self._window.session.showing.forecast.searching:
            self._completed = moment()
        outline = self._window.session.shown.outline
        if outline is not self._painted and outline is not None:
            self._painted = outline
            moved = self._moved.get(outline.place.position)
            if moved is not None:
                self.updates.append(time.perf_counter() - moved)


def live(lasts: float) -> list[Figure]:
    """Run a live scan with traces at the highest rate of a board."""
    board = replace(load_board("polaroid-6500"), max_range=NEAR)
    room = load_room(ROOMS / "laboratory.toml")
    scene = Scene(room, room.place("bench"), board, "laboratory.toml")
    arrived, drawn = _arrival_times(), []
    order = ScanOrder(0.0, math.radians(1), 360, sweeps=100)
    with (
        served(scene.room_file, "bench", RATE * PING) as url,
        opened(scene=scene, source=lambda: Scanner.open(url), order=order) as window,
    ):
        work_until(lambda: settled(window))
        frames: list[tuple[Moment, int]] = []

        def painted() -> None:
            count = len(window.session.shown.readings)
            if not frames or frames[-1][1] != count:  # ignore paints without new readings
                frames.append((moment(), count))

        Paints(window, painted)
        window.commands.scan.trigger()
        work_until(lambda: len(window.session.shown.readings) > RATE * WARM_UP)
        frames.clear()
        began = moment()
        work(lasts)
        wall, process, _ = moment().since(began)
        for (_, before), (at, count) in pairwise(frames):
            drawn += [at.wall - arrived[number] for number in range(before, count)]
    busy = [later.since(earlier).thread for (earlier, _), (later, _) in pairwise(frames)]
    what = f"live, {len(drawn) / wall:.0f} readings per second with traces: "
    return [
        Figure(f"{what}paints of new readings per second", len(frames) / wall, "/s", 30, True),
        Figure(f"{what}last byte to paint, median", ms(drawn, 0.5), "ms"),
        Figure(f"{what}last byte to paint, 99 of 100", ms(drawn, 0.99), "ms", 60),
        Figure(f"{what}GUI thread from paint to paint, 99 of 100", ms(busy, 0.99), "ms of it", 25),
        Figure(f"{what}processor, window with driver and log", process / wall, "cores", 1),
    ]


def _arrival_times() -> dict[int, float]:
    """Return a table that every driver of this process fills with the time of the last byte of each reading."""
    times: dict[int, float] = {}
    receive, readings = Driver.receive, Driver.readings
    last_byte = [0.0]

    def timed_receive(driver: Driver, data: bytes, now: float, arrived: float | None = None) -> None:
        last_byte[0] = time.perf_counter()
        receive(driver, data, now, arrived)

    def noted_readings(driver: Driver) -> list[Reading]:
        made = list(readings(driver))
        for _ in made:
            times[len(times)] = last_byte[0]
        return made

    patch.multiple(Driver, receive=timed_receive, readings=noted_readings).start()
    return times


def long_log(lasts: float, scrubs: int = 60) -> list[Figure]:
    """Open, scrub and replay a log of an hour of readings with traces."""
    room = load_room(ROOMS / "laboratory.toml")
    scene = Scene(room, room.place("bench"), load_board("polaroid-6500"), "laboratory.toml")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "hour.mcap")
        write_log(path, 1.0)
        with opened(scene=scene) as window:
            work_until(lambda: settled(window))
            seen: list[tuple[int, Moment]] = []
            Paints(window, lambda: seen.append((len(window.session.shown.readings), moment())))
            began = moment()
            window.session.open_file(str(path))
            work_until(lambda: bool(seen) and seen[-1][0] > 0)
            total, painted = seen[-1]
            wall, process, _ = painted.since(began)
            what = f"log of {total} readings with traces: "
            figures = [Figure(f"{what}open to paint", wall, "s", 2, note=f"processor {process:.2f} s")]
            work_until(lambda: settled(window))
            figures += _scrubbed(window, what, seen, scrubs)
            figures += _played(window, what, lasts)
    return figures


def _scrubbed(window: MainWindow, what: str, seen: list[tuple[int, Moment]], scrubs: int) -> list[Figure]:
    replay, chance = window.session.replay, random.Random(1)
    assert replay is not None
    taken = []
    for _ in range(scrubs):
        work(0.15)  # a pause, so that work of the scrub before is done
        seen.clear()
        began = moment()
        window.replay_bar.slider.sought.emit(chance.uniform(0, replay.duration))
        work_until(lambda: bool(seen))
        count, painted = seen[0]
        assert count == replay.count
        taken.append(painted.since(began))
    walls, threads = [took.wall for took in taken], [took.thread for took in taken]
    note = f"wall clock {ms(walls, 0.5):.0f} and {ms(walls, 0.95):.0f}"
    return [
        Figure(f"{what}scrub to paint, GUI thread, median", ms(threads, 0.5), "ms", 100, note=note),
        Figure(f"{what}scrub to paint, GUI thread, 95 of 100", ms(threads, 0.95), "ms", 100),
    ]


def _played(window: MainWindow, what: str, lasts: float) -> list[Figure]:
    replay = window.session.replay
    assert replay is not None
    replay.loop = True
    replay.speed = SPEED
    replay.seek(0.0)
    replay.toggle()
    work(lasts / 2)
    half, began = memory(), moment()
    work(lasts / 2)
    wall, process, _ = moment().since(began)
    grown = memory() - half
    what = f"{what}played at {SPEED:g}× for {lasts:.0f} s: "
    return [
        Figure(f"{what}memory grows in its second half by", grown, "MB", 20, note=f"on {half:.0f} MB"),
        Figure(f"{what}processor", process / wall, "cores"),
    ]


def repaints(times: int) -> list[Figure]:
    """Paint the same views many times."""
    room = load_room(ROOMS / "laboratory.toml")
    scene = Scene(room, room.place("bench"), load_board("polaroid-6500"), "laboratory.toml")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "scan.mcap")
        write_log(path, 0.01)
        with opened(scene=scene, source=read_log(path)) as window:
            work_until(lambda: settled(window))
            readings = len(window.session.shown.readings)

            def repaint(count: int) -> None:
                for k in range(count):
                    window.session.showing.choose(k % readings)
                    window.repaint()

            repaint(500)
            gc.collect()  # None is referenced by garbage, too
            references, before, began = sys.getrefcount(None), memory(), moment()
            repaint(times)
            process = moment().since(began).process
            gc.collect()
            lost, grown = sys.getrefcount(None) - references, memory() - before
    what = f"{times} repaints of the whole window: "
    return [
        Figure(f"{what}references to None change by", abs(lost), "", 150),
        Figure(f"{what}memory grows by", grown, "MB", 20, note=f"on {before:.0f} MB"),
        Figure(f"{what}processor", 1000 * process / times, "ms each"),
    ]


def journeys() -> list[Figure]:
    """Count the files that a reading crosses from the port to its pixel, and those of a drag of the sensor."""
    crossed = CrossedFiles()  # before the window starts its threads
    room = load_room(ROOMS / "laboratory.toml")
    scene = Scene(room, room.place("bench"), load_board("polaroid-6500"), "laboratory.toml")
    order = ScanOrder(0.0, math.radians(1), 360, sweeps=100)
    with opened(all_docks=False, scene=scene) as window:
        dragged = _files_of_a_drag(window, crossed)
    with (
        served(scene.room_file, "bench", _FEW * PING) as url,
        opened(all_docks=False, scene=scene, source=lambda: Scanner.open(url), order=order) as window,
    ):
        read = _files_of_a_reading(window, crossed)
    what = "files that run, in all threads: "
    return [
        Figure(f"{what}a reading, from the port to its pixel", read, "files", 65),
        Figure(f"{what}a drag of the sensor", dragged, "files", 55),
    ]


def _files_of_a_reading(window: MainWindow, crossed: "CrossedFiles") -> int:
    counts = [0]
    Paints(window, lambda: counts.append(len(window.session.shown.readings)))
    work_until(lambda: settled(window))
    window.commands.scan.trigger()
    work_until(lambda: counts[-1] > _FEW)
    first = counts[-1]
    with crossed.counted():
        work_until(lambda: counts[-1] > first + 1)
    return crossed.files


def _files_of_a_drag(window: MainWindow, crossed: "CrossedFiles") -> int:
    work_until(lambda: settled(window))
    drag = _Drag(window)
    drag.rest()
    drag.updates.clear()
    with crossed.counted():
        while not drag.updates:  # no new outline has been painted yet
            drag.run(_SHORT_DRAG)
    drag.end()
    return crossed.files


class CrossedFiles:
    """Counts the files of the product whose functions are called, in this thread and in threads that start later."""

    def __init__(self) -> None:
        self._calls: set[str] = set()
        self._counting = False
        threading.setprofile(self._note)

    @property
    def files(self) -> int:
        """Return the number of files while it counted last."""
        return len(self._calls)

    @contextmanager
    def counted(self) -> Iterator[None]:
        """Count during the block."""
        self._calls.clear()
        self._counting = True
        sys.setprofile(self._note)
        try:
            yield
        finally:
            sys.setprofile(None)
            self._counting = False

    def _note(self, frame: FrameType, event: str, _: object) -> None:
        if not self._counting or event != "call":
            return
        file, function = frame.f_code.co_filename, frame.f_code.co_qualname
        # not code that a decorator made, nor imports; a lambda or comprehension is part of the function around it
        if "<" not in file and "<" not in function.replace("<locals>", ""):
            package = str(frame.f_globals.get("__name__")).partition(".")[0]
            if package in PACKAGES:
                self._calls.add(file)


def first_window(began: float) -> list[Figure]:
    """Measure `sonarhw demo` from the start of its process, at wall clock `began`, to the first paint."""
    import sonarhw_gui.window.start
    from sonarhw_cli.entry import main

    took: list[tuple[float, float]] = []
    open_it = sonarhw_gui.window.start.open_window

    def timed(start: WindowStart) -> MainWindow:
        window = open_it(replace(start, memory=Path(folder, "window.ini"), recordings=Path(folder)))

        def painted() -> None:
            if not took:
                took.append((time.time() - began, time.process_time()))
                QTimer.singleShot(0, window.close)

        Paints(window, painted)
        return window

    sonarhw_gui.window.start.open_window = timed
    sys.argv = ["sonarhw", "demo"]
    # the settings of the user stay as they are
    with tempfile.TemporaryDirectory() as folder, suppress(SystemExit):
        main()
    wall, process = took[0]
    what = "first window, warm start: to its first paint"
    return [Figure(what, wall, "s", 3), Figure(f"{what}, processor", process, "s", 3)]
