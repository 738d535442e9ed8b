"""Columns are guessed by unambiguous names; otherwise the file is rejected with a remedy."""

from pathlib import Path

import pytest
from sonarhw_compare.foreign_csv import CsvColumns, guess_columns, likely_no_echo, read_foreign_scan

from sonarhw.errors import InputError


def written(folder: Path, header: str) -> Path:
    path = folder / "scan.csv"
    path.write_text(f"{header}\n0,0,100\n1,5,200\n")
    return path


@pytest.mark.parametrize(
    ("header", "columns", "scale"),
    [
        ("turret_deg,x,range_cm", CsvColumns("turret_deg", "range_cm"), 0.01),
        ("time_s,heading_deg,range_m", CsvColumns("heading_deg", "range_m", "time_s"), 1.0),
        ("t,Angle,Distance (mm)", CsvColumns("Angle", "Distance (mm)", "t"), 0.001),
        ("n,deg,cm", CsvColumns("deg", "cm"), 0.01),
        ("max_range,angle,range_min,distance_min", CsvColumns("angle", "range_min"), 1.0),
        ("n,bearing,range", CsvColumns("bearing", "range"), 1.0),
    ],
)
def test_columns_and_unit_are_guessed_from_names(
    tmp_path: Path, header: str, columns: CsvColumns, scale: float
) -> None:
    guessed, meaning = guess_columns(written(tmp_path, header))
    assert (guessed, meaning.scale, meaning.sign) == (columns, scale, 1.0)


def test_a_file_with_guessed_columns_is_read(tmp_path: Path) -> None:
    path = written(tmp_path, "time_s,heading_deg,range_cm")
    readings = read_foreign_scan(path, *guess_columns(path))
    assert [reading.time for reading in readings] == [0.0, 1.0]
    assert [reading.range for reading in readings] == pytest.approx([1.0, 2.0])


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("a,b,range", "a name for a heading"),
        ("heading,b,c", "a name for a range"),
        ("heading_left,heading_right,range", "a name for a heading"),
    ],
)
def test_missing_and_ambiguous_columns_are_rejected(tmp_path: Path, header: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as rejected:
        guess_columns(written(tmp_path, header))
    assert "--heading COL" in str(rejected.value)


@pytest.mark.parametrize(
    ("ranges", "found"),
    [
        ([0.0] * 3 + [1.0, 2.0], (0.0, 3)),
        ([0.0] * 2 + [1.0, 2.0], None),  # fewer than three
        ([4.0] * 3 + [0.1 * k for k in range(1, 28)], (4.0, 3)),  # a tenth of the readings, at the longest range
        ([4.0] * 3 + [0.1 * k for k in range(1, 29)], None),  # less than a tenth
        ([1.0] * 3 + [0.5, 2.0], None),  # neither 0 nor the longest
        ([2.0] * 5, None),  # a round tank
    ],
)
def test_a_frequent_range_of_0_or_the_longest_likely_stands_for_no_echo(
    tmp_path: Path, ranges: list[float], found: tuple[float, int] | None
) -> None:
    file = tmp_path / "scan.csv"
    file.write_text("heading,range\n" + "".join(f"{k},{value!r}\n" for k, value in enumerate(ranges)))
    assert likely_no_echo(file, CsvColumns("heading", "range")) == found
