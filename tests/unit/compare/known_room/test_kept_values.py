"""A value that the profile states stays until the scans contradict it."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest
import sonarhw_compare.calibration.room as calibration
from sonarhw_compare.calibration.outcome import Measured
from sonarhw_compare.calibration.room import RoomCalibration, TurntableFit
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.room.room import Place, load_room


def begun(start: Board, board: Board) -> RoomCalibration:
    room = load_room("arena")
    return RoomCalibration(start, board, scans=(), given=room, room=room)


@pytest.mark.parametrize(
    ("stated", "expected", "is_kept"),
    [
        (3.8, 3.8, True),  # in the interval of 2.6 ± 1.6 dB
        (4.5, 2.6, False),
        (0.0, 2.6, False),  # no spread is stated
    ],
)
def test_a_stated_spread_stays_if_the_scans_do_not_contradict_it(
    monkeypatch: pytest.MonkeyPatch, stated: float, expected: float, is_kept: bool
) -> None:
    def found(
        _scans: Sequence[PlacedScan], _room: object, _board: Board, _places: Sequence[Place], _tick: Callable[[], None]
    ) -> tuple[Measured, Measured]:
        return Measured(0.014, 0.001), Measured(2.6, 0.8)

    monkeypatch.setattr(calibration, "spreads", found)
    start = replace(load_board("lego-nxt"), threshold_sd_db=stated, range_sd=0.0)
    result = begun(start, start)
    calibration._find_spreads(result, (), lambda: None)
    assert result.board.threshold_sd_db == expected
    assert result.board.range_sd == 0.014
    assert ("threshold_sd_db" in result.kept) is is_kept
    assert [one.key for one in result.findings] == ([] if is_kept else ["threshold_sd_db"]) + ["range_sd"]


@pytest.mark.parametrize(
    ("scale", "deviation", "expected"),
    [
        (1.024, 0.012, 1.0),  # 2 standard deviations: one of five values is as far away in a fifth of all calibrations
        (1.024, 0.008, 1.024),
        (1.002, 0.002, 1.0),  # well determined, and not contradicted
        (0.94, 0.04, 1.0),
    ],
)
def test_a_geometry_stays_if_the_scans_do_not_contradict_it(scale: float, deviation: float, expected: float) -> None:
    start = load_board("lego-nxt")
    shared = {
        key: Measured(float(getattr(start, key)), 0.01)
        for key in ("range_offset", "clock_error", "turntable_scale", "axis_x", "axis_y")
    }
    fitted = TurntableFit(shared | {"turntable_scale": Measured(scale, deviation)}, ())
    result = begun(start, replace(start, turntable_scale=1.03))  # where the search began
    calibration._find_geometry(result, fitted)
    assert result.board.turntable_scale == expected
    assert ("turntable_scale" in result.kept) is (expected == 1.0)
    assert result.board.range_offset == start.range_offset
