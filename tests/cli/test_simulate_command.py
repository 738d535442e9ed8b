"""`simulate` and `paths` as a user runs them: the promised columns, the paper's figures, formats, and refusals."""

import csv
import io
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cli.app import run
from cli.numbers import bearing
from sonarhw.log import read_log

ROOM = "rooms/simple.toml"
FIGURE_9 = [ROOM, "--place", "figure9"]


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


def test_every_format_says_the_same(tmp_path: Path) -> None:
    for name in ("scan.csv", "scan.npz", "scan.mcap", "scan.png"):
        assert run(["simulate", *FIGURE_9, "--out", str(tmp_path / name)]) == 0
    ranges = [float(row["range_m"]) for row in rows((tmp_path / "scan.csv").read_text())]
    assert np.load(tmp_path / "scan.npz")["range_m"] == pytest.approx(ranges)
    log = read_log(tmp_path / "scan.mcap")
    assert [reading.range for reading in log.readings] == pytest.approx(ranges, abs=1e-6)
    assert log.metadata.made_by == "simulate"
    assert (tmp_path / "scan.png").read_bytes().startswith(b"\x89PNG")


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
        ["paths", ROOM, "--place", "atlantis"],
        ["compare", "nowhere.mcap", "--room", ROOM],
    ],
)
def test_wrong_use_is_one_line_and_exit_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("sonarhw: ")
    assert captured.err.count("\n") == 1


def test_closed_pipe_ends_quietly() -> None:
    command = [sys.executable, "-c", "from cli.app import main; main()", "paths", *FIGURE_9]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == b""
        assert process.wait() == 0


def test_help_tells_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--help"]) == 0
    out = capsys.readouterr().out
    promised = "demo ports info scan home turn stop monitor fake simulate paths import replay log compare gui"
    assert [name for name in promised.split() if f"\n  {name} " not in out] == []


def test_fine_scan_of_a_room_full_of_paths_fits_in_memory(capsys: pytest.CaptureFixture[str]) -> None:
    import resource

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert run(["simulate", "rooms/laboratory.toml", "--place", "bench", "--step", "0.2"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 1801
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 400e3  # kB; whole matrices took 1.5 GB


def test_a_direction_is_never_360_degrees() -> None:
    assert bearing(-1e-17) == 0.0
    assert bearing(-math.pi / 2) == 270.0
