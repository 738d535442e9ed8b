"""Benchmarks with real scans: what is learned on them, echoes of a known scan, and a folder with another layout."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.special import expit
from sonarhw_compare.match import compare_readings
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import load_room

from benchmarks.real.heard_paths import first_echoes
from benchmarks.real.judged_scans import load_scans
from benchmarks.real.located_scans import Outcome, learned_on
from sonarhw.readings import Reading

SPEED = 343.0  # m/s


def test_the_correlation_of_neighbouring_readings_is_learned_on_scans_at_known_places() -> None:
    random, alike = np.random.default_rng(0), 0.4
    angles, ranges = np.radians(np.arange(0.0, 55.0, 5.0)), np.ones(11)
    share = 1 / (1 + 10 * alike)  # true one of each reading
    better = random.uniform(-2.0, 2.0, 600)
    first = random.random(600) < expit(better * 11 * share)
    outcomes = [
        Outcome(
            "S",
            str(k),
            "",
            angles,
            ranges,
            right=np.array([right, not right]),
            mirrored=np.zeros(2, np.bool_),
            log_likelihoods=np.outer([ahead, 0.0], ranges),
            priors=np.zeros(2),
            explained=0.8,
            unit=1.0,
            seconds=0.0,
        )
        for k, (ahead, right) in enumerate(zip(better.tolist(), first.tolist(), strict=True))
    ]
    found = learned_on(outcomes, [0.5, 0.6, 0.7, 0.75])
    assert found.alike == pytest.approx(alike, rel=0.2)
    assert found.usual_explained == pytest.approx(0.8)
    assert found.chance_of_nothing(0.8) < 0.1 < found.chance_of_nothing(0.5)


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
