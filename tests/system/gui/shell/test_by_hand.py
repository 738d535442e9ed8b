"""A journey through the program from outside, with mouse and keys only: what is left is found again as it was."""

import math
import re
from pathlib import Path

import pytest
from sonarhw_gui.look.palette import DARK, LIGHT

from sonarhw.log import Log, read_log
from tests.fixtures.window_scene import ROOM
from tests.system.gui.outside import Outside, awaited

DEMO = "Laboratory · place bench"
SAID = re.compile(r"(?P<range>\d\.\d{3} m|no echo) at (?P<heading>\d+\.\d)°: ")


def closed(path: Path) -> Log | None:
    log = read_log(path)
    return None if log.torn else log


def heading_said(program: Outside) -> float:
    return float(SAID.match(program.sentence())["heading"])


def as_it_is_said(log: Log) -> dict[float, str]:
    """Heading to range, of each reading."""
    return {
        round(math.degrees(reading.angle), 1): "no echo" if reading.range is None else f"{reading.range:.3f} m"
        for reading in log.readings
    }


def a_click_asks_about_the_reading_under_it(program: Outside) -> bool:
    """Whether the sentence is about the direction in which the reading is seen from the sensor."""
    (x, y), (mark_x, mark_y) = program.sensor(), program.readings(LIGHT.measured)[0]
    program.click((mark_x, mark_y))
    towards = math.degrees(math.atan2(y - mark_y, mark_x - x))
    return abs((heading_said(program) - towards + 180) % 360 - 180) < 2


@pytest.mark.usefixtures("qapp")
def test_a_scan_as_csv_and_a_room_named_at_the_start_come_together(tmp_path: Path) -> None:
    (tmp_path / "turret.csv").write_text("turret_deg,range_cm\n0,15.4\n90,65.7\n")
    with Outside(tmp_path, str(tmp_path / "turret.csv"), str(ROOM), "--place", "figure9") as program:
        assert program.title == "Simple room · place figure9"
        awaited(lambda: program.badge(LIGHT.replay), "the badge of a replay")
        awaited(lambda: SAID.match(program.sentence())["range"] == "0.657 m", "its last reading")
        program.key("ctrl+q")
        assert program.ended() == (0, "")
    assert [path.name for path in program.recordings] == ["turret.mcap"]


@pytest.mark.usefixtures("qapp")  # eyes and clipboard of whoever looks on
def test_scanned_asked_dragged_undone_closed_in_mid_scan_and_reopened_as_left(tmp_path: Path) -> None:
    with Outside(tmp_path) as program:
        assert program.title == DEMO
        (recording,) = awaited(lambda: program.recordings, "a recording")
        awaited(lambda: len(program.readings(LIGHT.measured)) > 3, "readings in the plan")
        program.key("F6")
        said = as_it_is_said(awaited(lambda: closed(recording), "the end of the recording"))

        awaited(lambda: a_click_asks_about_the_reading_under_it(program), "a sentence about the reading clicked")
        sentence = SAID.match(program.sentence())
        assert said[float(sentence["heading"])] == sentence["range"]

        x, y = program.sensor()
        program.drag((x, y), (x + 40, y + 20))
        awaited(lambda: program.title != DEMO, "another place in the title")
        program.key("ctrl+z")
        awaited(lambda: program.title == DEMO, "the place as it was")

        program.drag((x, y), (x + 40, y + 20), let_go=False)
        awaited(lambda: program.title != DEMO, "another place in the title")
        program.key("Escape")
        awaited(lambda: program.title == DEMO, "the place as it was")
        program.let_go()

        program.key("ctrl+d", "F5")
        awaited(lambda: len(program.recordings) == 2, "a second recording")
        second = program.recordings[1]
        awaited(lambda: second.stat().st_size > 30_000, "readings in it")
        program.key("ctrl+q")
        assert program.ended() == (0, "")
    said = as_it_is_said(closed(second))
    assert len(said) < 72

    with Outside(tmp_path) as program:
        awaited(lambda: program.badge(DARK.replay), "the badge of a replay")
        assert program.looks(DARK)
        assert program.title == DEMO
        assert program.recordings == [recording, second]
        awaited(lambda: heading_said(program) == max(said), "the last reading of the scan that was closed in its midst")
        program.key("ctrl+Left")
        awaited(lambda: heading_said(program) == 0.0, "its first reading")
        program.key("space")
        awaited(lambda: heading_said(program) == max(said), "a replay to the end")
        program.key("ctrl+q")
        assert program.ended() == (0, "")
