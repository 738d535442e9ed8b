"""The picture of a calibration names the origin of the readings, and states no negative range."""

import math

from sonarhw_compare.calibration.room import RoomCalibration
from sonarhw_compare.drawings import draw_calibration
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.match import compare_readings
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

from sonarhw.readings import Origin, Reading


def test_readings_of_a_fake_scanner_are_not_called_measured_and_silence_has_no_range() -> None:
    room, board = load_room("simple"), load_board("paper")
    place = room.place("figure9")
    readings = [
        Reading(k, 0, 0, math.radians(10 * k), 0.0, () if k > 30 else (0.004,), 344.0, origin=Origin.FAKE)
        for k in range(36)
    ]
    shown = (compare_readings(readings, room, place, board),)
    scans = [PlacedScan(readings, place, "a")]
    found = RoomCalibration(board, board, scans=scans, given=room, room=room, before=shown, after=shown)
    figure = draw_calibration(found)
    figure.draw_without_rendering()
    assert [text.get_text() for text in figure.legends[0].texts] == ["predicted", "fake (grey band: no echo)"]
    axes = figure.axes[0]
    written = {label.get_position()[1]: label.get_text() for label in axes.get_yticklabels()}
    assert min(written) < 0
    assert all((text == "") == (value < 0) for value, text in written.items())
