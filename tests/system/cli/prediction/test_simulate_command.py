"""`sonarhw simulate`: formats, traces, noise, memory, probabilities, and the mount of a board in all commands."""

import csv
import math
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from sonarhw_sim.board.profile import load_board

from sonarhw.log import read_log
from sonarhw.readings import FloatArray
from tests.fixtures.commands import SIMPLE_ROOM, printed, printed_json

FIGURE_9 = ("simulate", SIMPLE_ROOM, "--place", "figure9")
NORTH = (*FIGURE_9, "--from", "90", "--to", "91")
PROFILE = """
name = "mine"
aperture_radius = 0.0192
frequency = 49400.0
transmit_cycles = 16
blanking = 0.00238
max_range = 3.0
threshold_db = -35.0
absorption = false
"""


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(text.splitlines()))


def test_all_formats_contain_the_same_ranges(tmp_path: Path) -> None:
    for name in ("scan.csv", "scan.npz", "scan.mcap"):
        printed(*FIGURE_9, "--out", tmp_path / name)
    ranges = [float(row["range_m"]) for row in rows((tmp_path / "scan.csv").read_text())]
    assert np.load(tmp_path / "scan.npz")["range_m"] == pytest.approx(ranges)
    log = read_log(tmp_path / "scan.mcap")
    assert [reading.range for reading in log.readings] == pytest.approx(ranges, abs=1e-6)
    assert log.metadata.made_by == "simulate"


@pytest.mark.parametrize(
    ("kind", "rate", "full"), [("rf", 1e6, 1.0), ("sampled", 16e6 / 208, 128), ("envelope", 50e3, 1)]
)
def test_traces_contain_the_echo_that_the_board_reports(kind: str, rate: float, full: float, tmp_path: Path) -> None:
    printed(*NORTH, "--receiver", "board", "--traces", kind, "--out", tmp_path / "x.npz")
    kept = np.load(tmp_path / "x.npz")
    assert kept["trace_rate_hz"] == rate
    trace = np.abs(kept["trace"][0].astype(float)) / full
    assert len(trace) == math.ceil(2 * 10.7 / 343.9867 * rate)
    times = np.arange(len(trace)) / rate
    arrival = 2 * kept["range_m"][0] / 343.9867
    # silence from the end of blanking to the reported echo
    assert trace[(times > 2.38e-3) & (times < 2 * 0.657 / 343.9867)].max() < 0.01
    assert trace[(times > arrival) & (times < arrival + 1e-4)].max() > 0.1


def test_traces_in_an_npz_file_are_written_one_by_one(tmp_path: Path) -> None:
    """All traces together would need 90 MB."""
    tracemalloc.start()
    try:
        printed(*FIGURE_9, "--step", "1", "--traces", "rf", "--out", tmp_path / "x.npz")
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert np.load(tmp_path / "x.npz")["trace"].shape == (360, 62212)
    assert peak < 60e6


def test_noise_is_the_same_for_the_same_seed(tmp_path: Path) -> None:
    def trace(*options: str) -> FloatArray:
        printed(*NORTH, "--traces", "rf", *options, "--out", tmp_path / "trace.npz", "--force")
        return np.asarray(np.load(tmp_path / "trace.npz")["trace"], dtype=np.float64)

    noisy = trace("--noise", "0.01", "--seed", "3")
    assert (noisy == trace("--noise", "0.01", "--seed", "3")).all()
    assert (noisy != trace("--noise", "0.01", "--seed", "4")).any()
    assert np.std(noisy - trace()) == pytest.approx(0.01, rel=0.2)


def test_log_contains_envelopes_and_every_echo_of_the_board(tmp_path: Path) -> None:
    printed(*NORTH, "--receiver", "board", "--traces", "envelope", "--out", tmp_path / "scan.mcap")
    reading = read_log(tmp_path / "scan.mcap").readings[0]
    assert reading.trace.rate == pytest.approx(50e3)
    assert reading.range == pytest.approx(0.66, abs=0.01)
    assert len(reading.echo_times) > 5
    assert np.diff(reading.echo_times).min() >= 0.44e-3


def test_fine_scan_of_a_room_full_of_paths_fits_in_memory() -> None:
    import resource

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert len(rows(printed("simulate", "laboratory", "--place", "bench", "--step", "0.2"))) == 1800
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 400e3  # kB; whole matrices took 1.5 GB


@pytest.mark.parametrize("name", ["polaroid-6500", "lego-nxt"])
def test_probabilities_add_up_to_1_at_each_heading(name: str, tmp_path: Path) -> None:
    own = [line for line in load_board(name).text.splitlines() if not line.startswith(("threshold_sd", "range_sd"))]
    (tmp_path / "mine.toml").write_text("\n".join(["threshold_sd_db = 3.0", "range_sd = 0.003", *own]))
    options = ("--board", tmp_path / "mine.toml", "--probability", "--step", "15", "--pings", "5")
    out = printed(*FIGURE_9, *options)
    assert out.startswith("heading_deg,range_m,probability,via\n")
    for heading in range(0, 360, 15):
        here = [row for row in rows(out) if row["heading_deg"] == str(heading)]
        assert sum(float(row["probability"]) for row in here) == pytest.approx(1.0, abs=1e-7)
        assert [row["range_m"] for row in here].count("") == 1
    if name == "lego-nxt":
        ranges = np.array([float(row["range_m"]) for row in rows(out) if row["range_m"]]) * 100
        assert ranges == pytest.approx(np.round(ranges), abs=1e-9)


@pytest.mark.parametrize(
    ("lines", "step"),
    [("[mount]\nahead = 0.05\n", "45"), ("[ring]\nsensors = 4\nradius = 0.05\ninterval = 0.1\n", "90")],
)
def test_fake_scanner_and_comparison_use_the_mount_of_the_profile(lines: str, step: str, tmp_path: Path) -> None:
    board, log = tmp_path / "mine.toml", tmp_path / "scan.mcap"
    board.write_text(PROFILE + lines)
    in_room = ("--room", SIMPLE_ROOM, "--place", "figure9")
    url = f"fake:{SIMPLE_ROOM}?place=figure9&board={board}&seed=1&pace=max"
    printed("scan", url, *in_room, "--board", board, "--step", step, "--out", log)
    mounted = printed_json("compare", log, *in_room, "--board", board)
    on_axis = printed_json("compare", log, *in_room, "--board", "paper")
    assert mounted["n"] == 360 / int(step)
    assert mounted["median_abs_error_m"] < 0.02
    assert mounted["matched"] > on_axis["matched"] or on_axis["median_abs_error_m"] > 0.03
