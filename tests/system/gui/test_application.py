"""The command `gui`: its arguments, a missing display, signals, what it imports, and a session with mouse and keys."""

import importlib.util
import math
import os
import pkgutil
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import sonarhw_compare
import sonarhw_sim
from sonarhw_cli.app import run
from sonarhw_gui.model.look import DARK, LIGHT
from sonarhw_gui.session.scanner import ScannerTarget
from sonarhw_gui.window.start import WindowStart

import sonarhw
from sonarhw.log import Log, read_log
from tests.fixtures.window_scene import ROOM
from tests.hang_guard import HANG, wait_until
from tests.system.gui.outside import Outside, awaited

SONARHW = [sys.executable, "-c", "from sonarhw_cli.entry import main; main()"]
CSV = "turret_deg,range_cm\n0,15.4\n90,65.7\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_a_signal_during_a_scan_closes_window_and_log(tmp_path: Path, number: int) -> None:
    room = tmp_path / "small.toml"
    room.write_text(ROOM.read_text())
    command = [*SONARHW, "gui", f"fake:{room}?place=figure9&board=lego-nxt&pace=2"]
    environment, pipe = {**os.environ, "XDG_DATA_HOME": str(tmp_path)}, subprocess.PIPE
    process = subprocess.Popen(command, env=environment, stdout=pipe, stderr=pipe, text=True)
    recordings = tmp_path / "sonarhw" / "recordings"

    def recorded() -> bool:
        assert process.poll() is None, process.communicate()[1]
        return any(path.stat().st_size > 20_000 for path in recordings.glob("*.mcap"))

    wait_until(recorded)
    process.send_signal(number)
    _, errors = process.communicate(timeout=HANG)
    assert (process.returncode, errors) == (130, "")
    (recording,) = recordings.glob("*.mcap")
    log = read_log(recording)
    assert log.torn is None
    assert log.readings


@pytest.fixture
def starts(monkeypatch: pytest.MonkeyPatch) -> list[tuple[WindowStart, str]]:
    """The arguments of `run_window`, which opens no window in these tests, and the URL of the scanner."""
    starts: list[tuple[WindowStart, str]] = []

    def run_window(start: WindowStart) -> int:
        url = ""
        if isinstance(start.source, ScannerTarget):
            with start.source.opener() as scanner:
                url = scanner.url
        starts.append((start, url))
        return 0

    monkeypatch.setattr("sonarhw_gui.window.start.run_window", run_window)
    return starts


def test_scan_and_fake_are_shown_at_their_place(starts: list[tuple[WindowStart, str]], tmp_path: Path) -> None:
    csv, log = tmp_path / "turret.CSV", tmp_path / "turret.mcap"
    csv.write_text(CSV)
    columns = ["--heading", "turret_deg", "--range", "range_cm", "--scale", "0.01"]
    assert run(["import", str(csv), *columns, "--out", str(log)]) == 0
    for arguments, place, file in (
        ([str(ROOM)], "figure7", None),  # the first place
        ([str(ROOM), "--place", "figure9"], "figure9", None),
        ([str(csv), "--room", str(ROOM), "--place", "figure9", "--board", "paper"], "figure9", csv),
        ([str(csv), str(ROOM), "--place", "figure9", "--board", "paper"], "figure9", csv),
        ([str(csv), str(ROOM)], "figure7", csv),
        ([str(csv), str(ROOM), __file__], "figure7", csv),  # one after another
        ([str(log), str(ROOM)], "figure7", None),
    ):
        assert run(["gui", *arguments]) == 0
        start, _ = starts[-1]
        assert start.scene.place.name == place
        if file is not None:
            assert start.source_file == file
        if "paper" in arguments:
            assert start.scene.board.name == "paper"
    assert (starts[0][0].source, starts[0][0].used) == (None, (ROOM,))
    typed = f"fake:{ROOM}?place=figure9&pace=max"
    assert run(["gui", typed]) == 0
    assert starts[-1][1] == typed


@pytest.mark.parametrize("display", ["", ":4711"])
def test_a_missing_display_is_reported_with_a_solution(tmp_path: Path, display: str) -> None:
    environment = {"XDG_DATA_HOME": str(tmp_path), "DISPLAY": display, "WAYLAND_DISPLAY": "", "QT_QPA_PLATFORM": ""}
    command = [*SONARHW, "gui"]
    result = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True, timeout=HANG)
    assert result.returncode == 1
    assert "no display" in result.stderr
    assert "sonarhw demo --headless" in result.stderr
    assert result.stderr.count("\n") == 1


# what is imported


def printed(program: str, *words: str) -> str:
    done = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def first_that_loads(modules: list[str], unwanted: tuple[str, ...]) -> str:
    """Return the first of these modules that loads one of the unwanted modules, directly or indirectly."""
    return printed(f"""
import sys
for name in {modules}:
    __import__(name)
    if any(module.startswith({unwanted}) for module in sys.modules):
        print(name)
        break
""")


def test_only_the_window_loads_qt_and_its_session_no_widgets() -> None:
    packages = (sonarhw, sonarhw_sim, sonarhw_compare)
    modules = [one.name for each in packages for one in pkgutil.walk_packages(each.__path__, f"{each.__name__}.")] + [
        f"sonarhw_gui.model.{name}" for name in ("scene", "edits", "look")
    ]
    assert len(modules) > 50
    assert first_that_loads(modules, ("PySide6", "pyqtgraph")) == ""
    session = "sonarhw_gui.session"
    places = importlib.util.find_spec(session).submodule_search_locations
    modules = [session, *(one.name for one in pkgutil.iter_modules(places, f"{session}."))]
    assert first_that_loads(modules, ("PySide6.QtWidgets", "pyqtgraph")) == ""


@pytest.mark.parametrize("command", ["demo", "gui simple", "gui {log}"])
def test_no_slow_package_is_imported_before_the_first_paint(command: str, recorded: Path) -> None:
    """Later, a thread imports the compiler of kernels; it takes longer than all of PySide6."""
    program = """
import os, sys
from sonarhw_gui.session.session import WindowSession

def end(session):
    print(sorted({"numba", "llvmlite", "scipy", "matplotlib"} & set(sys.modules)), flush=True)
    os._exit(0)

WindowSession.begin = end  # called after the first paint
from sonarhw_cli.entry import main
main()
"""
    assert printed(program, *command.format(log=recorded).split()) == "[]"


# a session from outside, with mouse and keys only

MAGIC = b"\x89MCAP0\r\n"  # at the end of a complete log
DEMO = "Laboratory · place bench"
SENTENCE = re.compile(r"(?P<range>\d\.\d{3} m|no echo) at (?P<heading>\d+\.\d)°: ")


def closed(path: Path) -> Log | None:
    if not path.read_bytes().endswith(MAGIC):
        return None  # being written
    log = read_log(path)
    return None if log.torn else log


def shown_reading(program: Outside) -> tuple[float, str]:
    """Return heading and range of the sentence; not a number and nothing while a draft is shown."""
    found = SENTENCE.match(program.sentence())
    return (float(found["heading"]), found["range"]) if found else (math.nan, "")


def range_texts(log: Log) -> dict[float, str]:
    """Return the range of each reading as text, by heading."""
    return {
        round(math.degrees(reading.angle), 1): "no echo" if reading.range is None else f"{reading.range:.3f} m"
        for reading in log.readings
    }


def clicked_reading(program: Outside) -> tuple[float, str] | None:
    """Return heading and range of the sentence if it has the direction from the sensor to the clicked reading."""
    (x, y), (mark_x, mark_y) = program.sensor(), program.readings(LIGHT.measured)[0]
    program.click((mark_x, mark_y))
    towards = math.degrees(math.atan2(y - mark_y, mark_x - x))
    heading, distance = shown_reading(program)
    return (heading, distance) if abs((heading - towards + 180) % 360 - 180) < 2 else None


@pytest.mark.usefixtures("qapp")  # for screen and clipboard
def test_scan_select_drag_undo_close_during_a_scan_and_restore(tmp_path: Path) -> None:
    with Outside(tmp_path) as program:
        assert program.title.startswith(DEMO)
        (recording,) = awaited(lambda: program.recordings, "a recording")
        awaited(lambda: len(program.readings(LIGHT.measured)) > 3, "readings in the plan")
        program.key("F6")
        ranges = range_texts(awaited(lambda: closed(recording), "the end of the recording"))

        heading, distance = awaited(lambda: clicked_reading(program), "the sentence of the clicked reading")
        assert ranges[heading] == distance

        x, y = program.sensor()
        program.drag((x, y), (x + 40, y + 20))
        awaited(lambda: not program.title.startswith(DEMO), "another place in the title")
        program.key("ctrl+z")
        awaited(lambda: program.title.startswith(DEMO), "the place as it was")

        program.drag((x, y), (x + 40, y + 20), let_go=False)
        awaited(lambda: not program.title.startswith(DEMO), "another place in the title")
        program.key("Escape")
        awaited(lambda: program.title.startswith(DEMO), "the place as it was")
        program.let_go()

        program.key("ctrl+d", "F5")
        awaited(lambda: len(program.recordings) == 2, "a second recording")
        second = program.recordings[1]
        awaited(lambda: second.stat().st_size > 30_000, "readings in it")
        program.key("ctrl+q")
        assert program.ended() == (0, "")
    ranges = range_texts(closed(second))
    assert ranges  # all 72 only if the machine is so slow that the scan ends before the key arrives

    with Outside(tmp_path) as program:
        awaited(lambda: program.badge(DARK.replay), "the badge of a replay")
        assert program.looks(DARK)
        assert program.title.startswith(DEMO)
        assert program.recordings == [recording, second]
        awaited(lambda: shown_reading(program)[0] == max(ranges), "the last reading of the interrupted scan")
        program.key("ctrl+Left")
        awaited(lambda: shown_reading(program)[0] == 0.0, "its first reading")
        program.key("space")
        awaited(lambda: shown_reading(program)[0] == max(ranges), "a replay to the end")
        program.key("ctrl+q")
        assert program.ended() == (0, "")
