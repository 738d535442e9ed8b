"""`sonarhw scan` and the Scan command of the window record the same ranges, and no log without readings."""

from dataclasses import replace
from pathlib import Path

import pytest
from sonarhw_cli.app import run
from sonarhw_gui.model.scene import scene_with
from sonarhw_gui.session.scanner import WHOLE_TURN, Phase, ScannerThread, ScanSettings, scan_and_record
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import serve
from sonarhw.host.scanner import Scanner
from sonarhw.log import read_log
from sonarhw.sound_speed import speed_of_sound
from tests.checkout import CHECKOUT
from tests.fixtures.plain_echoes import PlainEchoes

ROOM = CHECKOUT / "rooms" / "simple.toml"
FOUR = replace(WHOLE_TURN, step=WHOLE_TURN.step * 18, headings=4)


@pytest.fixture
def hot_room(tmp_path: Path) -> Path:
    hot = tmp_path / "hot.toml"
    hot.write_text(ROOM.read_text(encoding="utf-8") + "\n[air]\ntemperature_c = 35.0\n", encoding="utf-8")
    return hot


def scanned(log: Path, thermometer: float | None, *options: str | Path) -> list[float | None]:
    """Return the ranges that `sonarhw scan` records, m."""
    with serve(FakeBoard(PlainEchoes(thermometer)), tcp="127.0.0.1:0", pace="max") as endpoint:
        assert run(["scan", endpoint.url, "--out", str(log), "--step", "90", *map(str, options)]) == 0
    return [reading.range for reading in read_log(log).readings]


def scanned_by_window(folder: Path, thermometer: float | None, room_file: Path | None) -> list[float | None]:
    """Return the ranges that the window records, m."""
    board = load_board("polaroid-6500")
    room = load_room(room_file) if room_file else None
    scene = scene_with(board, room, room.place("figure9")) if room else scene_with(board)
    with serve(FakeBoard(PlainEchoes(thermometer)), tcp="127.0.0.1:0", pace="max") as endpoint:
        live = ScannerThread(
            lambda: Scanner.open(endpoint.url),
            Phase.HOMING,
            scan_and_record(scene, ScanSettings(folder, FOUR, traces=False)),
            lambda: None,
        )
        live.start()
        live.disconnect()
        live.join()
    assert live.state.error is None
    return [reading.range for reading in read_log(live.state.recording).readings]


@pytest.mark.parametrize(
    ("thermometer", "in_room", "temperature"),
    [(10.0, True, 10.0), (None, True, 35.0), (None, False, 20.0)],
    ids=["thermometer first", "then the air of the room", "then 20"],
)
def test_command_and_window_use_the_same_speed_of_sound(
    thermometer: float | None, in_room: bool, temperature: float, hot_room: Path, tmp_path: Path
) -> None:
    room = hot_room if in_room else None
    options = ["--room", hot_room, "--place", "figure9"] if in_room else []
    log = tmp_path / "command.mcap"
    by_command = scanned(log, thermometer, *options)
    assert by_command == scanned_by_window(tmp_path, thermometer, room)
    (first, *_), settings = read_log(log).readings, read_log(log).settings
    assert settings.speed_of_sound / 1000 == pytest.approx(speed_of_sound(temperature), abs=0.001)
    assert first.range == pytest.approx(speed_of_sound(temperature) * 0.015 / 2, rel=1e-4)
