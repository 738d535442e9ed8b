"""`sonarhw simulate` and `sonarhw paths`: columns, the paper's figures, formats, and refused options."""

import csv
import io
import json
import math
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from sonarhw_cli.app import run
from sonarhw_sim.board.profile import load_board

from sonarhw.log import read_log
from sonarhw.readings import FloatArray

ROOM = "rooms/simple.toml"
FIGURE_9 = [ROOM, "--place", "figure9"]
IDEAL = ["--receiver", "first-echo"]


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_figure_9_from_the_command_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["simulate", *FIGURE_9, "--board", "paper", "--from", "90", "--to", "300", "--step", "10"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("heading_deg,range_m,path_m,level_db,bounces,via\n")
    by_heading = {row["heading_deg"]: row for row in rows(out)}
    assert (by_heading["90"]["range_m"], by_heading["90"]["via"]) == ("0.657", "top")
    assert (by_heading["270"]["range_m"], by_heading["270"]["via"]) == ("0.827", "bottom>top>bottom")
    assert float(by_heading["140"]["range_m"]) == pytest.approx(1.015, abs=1e-3)
    assert len(by_heading) == 21


def test_whole_circle_by_fives_is_72_headings(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["simulate", *FIGURE_9]) == 0
    assert len(rows(capsys.readouterr().out)) == 72


def test_no_echo_leaves_all_but_the_heading_empty(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["simulate", "rooms/right_corner.toml", "--place", "figure12", "--from", "180", "--to", "185"]) == 0
    assert capsys.readouterr().out.splitlines()[1] == "180,,,,,"


def test_paths_list_the_corner_once(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["paths", *FIGURE_9, "--max-range", "1.1"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("length_m,departure_deg,arrival_deg,gain,bounces,via\n")
    corner = [row for row in rows(out) if row["via"] in ("top>left", "left>top")]
    assert [(row["bounces"], row["gain"], row["via"]) for row in corner] == [("2", "0.9025", "top>left")]
    lengths = [float(row["length_m"]) for row in rows(out)]
    assert lengths == sorted(lengths)
    assert lengths[-1] <= 2.2


def test_paths_end_at_the_wanted_number_of_bounces(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["paths", *FIGURE_9, "--max-bounces", "1"]) == 0
    assert sorted(row["via"] for row in rows(capsys.readouterr().out)) == ["bottom", "left", "right", "top"]


def test_all_formats_contain_the_same_ranges(tmp_path: Path) -> None:
    for name in ("scan.csv", "scan.npz", "scan.mcap", "scan.png"):
        assert run(["simulate", *FIGURE_9, "--out", str(tmp_path / name)]) == 0
    ranges = [float(row["range_m"]) for row in rows((tmp_path / "scan.csv").read_text())]
    assert np.load(tmp_path / "scan.npz")["range_m"] == pytest.approx(ranges)
    log = read_log(tmp_path / "scan.mcap")
    assert [reading.range for reading in log.readings] == pytest.approx(ranges, abs=1e-6)
    assert log.metadata.made_by == "simulate"
    assert (tmp_path / "scan.png").read_bytes().startswith(b"\x89PNG")


def test_board_receiver_reads_slightly_longer_ranges_by_the_same_paths(capsys: pytest.CaptureFixture[str]) -> None:
    few = ["simulate", *FIGURE_9, "--from", "90", "--to", "300", "--step", "90"]
    assert run([*few, "--receiver", "first-echo"]) == 0
    first = rows(capsys.readouterr().out)
    assert run([*few, "--receiver", "board"]) == 0
    own = rows(capsys.readouterr().out)
    assert [row["via"] for row in own] == [row["via"] for row in first]
    late = [float(a["range_m"]) - float(b["range_m"]) for a, b in zip(own, first, strict=True)]
    assert all(0 < by < 0.01 for by in late)


def changed_board(path: Path, line: str) -> str:
    """Write a board profile, that of the 6500 with one additional line; return its name."""
    path.write_text(line + "\n" + Path("sim/sonarhw_sim/board/shipped/polaroid-6500.toml").read_text())
    return str(path)


def test_the_receiver_of_the_profile_is_the_default(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own = tmp_path / "own.toml"
    shipped = Path("sim/sonarhw_sim/board/shipped/polaroid-6500.toml").read_text()
    own.write_text(shipped.replace('receiver = "board"', 'receiver = "first-echo"'))
    few = ["simulate", *FIGURE_9, "--from", "90", "--to", "300", "--step", "90"]
    answers = []
    ideal = ["--board", str(own)]
    for more in ([], [*ideal, "--receiver", "board"], ["--receiver", "first-echo"], ideal):
        assert run([*few, *more]) == 0
        answers.append(capsys.readouterr().out)
    assert answers[0] == answers[1] != answers[2] == answers[3]


def test_traces_contain_the_echo_that_the_board_reports(tmp_path: Path) -> None:
    few = ["simulate", *FIGURE_9, "--from", "90", "--to", "91", "--receiver", "board"]
    for kind in ("rf", "sampled", "envelope"):
        assert run([*few, "--traces", kind, "--out", str(tmp_path / f"{kind}.npz")]) == 0
    for kind, rate, full in (("rf", 1e6, 1.0), ("sampled", 16e6 / 208, 128), ("envelope", 50e3, 1.0)):
        kept = np.load(tmp_path / f"{kind}.npz")
        assert kept["trace_rate_hz"] == rate
        trace = np.abs(kept["trace"][0].astype(float)) / full
        assert len(trace) == math.ceil(2 * 10.7 / 343.9867 * rate)
        times = np.arange(len(trace)) / rate
        arrival = 2 * kept["range_m"][0] / 343.9867
        # silence from the end of blanking to the reported echo
        assert trace[(times > 2.38e-3) & (times < 2 * 0.657 / 343.9867)].max() < 0.01
        assert trace[(times > arrival) & (times < arrival + 1e-4)].max() > 0.1


@pytest.mark.parametrize(
    ("form", "out", "needed"),
    [
        ("rf", "x.npz", "36000 traces of 62212 samples need 9.0 GB, at most 4 GB"),
        ("envelope", "x.mcap", "36000 traces of 3111 samples need 0.9 GB, at most 0.5 GB"),
    ],
)
def test_traces_that_are_too_large_are_refused_before_the_prediction(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    form: str,
    out: str,
    needed: str,
) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError

    monkeypatch.setattr("sonarhw_sim.predict.prediction.predict_with", refuse)
    fine = ["simulate", *FIGURE_9, "--step", "0.01", "--traces", form, "--out", str(tmp_path / out)]
    assert run(fine) == 2
    assert capsys.readouterr().err == (
        f"sonarhw: --traces {form}: {needed} are possible; give a larger --step or a lower --rate\n"
    )
    assert [*tmp_path.iterdir()] == []


def test_traces_in_an_npz_file_are_written_one_by_one(tmp_path: Path) -> None:
    """All traces together would need 90 MB."""
    out = tmp_path / "x.npz"
    tracemalloc.start()
    try:
        assert run(["simulate", *FIGURE_9, "--step", "1", "--traces", "rf", "--out", str(out)]) == 0
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert np.load(out)["trace"].shape == (360, 62212)
    assert peak < 60e6


@pytest.mark.parametrize("stop", ["1e-9", "1e-300"])
def test_a_sector_narrower_than_a_step_has_one_heading(capsys: pytest.CaptureFixture[str], stop: str) -> None:
    assert run(["simulate", *FIGURE_9, "--to", stop]) == 0
    assert [row["heading_deg"] for row in rows(capsys.readouterr().out)] == ["0"]


def test_noise_is_the_same_for_the_same_seed(tmp_path: Path) -> None:
    def trace(*options: str) -> FloatArray:
        few = ["simulate", *FIGURE_9, "--from", "90", "--to", "91", "--traces", "rf", *options]
        assert run([*few, "--out", str(tmp_path / "trace.npz"), "--force"]) == 0
        return np.asarray(np.load(tmp_path / "trace.npz")["trace"], dtype=np.float64)

    noisy = trace("--noise", "0.01", "--seed", "3")
    assert (noisy == trace("--noise", "0.01", "--seed", "3")).all()
    assert (noisy != trace("--noise", "0.01", "--seed", "4")).any()
    assert np.std(noisy - trace()) == pytest.approx(0.01, rel=0.2)


def test_grain_changes_the_sound_of_rough_surfaces_only(capsys: pytest.CaptureFixture[str]) -> None:
    def reading(degrees: str, *options: str) -> str:
        place = ["rooms/doorstep.toml", "--place", "tripod", "--from", degrees, "--to", degrees + ".5"]
        assert run(["simulate", *place, *options]) == 0
        return capsys.readouterr().out

    rug, north = "25", "90"
    assert len({reading(rug, *options) for options in ((), ("--grain", "1"), ("--grain", "2"))}) == 3
    assert reading(north, "--grain", "1") == reading(north)


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (FIGURE_9, "no surface of room 'Simple room' has scatter"),
        (["rooms/doorstep.toml", "--place", "plan", "--model", "cone"], "has no effect with --model cone"),
    ],
)
def test_grain_without_effect_is_refused(capsys: pytest.CaptureFixture[str], command: list[str], message: str) -> None:
    assert run(["simulate", *command, "--grain", "1"]) == 2
    assert message in capsys.readouterr().err


def test_log_contains_envelopes_and_every_echo_of_the_board(tmp_path: Path) -> None:
    out = tmp_path / "scan.mcap"
    few = ["simulate", *FIGURE_9, "--from", "90", "--to", "91", "--receiver", "board", "--traces", "envelope"]
    assert run([*few, "--out", str(out)]) == 0
    reading = read_log(out).readings[0]
    assert reading.trace is not None
    assert reading.trace.rate == pytest.approx(50e3)
    assert reading.range == pytest.approx(0.66, abs=0.01)
    assert len(reading.echo_times) > 5
    assert np.diff(reading.echo_times).min() >= 0.44e-3


def test_compare_accepts_the_receiver_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "scan.mcap")
    assert run(["simulate", *FIGURE_9, "--receiver", "board", "--out", out]) == 0
    errors = {}
    for receiver in ("board", "first-echo"):
        assert run(["compare", out, "--receiver", receiver, "--json"]) == 0
        summary = json.loads(capsys.readouterr().out)
        errors[receiver] = summary["median_abs_error_m"]
        assert receiver == "first-echo" or (summary["matched"], summary["explained"]) == (72, 1.0)
    assert errors["board"] < 1e-6
    assert errors["first-echo"] > 0.002


def test_trace_too_long_for_a_log_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    far = tmp_path / "far.toml"
    far.write_text(Path("sim/sonarhw_sim/board/shipped/polaroid-6500.toml").read_text().replace("10.7 ", "20.0 "))
    out = tmp_path / "scan.mcap"
    few = ["simulate", *FIGURE_9, "--board", str(far), "--from", "90", "--to", "91"]
    assert run([*few, "--traces", "envelope", "--rate", "1e6", "--out", str(out)]) == 2
    assert "a trace in a log has at most 65535 samples" in capsys.readouterr().err
    assert not out.exists()


def test_readings_in_the_near_field_give_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    near = changed_board(tmp_path / "near.toml", "blanking_inhibit = 0.0004")
    assert run(["simulate", *FIGURE_9, "--board", near, "--from", "270", "--to", "271", *IDEAL]) == 0
    captured = capsys.readouterr()
    assert float(rows(captured.out)[0]["range_m"]) == pytest.approx(0.085)
    assert captured.err.startswith("sonarhw: warning: 1 reading nearer than 0.106 m")


def test_simulated_log_keeps_turntable_angles(tmp_path: Path) -> None:
    out = tmp_path / "door.mcap"
    door = ["rooms/laboratory.toml", "--place", "door", "--from", "45", "--to", "135", "--step", "45"]
    assert run(["simulate", *door, "--out", str(out)]) == 0
    assert [math.degrees(r.angle) for r in read_log(out).readings] == pytest.approx([0.0, 45.0])


def test_existing_file_is_refused_without_force(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "scan.csv"
    out.write_text("precious")
    assert run(["simulate", *FIGURE_9, "--out", str(out)]) == 2
    assert "exists already" in capsys.readouterr().err
    assert out.read_text() == "precious"
    assert run(["simulate", *FIGURE_9, "--out", str(out), "--force"]) == 0


@pytest.mark.parametrize(
    "arguments",
    [
        ["bogus"],
        ["simulate"],
        ["simulate", "nowhere.toml"],
        ["simulate", ROOM],
        ["simulate", *FIGURE_9, "--step", "0"],
        ["simulate", *FIGURE_9, "--from", "nan"],
        ["simulate", *FIGURE_9, "--step", "1e-300"],
        ["simulate", *FIGURE_9, "--to", "1e300"],
        ["simulate", ROOM, "--place", "1e300,1"],
        ["simulate", *FIGURE_9, "--board", "unheard-of"],
        ["simulate", *FIGURE_9, "--out", "scan.docx"],
        ["simulate", *FIGURE_9, "--receiver", "best"],
        ["simulate", *FIGURE_9, "--traces", "rf"],
        ["simulate", *FIGURE_9, "--traces", "rf", "--out", "scan.mcap"],
        ["simulate", *FIGURE_9, "--traces", "envelope", "--out", "scan.csv"],
        ["simulate", *FIGURE_9, "--rate", "50000"],
        ["simulate", *FIGURE_9, "--traces", "rf", "--out", "scan.npz", "--rate", "2e6"],
        ["simulate", *FIGURE_9, "--traces", "rf", "--out", "scan.npz", "--rate", "nan"],
        ["simulate", *FIGURE_9, *IDEAL, "--noise", "0.01"],
        ["simulate", *FIGURE_9, "--receiver", "board", "--noise", "nan"],
        ["simulate", *FIGURE_9, "--sections", "3"],
        ["simulate", *FIGURE_9, "--model", "cone", "--unit", "reflect"],
        ["paths", ROOM, "--place", "atlantis"],
        ["paths", *FIGURE_9[:3], "--max-range", "inf"],
        ["compare", "nowhere.mcap", "--room", ROOM],
    ],
)
def test_wrong_usage_gives_an_error_of_one_line_and_exit_status_2(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("sonarhw: ")
    assert captured.err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--receiver", "x"], "--receiver x: expected first-echo or board"),
        (["--unit", ""], "--unit : expected pass, block or reflect"),
        (["--sections", "1e3"], "--sections 1e3: expected a whole number"),
        (["--sections", "0"], "--sections 0: expected a number greater than or equal to 1"),
        (["--step", "x"], "--step x: expected a number"),
    ],
)
def test_messages_of_the_option_parser_are_reworded(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["simulate", *FIGURE_9, *arguments]) == 2
    assert capsys.readouterr().err == f"sonarhw: {message}\n"


@pytest.mark.parametrize(
    ("sector", "found", "advice"),
    [
        ((90, 0, 5), "with a positive --step (5), --to must be larger than --from", "such as 360, or --step -5"),
        ((0, 90, -5), "with a negative --step (-5), --to must be smaller than --from", "such as -270, or --step 5"),
        ((90, 90, 5), "with a positive --step (5), --to must be larger than --from", "such as 450"),
        ((0, 90, 0), "--step 0: expected a step other than 0 degrees", ""),
        ((0, 90, 1e-320), "too many headings", "give a larger step"),
    ],
)
def test_a_sector_without_a_heading_is_refused_with_the_reason(
    sector: tuple[float, float, float], found: str, advice: str, capsys: pytest.CaptureFixture[str]
) -> None:
    start, stop, step = map(str, sector)
    assert run(["simulate", *FIGURE_9, "--from", start, "--to", stop, "--step", step]) == 2
    error = capsys.readouterr().err
    assert found in error
    assert error.endswith(f"{advice}\n")


@pytest.mark.parametrize(
    ("start", "stop", "advice"),
    [
        ("0", "6.28", "--from 0, --to 6.28: taken as degrees; if they are radians, give --from 0, --to 360"),
        ("-1.57", "1", "--from -1.57, --to 1: taken as degrees; if they are radians, give --from -90, --to 57.2958"),
        ("0", "3", None),
        ("3.14", "14", None),
    ],
)
def test_radians_give_a_warning(start: str, stop: str, advice: str | None, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["simulate", *FIGURE_9, "--from", start, "--to", stop]) == 0
    assert capsys.readouterr().err == ("" if advice is None else f"sonarhw: warning: {advice}\n")


def test_a_place_outside_the_room_gives_a_warning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    room, log = FIGURE_9[0], str(tmp_path / "scan.mcap")
    warning = "sonarhw: warning: place '5,5' at 5, 5 m is outside room 'Simple room'\n"
    assert run(["simulate", room, "--place", "0.5,0.5", "--step", "90", "--out", log]) == 0
    assert capsys.readouterr().err == f"{log}: written\n"
    for command in (["simulate", room, "--step", "90"], ["paths", room], ["compare", log, "--room", room]):
        assert run([*command, "--place", "5,5"]) == 0
        assert capsys.readouterr().err.startswith(warning)


def test_fine_scan_of_a_room_full_of_paths_fits_in_memory(capsys: pytest.CaptureFixture[str]) -> None:
    import resource

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert run(["simulate", "rooms/laboratory.toml", "--place", "bench", "--step", "0.2"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 1801
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 400e3  # kB; whole matrices took 1.5 GB


def test_place_with_a_height_detects_a_step_below_it(capsys: pytest.CaptureFixture[str]) -> None:
    place = ["rooms/doorstep.toml", "--place", "robot"]
    assert run(["paths", *place, "--max-range", "1.5", "--no-diffraction"]) == 0
    listed = {row["via"]: row for row in rows(capsys.readouterr().out)}
    assert float(listed["floor>step"]["length_m"]) == pytest.approx(2 * math.hypot(1.4, 0.25))
    for sections in ("1", "5"):
        assert run(["simulate", *place, "--from", "90", "--to", "95", "--sections", sections]) == 0
        assert rows(capsys.readouterr().out)[0]["via"] == "step/"
    assert run(["simulate", *place, "--from", "90", "--to", "95", "--edge-strength", "paper"]) == 0
    assert rows(capsys.readouterr().out)[0]["via"] == "floor>step"
    assert run(["simulate", *place, "--sections", "0"]) == 2


def spread_board(tmp_path: Path, name: str) -> str:
    lines = [
        line for line in load_board(name).text.splitlines() if not line.startswith(("threshold_sd_db", "range_sd"))
    ]
    row = next(k for k, line in enumerate(lines) if line.startswith("blanking"))
    lines[row:row] = ["threshold_sd_db = 3.0", "range_sd = 0.003"]
    (tmp_path / "mine.toml").write_text("\n".join(lines))
    return str(tmp_path / "mine.toml")


@pytest.mark.parametrize("name", ["polaroid-6500", "lego-nxt"])
def test_probabilities_add_up_to_1_at_each_heading(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    board = spread_board(tmp_path, name)
    assert run(["simulate", *FIGURE_9, "--board", board, "--probability", "--step", "15", "--pings", "5"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("heading_deg,range_m,probability,via\n")
    found = rows(out)
    for heading in range(0, 360, 15):
        here = [row for row in found if row["heading_deg"] == str(heading)]
        assert sum(float(row["probability"]) for row in here) == pytest.approx(1.0, abs=1e-7)
        assert [row["range_m"] for row in here].count("") == 1
    if name == "lego-nxt":
        ranges = np.array([float(row["range_m"]) for row in found if row["range_m"]]) * 100
        assert ranges == pytest.approx(np.round(ranges), abs=1e-9)


def test_without_any_spread_the_prediction_has_probability_1(capsys: pytest.CaptureFixture[str]) -> None:
    chosen = [*FIGURE_9, "--board", "paper", "--step", "30"]
    assert run(["simulate", *chosen]) == 0
    certain = rows(capsys.readouterr().out)
    assert run(["simulate", *chosen, "--probability", "--room-tolerance", "0"]) == 0
    captured = capsys.readouterr()
    likely = [row for row in rows(captured.out) if row["probability"] == "1"]
    assert [(row["range_m"], row["via"]) for row in likely] == [(row["range_m"], row["via"]) for row in certain]
    assert captured.err.count("board profile 'paper' has no threshold_sd_db") == 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--pings", "5"], "--pings 5: needs --probability"),
        (["--room-tolerance", "0.01"], "--room-tolerance 0.01: needs --probability"),
        (["--probability", "--pings", "2"], "--pings 2: expected an odd number"),
        (["--probability", "--model", "cone"], "--probability: needs --model ray-following"),
        (["--probability", "--noise", "0.1"], "--probability: expected neither --traces nor --noise"),
        (["--probability", "--out", "a.npz"], "--out a.npz: expected a name ending in .csv, or -"),
    ],
)
def test_options_that_do_not_fit_probabilities_are_refused(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["simulate", *FIGURE_9, *options]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith(f"sonarhw: {message}")
    assert not captured.out
