"""Poses of logs are read from a table; what is wrong with it is reported with its line."""

import math
from pathlib import Path

import pytest
from sonarhw_compare.locate import HEADER, UNKNOWN, PoseSpread, read_poses
from sonarhw_sim.room.room import Place

from sonarhw.errors import InputError

LOGS = [Path("folder/a.mcap"), Path("b.mcap")]


def table(folder: Path, *lines: str) -> Path:
    path = folder / "poses.csv"
    path.write_text("\n".join(lines))
    return path


def test_poses_come_in_the_order_of_the_logs(tmp_path: Path) -> None:
    read = read_poses(table(tmp_path, HEADER, "b.mcap,3,4,90,,", "a.mcap,1,2,0,0.03,2"), LOGS)
    (first, first_spread), (second, second_spread) = read
    assert (first.position, second.position) == ((1.0, 2.0), (3.0, 4.0))
    assert second.heading == pytest.approx(math.pi / 2)
    assert first_spread
    assert second_spread
    assert (first_spread.xy, first_spread.heading) == (0.03, pytest.approx(math.radians(2)))
    assert (second_spread.xy, second_spread.heading) == (0.0, 0.0)  # an empty standard deviation is exact


@pytest.mark.parametrize(
    ("row", "place", "spread"),
    [
        ("b.mcap,,,,,", Place("b", (0.0, 0.0)), UNKNOWN),
        ("b.mcap,,,180,,", Place("b", (0.0, 0.0), math.pi), PoseSpread(math.inf, 0.0)),
        ("b.mcap,,,180,,90", Place("b", (0.0, 0.0), math.pi), PoseSpread(math.inf, math.pi / 2)),
        ("b.mcap,1,2,,0.03,", Place("b", (1.0, 2.0)), PoseSpread(0.03, math.inf)),
    ],
)
def test_what_a_row_lacks_is_unknown_but_not_for_the_first_log(
    tmp_path: Path, row: str, place: Place, spread: PoseSpread
) -> None:
    rows = table(tmp_path, HEADER, "a.mcap,1,2,0,,", row)
    assert read_poses(rows, LOGS)[1] == (place, spread)
    with pytest.raises(InputError, match=r"b\.mcap: expected position and heading of the first log"):
        read_poses(rows, LOGS[::-1])


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["log,x,y"], "line 1: expected the header log,x_m"),
        ([], "poses.csv: the file is empty; expected the header log,x_m"),
        ([HEADER, "a.mcap,1,2,0,,"], "no row for b.mcap; expected one for each log, .* the rows are for a.mcap"),
        ([HEADER, "a.mcap,1,2,0,,", "a.mcap,1,2,0,,"], "line 3: a.mcap was given before"),
        ([HEADER, "a.mcap,1,,0,,"], "line 2: expected x and y, or neither"),
        ([HEADER, "a.mcap,,,90,0.03,2"], "line 2: expected x and y, or neither and no sd_xy_m"),
        ([HEADER, "a.mcap,1,2,,0.03,2"], "line 2: expected a heading, or no sd_heading_deg"),
        ([HEADER, "a.mcap,1,2,0"], "line 2: expected 6 columns"),
        (
            [HEADER.replace(",", ";"), "a.mcap;1,5;2;0;;"],
            "line 1: the columns are separated by semicolons; expected commas",
        ),
        ([HEADER, "a.mcap,1,5,2,0,,"], "line 2: expected 6 columns .*, got 7; write numbers with a point"),
        ([HEADER, 'a.mcap,"1,5",2,0,,'], "line 2: expected a number, such as 1.5, got '1,5'"),
        ([HEADER, "a.mcap,1,inf,0,,"], "line 2: expected a finite number"),
        ([HEADER, "a.mcap,1,2,0,-1,"], "line 2: expected standard deviations of 0 or more"),
        ([HEADER, "a.mcap,1,2,0,101,"], "line 2: expected standard deviations of at most 100 m and 180°, got 101 m"),
        ([HEADER, "a.mcap,1,2,0,,1e9"], "line 2: .* got 0 m and 1e\\+09°; leave position or heading, .* empty"),
        ([HEADER, "a.mcap," + 200_000 * "1"], "line 2: has more than 65536 characters; expected a table of poses"),
    ],
)
def test_a_wrong_table_is_refused(tmp_path: Path, lines: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_poses(table(tmp_path, *lines), LOGS)


def test_logs_of_one_name_are_told_apart_by_their_paths(tmp_path: Path) -> None:
    logs = [Path("a/scan.mcap"), Path("b/scan.mcap")]
    read = read_poses(table(tmp_path, HEADER, "b/scan.mcap,3,4,0,,", "./a/scan.mcap,1,2,0,,"), logs)
    assert [place.position for place, _ in read] == [(1.0, 2.0), (3.0, 4.0)]
    with pytest.raises(InputError, match=r"a/scan\.mcap and b/scan\.mcap have the same file name; expected rows with"):
        read_poses(table(tmp_path, HEADER, "scan.mcap,1,2,0,,"), logs)
    with pytest.raises(InputError, match=r"c/scan\.mcap and d/scan\.mcap have the same file name"):
        read_poses(table(tmp_path, HEADER, "c/scan.mcap,1,2,0,,", "d/scan.mcap,1,2,0,,"), logs[:1])


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"poses\.csv: no such file; give the name of a table of poses"):
        read_poses(tmp_path / "poses.csv", LOGS)


def test_a_table_in_another_encoding_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "poses.csv"
    file.write_bytes(b"\xff\xff\x01" + HEADER.encode())
    with pytest.raises(InputError, match=r"not UTF-8 text: byte 0xff; expected a table of poses \(CSV\) in UTF-8"):
        read_poses(file, LOGS)
