"""Benchmarks with real scans: chances of agreement, echoes of a known scan, and a folder with another layout."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom
from sonarhw_compare.match import compare_readings
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import load_room

from benchmarks.real.heard_paths import first_echoes
from benchmarks.real.judged_scans import load_scans
from benchmarks.real.located_scans import chance_of_agreement
from sonarhw.readings import Reading

SPEED = 343.0  # m/s


def test_chance_of_agreement_is_binomial() -> None:
    assert chance_of_agreement([(0.82, True)] * 2) == 0.0  # rates of 0, 0.5 and 1 only
    # of rates of 0, 0.2, ... only 0.6 is within 0.1 of 0.53
    assert chance_of_agreement([(0.53, True)] * 5) == pytest.approx(float(binom.pmf(3, 5, 0.53)), abs=0.015)


def test_echoes_of_a_known_scan_are_heard_but_those_that_are_removed() -> None:
    room, board = load_room("rooms/arena.toml"), load_board("lego-nxt")
    place = room.place("p0")
    angles = np.radians(np.arange(0.0, 360.0, 10.0))
    ranges = predict_scan(room, place, board, angles + place.heading).ranges.tolist()
    removed = {0, 9, 18}
    readings = [
        Reading(k, 0, 0, float(angle), 0.0, () if k in removed or math.isnan(range_) else (2 * range_ / SPEED,), SPEED)
        for k, (angle, range_) in enumerate(zip(angles, ranges, strict=True))
    ]
    found = list(first_echoes("A", compare_readings(readings, room, place, board)))
    assert len(found) == int(np.isfinite(ranges).sum())
    unheard = [echo.range for echo in found if not echo.heard]
    assert unheard == [ranges[k] for k in sorted(removed) if not math.isnan(ranges[k])]
    assert len(unheard) > 0
    assert all(echo.over_threshold >= 0 and echo.reflections >= 1 for echo in found)


@pytest.mark.parametrize(
    ("listing", "message"),
    [
        (None, "scans.csv: no such file; --help describes the layout"),
        ("scan,x_m,y_m\n", "scans.csv: no column turn; --help describes the layout"),
        ("scan,x_m,y_m,turn\nA00,1,1,cw\n", "A00.csv: no such file, but scans.csv lists it"),
    ],
)
def test_another_layout_gives_one_line(tmp_path: Path, listing: str | None, message: str) -> None:
    if listing is not None:
        (tmp_path / "scans.csv").write_text(listing)
    with pytest.raises(SystemExit) as ended:
        load_scans(tmp_path)
    assert message in str(ended.value)
    assert "\n" not in str(ended.value)


def test_a_missing_folder_gives_one_line(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match=r"no such folder: .*nowhere; --help describes the layout"):
        load_scans(tmp_path / "nowhere")
