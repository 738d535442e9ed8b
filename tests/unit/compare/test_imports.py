"""Columns of foreign tables are guessed by unambiguous names, and means of pings are recognised."""

import math
from pathlib import Path

import numpy as np
import pytest
from sonarhw_compare.foreign_csv import CsvColumns, guess_columns, likely_no_echo, read_foreign_scan

from sonarhw.errors import InputError
from sonarhw.mean_ranges import are_means, likely_pings, unit_of
from sonarhw.readings import FloatArray


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


SILENT = 2.55  # m


TARGETS = (0.51, 2.14, 0.30, SILENT, 0.87, 1.76, SILENT, 0.42, 1.30, 0.66, 2.02, SILENT)


def pings(seed: int) -> FloatArray:
    """Return one range for each of 720 headings, m: 60 from each target, and some of the next one early."""
    ranges = np.repeat(TARGETS, 60)
    early = np.random.default_rng(seed).random(len(ranges)) < np.tile(np.linspace(-6, 1, 60), len(TARGETS))
    return np.where(early, np.roll(ranges, -60), ranges)


def windows(seed: int, count: int) -> FloatArray:
    """Return the latest `count` pings at every second heading, (360, count) m."""
    together = np.lib.stride_tricks.sliding_window_view(pings(seed), count)
    return np.asarray(together[: 2 * 355 : 2])


def cut_off(ranges: FloatArray) -> FloatArray:
    """Return ranges in whole centimetres, m, as a program with whole numbers divides."""
    return np.asarray(np.floor(ranges * 100 + 1e-6) / 100)


@pytest.mark.parametrize("count", [3, 4, 5])
def test_means_of_pings_are_recognised_and_only_mixed_ones_are_marked(count: int) -> None:
    together = windows(1, count)
    ranges = cut_off(together.mean(axis=1))
    assert likely_pings([ranges], 0.01) == count
    marked = are_means(ranges, 0.01, count)
    mixed = np.ptp(together, axis=1) > 0
    assert marked.sum() >= 0.5 * mixed.sum()
    assert not (marked & ~mixed).any()


@pytest.mark.parametrize("seed", range(20))
def test_medians_of_the_same_pings_are_no_means(seed: int) -> None:
    assert likely_pings([cut_off(np.median(windows(seed, 5), axis=1))], 0.01) is None


@pytest.mark.parametrize("seed", range(20))
def test_measured_ranges_between_two_walls_are_no_means(seed: int) -> None:
    random = np.random.default_rng(seed)
    between = random.uniform(0.55, 2.05, (9, 4))
    scan = [part for several in between for part in ([0.5] * 8, several, [2.1] * 8)]
    assert likely_pings([cut_off(np.concatenate(scan))], 0.01) is None


def test_one_mean_that_several_readings_have_is_no_proof() -> None:
    scan = [0.50] * 8 + [0.80] * 4 + [2.00] * 8
    assert likely_pings([np.array(scan * 3)], 0.01) is None


def test_silence_without_a_number_is_in_no_mean() -> None:
    ranges = cut_off(windows(1, 5).mean(axis=1))
    ranges[ranges == SILENT] = math.nan
    marked = are_means(ranges, 0.01, 5)
    assert marked.any()
    assert not marked[np.isnan(ranges)].any()


@pytest.mark.parametrize(
    ("ranges", "scale", "unit"),
    [([51, 255], 0.01, 0.01), ([0.51, 2.55], 1.0, 0.01), ([0.5, 2.0], 1.0, 0.1), ([math.nan, 3.0], 1.0, 1.0)],
)
def test_the_unit_is_the_last_digit_of_the_ranges(ranges: list[float], scale: float, unit: float) -> None:
    assert unit_of(np.array(ranges) * scale, scale) == pytest.approx(unit)
