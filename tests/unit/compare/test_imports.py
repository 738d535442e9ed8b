"""Files of other programs are read by what they state or contain, and means of pings are recognised."""

import json
import math
import re
import struct
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sonarhw_compare
from sonarhw_compare.imports import ImportedScan, ImportOptions, import_scan

from sonarhw.errors import InputError
from sonarhw.log import LogMetadata, read_log
from sonarhw.log.writer import write_scan
from sonarhw.mean_ranges import are_means, likely_pings, unit_of
from sonarhw.readings import FloatArray, Origin, Reading


def imported(folder: Path, text: str, **stated: Any) -> ImportedScan:
    file = folder / "scan.csv"
    file.write_text(text)
    return import_scan(file, ImportOptions(**stated))


def rows_of(scan: ImportedScan) -> list[tuple[float, float | None]]:
    """Return the angles in degrees and the ranges in millimetres."""
    return [
        (round(math.degrees(reading.angle), 2), None if reading.range is None else round(1000 * reading.range, 1))
        for reading in scan.readings
    ]


@pytest.mark.parametrize(
    ("header", "unit"),
    [
        ("turret_deg,x,range_cm", 10.0),
        ("bearing,n,Distance (mm)", 1.0),
        ("deg,n,cm", 10.0),
        ("Winkel (Grad),n,Abstand [m]", 1000.0),
        ("azimuth,index,range in", 25.4),
    ],
)
def test_the_names_of_columns_state_quantities_and_units(tmp_path: Path, header: str, unit: float) -> None:
    title = "Scan of the cellar\n3 March, by hand\n\n"
    scan = imported(tmp_path, f"{title}{header}\n0,7,100\n1,5,200\n2,5,\n")
    assert rows_of(scan) == [(0.0, 100 * unit), (1.0, 200 * unit), (2.0, None)]
    assert any("header" in fact for fact in scan.read_as)


@pytest.mark.parametrize(
    "text",
    [
        "deg,range_cm\n0,52.5\n5,\n10,60.5\n",
        "deg;range_cm\n0;52,5\n5;\n10;60,5\n",
        "deg\trange_cm\n0\t52,5\n5\t\n10\t60,5\n",
        "deg|range_cm\n0|52.5\n5|none\n10|60.5\n",
        '"deg","range, cm"\n"0","52,5"\n"5",""\n"10","60,5"\n',
        "range_cm,deg,,\n52.5,0,,\n,5,,\n60.5,10\n".replace("10\n", "10,,\n"),
        "time_s,deg,range_cm\n0,0,52.5\n1,5,-1\n2,10,60.5\n",
    ],
)
def test_separators_and_decimal_commas_are_recognised(tmp_path: Path, text: str) -> None:
    assert rows_of(imported(tmp_path, text)) == [(0.0, 525.0), (5.0, None), (10.0, 605.0)]


def test_times_are_used_if_their_unit_is_stated_and_they_only_grow(tmp_path: Path) -> None:
    rows = "0,10,50\n500,20,60\n900,30,70\n"
    scan = imported(tmp_path, f"time_ms,deg,cm\n{rows}")
    assert [reading.time for reading in scan.readings] == pytest.approx([0.0, 0.5, 0.9])
    scan = imported(tmp_path, f"t,deg,cm\n{rows}")  # no unit
    assert [reading.time for reading in scan.readings] == pytest.approx([0.0, 0.1, 0.2])
    scan = imported(tmp_path, "time_ms,deg,cm\n" + "500,10,50\n0,20,60\n")
    assert any("times are not used: they go back" in fact for fact in scan.read_as)
    with pytest.raises(InputError, match="they go back; sort the lines by time"):
        imported(tmp_path, "t,deg,cm\n500,10,50\n0,20,60\n", heading="deg", range="cm", time="t")


def test_columns_that_the_user_names_are_read_in_any_order_and_lose_no_reading(tmp_path: Path) -> None:
    turned = [0, 90, 45, 180, 10, 170, 20, 20, 160, 30, 1, 2, 3, 4, 5, 6, 120, 7, 8]
    text = "".join(f"{k},{angle},{1 + k / 10:.1f}\n" for k, angle in enumerate(turned))
    for header, names in (
        ("title\nk,a,b\n", {"heading": "a", "range": "b"}),
        ("", {"heading": "column 2", "range": "column 3"}),
    ):
        scan = imported(tmp_path, f"{header}{text}", **names)
        assert rows_of(scan) == [(float(angle), 1000 + 100.0 * k) for k, angle in enumerate(turned)]
        assert any("range in metres, because no unit is stated" in fact for fact in scan.read_as)
    assert rows_of(imported(tmp_path, f"k,a,b\n{text}", heading="a", range="b", unit="cm"))[0] == (0.0, 10.0)
    assert rows_of(imported(tmp_path, f"k,a,b\n{text}", heading="a", range="b", scale=0.1))[0] == (0.0, 100.0)


@pytest.mark.parametrize("angle", ["{:.0f}", "{:.4f}"], ids=["degrees", "radians"])
@pytest.mark.parametrize("span", [(0.5, 1.1), (50, 86), (120, 390), (300, 2900), (4.0, 31.0)])
def test_a_table_has_the_same_units_however_its_columns_are_named(
    tmp_path: Path, angle: str, span: tuple[float, float]
) -> None:
    def decided(**named: str) -> tuple[str, list[tuple[float, float | None]]]:
        try:
            return "", rows_of(imported(tmp_path, text, **named))
        except InputError as error:
            return str(error).partition(": unit")[2], []

    headings = [k * (10.0 if angle == "{:.0f}" else 0.1745) for k in range(36)]
    ranges = [span[0] + (span[1] - span[0]) * (k * 7 % 36) / 35 for k in range(36)]
    places = 1 if span[1] < 40 else 0
    rows = zip(headings, ranges, strict=True)
    text = "angle,dist\n" + "".join(f"{angle.format(a)},{r:.{places}f}\n" for a, r in rows)
    problem, recognised = decided()
    if "unit=m " in problem:  # metres are the default of columns that the user names
        problem, recognised = "", decided(unit="m")[1]
    assert decided(heading="angle", range="dist") == (problem, recognised)
    text = text.partition("\n")[2]
    assert decided(heading="column 1", range="column 2") == (problem, recognised)


@pytest.mark.parametrize(
    ("stated", "sign"), [({}, -1), ({"turn": "cw"}, -1), ({"turn": "ccw"}, 1)], ids=["named", "same", "other"]
)
def test_a_clockwise_angle_is_turned_once(tmp_path: Path, stated: dict[str, str], sign: int) -> None:
    rows = [(angle, 50 + angle) for angle in (10, 20, 30, 40, 50)]
    for text in (
        "angle_cw_deg,range_cm\n" + "".join(f"{angle},{cm}\n" for angle, cm in rows),
        "".join(f'{{"angle_cw_deg": {angle}, "range_cm": {cm}}}\n' for angle, cm in rows),
    ):
        scan = imported(tmp_path, text, **stated)
        assert rows_of(scan) == [(sign * angle, 10.0 * cm) for angle, cm in rows]


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        ({"heading": "deg", "range": "mm"}, "no column 'mm'; its columns: deg, a, a"),
        ({"heading": "deg", "range": "a"}, "more than one column 'a'"),
        ({"heading": "deg", "range": "deg"}, "'deg' is given for two quantities"),
        ({"heading": "deg"}, "name the columns of both heading and range"),
        ({"topic": "/sonar"}, "topic=/sonar: only for ROS bags; scan.csv has the format text of a device"),
        ({"threshold": 2.0}, "threshold=2: expected a share"),
        ({"scale": math.nan}, "scale=nan: expected a number above 0"),
        ({"unit": "mi"}, "unit=mi: expected m, cm"),
    ],
)
def test_options_that_do_not_fit_are_refused(tmp_path: Path, stated: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        imported(tmp_path, "deg,a,a\n0,1,2\n1,2,3\n2,3,4\n", **stated)


@pytest.mark.parametrize(
    ("ranges", "silent"),
    [
        ([4.0] * 3 + [0.1 * k for k in range(1, 28)], 4.0),  # a tenth of the readings, at the longest range
        ([4.0] * 3 + [0.1 * k for k in range(1, 29)], None),  # less than a tenth
        ([2.0] * 5, None),  # a round tank
    ],
)
def test_a_frequent_longest_range_is_no_echo(tmp_path: Path, ranges: list[float], silent: float | None) -> None:
    shuffled = np.random.default_rng(1).permutation(ranges).tolist()
    text = "".join(f"{k},{100 * value:.6g}\n" for k, value in enumerate(shuffled))
    scan = imported(tmp_path, f"heading,range_cm\n{text}")
    assert scan.likely_no_echo == (None if silent is None else 100 * silent)


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


def test_names_of_earlier_versions_read_the_same_scan(tmp_path: Path) -> None:
    assert all(getattr(sonarhw_compare, name).__name__ for name in sonarhw_compare.__all__ if name != "QUANTITIES")
    file = tmp_path / "scan.csv"
    file.write_text("no,angle_deg,range_cm,time_s\n" + "".join(f"{k},{9 * k},{100 + k},{k / 10}\n" for k in range(8)))
    columns, meaning = sonarhw_compare.guess_columns(file)
    assert columns == sonarhw_compare.CsvColumns("angle_deg", "range_cm", "time_s")
    assert meaning == sonarhw_compare.Meaning(0.01)
    clockwise = replace(meaning, sign=-1.0, zero=30.0, unit_deg=2.0, no_echo=103.0)
    readings = sonarhw_compare.read_foreign_scan(file, columns, clockwise)
    assert [round(math.degrees(reading.angle), 6) for reading in readings] == [30 - 18 * k for k in range(8)]
    expected = [None if k == 3 else pytest.approx(1 + k / 100) for k in range(8)]
    assert [reading.range for reading in readings] == expected
    file.write_text("a,b\n1,2\n2,3\n3,4\n4,5\n")
    with pytest.raises(InputError, match="name the columns"):
        sonarhw_compare.guess_columns(file)


@pytest.mark.parametrize(
    ("made_by", "origin"),
    [("scan", Origin.MEASURED), ("scan", Origin.FAKE), ("simulate", Origin.SIMULATED), ("import", Origin.IMPORTED)],
)
def test_a_corrected_log_keeps_the_origin_of_its_readings(tmp_path: Path, made_by: str, origin: Origin) -> None:
    log, corrected = tmp_path / "scan.mcap", tmp_path / "corrected.mcap"
    readings = [Reading(k, 0, 0, k / 10, 0.1 * k, (0.004,), 343.0, origin=origin) for k in range(5)]
    write_scan(log, LogMetadata(made_by, 1e9), readings)
    assert read_log(log).origin is origin
    scan = import_scan(log, ImportOptions(turn="cw"))
    assert {reading.origin for reading in scan.readings} == {origin}
    write_scan(corrected, scan.metadata(LogMetadata("import", 2e9)), scan.readings)
    written = read_log(corrected)
    assert (written.origin, {reading.origin for reading in written.readings}) == (origin, {origin})
    assert "corrected: turn=cw" in written.metadata.read_as


def test_text_in_another_encoding_is_refused_with_what_to_do(tmp_path: Path) -> None:
    file = tmp_path / "scan.txt"
    file.write_text("".join(f"Угол: {angle}; Расстояние: 103 см\n" for angle in range(0, 180, 5)), encoding="cp1251")
    with pytest.raises(InputError, match="save it in UTF-8"):
        import_scan(file)


# a ring a line, `rostopic echo`, JSON texts, traces of oscilloscopes and logs of a Ping1D


ANGLES = range(0, 180, 15)
RINGS = [[50.0 + angle / 4 + ring for angle in ANGLES] for ring in range(3)]  # cm
SCAN = "%time,field.header.frame_id,field.angle_min,field.angle_increment,field.range_min,field.range_max,"
RANGE = "%time,field.header.frame_id,field.radiation_type,field.min_range,field.max_range,field.range"


def _lines(header: str, rows: list[str]) -> str:
    return "\n".join([header, *rows, ""])


def _wide(separator: str, first: tuple[str, ...], suffix: str = "") -> str:
    rows = [separator.join([*("0" for _ in first), *map(str, ring)]) for ring in RINGS]
    return _lines(separator.join([*first, *(f"{angle}{suffix}" for angle in ANGLES)]), rows)


def _laser_scan() -> str:
    header = SCAN + ",".join(f"field.ranges{k}" for k in range(len(ANGLES)))
    metres = [",".join(f"{centimetres / 100:g}" for centimetres in ring) for ring in RINGS]
    return _lines(header, [f"1,laser,0,{math.radians(15)},0.02,4,{row}" for row in metres])


def _ranges() -> str:
    return _lines(RANGE, [f"1,sonar{k},0,0.02,4,{ring[k] / 100:g}" for ring in RINGS for k in range(len(ANGLES))])


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (_wide(",", ()), ImportOptions(unit="cm")),
        (_wide(",", ("time cm",), "°"), ImportOptions()),
        (_wide(";", ("t", "cm")).replace(".", ","), ImportOptions()),
        (_laser_scan(), ImportOptions()),
        (_ranges(), ImportOptions(step=15.0)),
    ],
)
def test_a_ring_a_line_is_read_as_sweeps(text: str, options: ImportOptions, tmp_path: Path) -> None:
    file = tmp_path / "scan.csv"
    file.write_text(text)
    readings = import_scan(file, options).readings
    np.testing.assert_allclose([math.degrees(one.angle) for one in readings], [*ANGLES] * len(RINGS), atol=1e-3)
    np.testing.assert_allclose([one.range or 0.0 for one in readings], np.ravel(RINGS) / 100, atol=1e-6)
    assert [one.sweep for one in readings] == np.repeat(range(len(RINGS)), len(ANGLES)).tolist()


def test_a_range_beyond_the_limits_of_its_message_is_no_echo(tmp_path: Path) -> None:
    file = tmp_path / "scan.csv"
    file.write_text(_ranges().replace("sonar3,0,0.02,4,0.6125", "sonar3,0,0.02,4,inf"))
    readings = import_scan(file, ImportOptions(step=15.0)).readings
    assert [number for number, one in enumerate(readings) if one.range is None] == [3]


@pytest.mark.parametrize(
    ("text", "expected"),
    [(_wide(",", ()), "unit of the range not stated"), (_ranges(), "sensors sonar0, sonar1 without directions")],
)
def test_what_a_table_does_not_state_is_asked_for(text: str, expected: str, tmp_path: Path) -> None:
    file = tmp_path / "scan.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=expected):
        import_scan(file)


COUNT, STEP = 400, 1e-5  # samples, the first hundred before the trigger, and their distance, s
SIGNAL = 0.1 * np.sin(np.arange(COUNT))
TIMES = (np.arange(COUNT) - 100) * STEP
PAIRS = [f"{time:.9f},{volts:.6f}" for time, volts in zip(TIMES, SIGNAL, strict=True)]
IN_MS = [f"{time * 1e3:.6f},{volts:.6f}" for time, volts in zip(TIMES, SIGNAL, strict=True)]
TDS = ["Record Length,4e2,,", "Sample Interval,1e-5,,", "Vertical Units,V,,"]
COUNTED = [f"{k},{volts:.6f},," for k, volts in enumerate(SIGNAL)]
IN_MV = [f"{time * 1e3:.6f};{1e3 * volts:.6f}".replace(".", ",") for time, volts in zip(TIMES, SIGNAL, strict=True)]
OWON = (
    "Channel \t:,CH1\nFrequency \t:,F=1.498kHz\nPK-PK\t:,Vpp=1.280V\nVoltage per ADC value:,20.00mV\n"
    "Time interval\t\t :,10.00uS\n\nindex,CH1_Voltage(mV)"
)
OSCILLOSCOPES = {
    "Rigol DS": _lines("X,CH1,Start,Increment,", ["Sequence,Volt,-1.0e-3,1.0e-5,", *COUNTED]),
    "Rigol MSO": _lines("Time(s),CH1(V),t0 = -1.0e-3s, tInc = 1.0e-05,", [f"{pair},," for pair in PAIRS]),
    "Tektronix TDS": "\n".join(f"{(TDS[k] if k < 3 else ',,,')}{pair}," for k, pair in enumerate(PAIRS)),
    "Tektronix MSO": _lines("Model,MSO24\nSample Interval,1e-05,\n\nTIME,CH1", PAIRS),
    "Siglent": _lines("Record Length,Analog:400\nSample Interval,0.00001\nSource,CH1\nSecond,Value", PAIRS),
    "PicoScope": _lines("Time,Channel A\n(ms),(V)\n", IN_MS),
    "PicoScope, German": _lines("Zeit;Kanal A\n(ms);(mV)\n", IN_MV),
    "Rigol without times": _lines("CH1(V),t0 = -1.0e-3s, tInc = 1.0e-05,", [f"{volts:.6f},," for volts in SIGNAL]),
    "Keysight": _lines("x-axis,1\nsecond,Volt", PAIRS),
    "LeCroy": _lines("LECROYWS,1,Waveform\nSegments,1\nTime,Ampl", PAIRS),
    "Digilent": _lines("#Digilent WaveForms\n#Samples: 400\n\nTime (s),Channel 1 (V)", PAIRS),
    "Rohde & Schwarz": _lines("in s,CH1 in V", PAIRS),
    "OWON": _lines(OWON, [f"{k},{1e3 * volts:.4f}" for k, volts in enumerate(SIGNAL[100:])]),  # states no trigger
    "OWON, several channels": _lines(
        OWON.replace(",", "\t").replace("mV)", "mV)\tCH2_Voltage(mV)"),
        [f"{k}\t{1e3 * volts:.4f}\t0.0" for k, volts in enumerate(SIGNAL[100:])],
    ),
}


@pytest.mark.parametrize("maker", OSCILLOSCOPES)
def test_a_trace_of_an_oscilloscope_begins_at_its_trigger(maker: str, tmp_path: Path) -> None:
    file = tmp_path / "trace.csv"
    file.write_text(OSCILLOSCOPES[maker])
    with pytest.raises(InputError, match="volts; add full_scale"):
        import_scan(file)
    reading, *_ = import_scan(file, ImportOptions(full_scale=0.5)).readings
    assert reading.trace.rate == pytest.approx(1 / STEP)
    np.testing.assert_allclose(reading.trace.samples, SIGNAL[100:] / 0.5, atol=1e-5)


SWEEP = [*range(15, 166, 5), *range(160, 14, -5)]
FARTHER = [round(1 + angle / 300, 3) for angle in SWEEP]  # m
OF_ROS = "angle_min: 0.0\nangle_increment: {step}\nrange_min: 0.1\nrange_max: 4.0\nranges: {ranges}\n---\n"
TEXTS = {
    "list": json.dumps([{"angle": a, "distance_m": d} for a, d in zip(SWEEP, FARTHER, strict=True)]),
    "document": json.dumps(
        {"scan": [{"deg": a, "mm": 1e3 * d} for a, d in zip(SWEEP, FARTHER, strict=True)]}, indent=2
    ),
    "lists": json.dumps({"angles_deg": SWEEP, "ranges_cm": [100 * distance for distance in FARTHER]}),
    "messages of ROS 1": OF_ROS.format(step=math.radians(5), ranges=FARTHER[:31]),
    "messages of ROS 2": OF_ROS.format(step=math.radians(5), ranges="".join(f"\n- {d}" for d in FARTHER[:31])),
}


@pytest.mark.parametrize("kind", TEXTS)
def test_texts_with_many_readings_are_read(kind: str, tmp_path: Path) -> None:
    file = tmp_path / "scan.txt"
    file.write_text(TEXTS[kind])
    readings = import_scan(file).readings
    count = 31 if "ROS" in kind else len(SWEEP)
    np.testing.assert_allclose([one.range or 0.0 for one in readings], FARTHER[:count], atol=1e-6)
    first = 0 if "ROS" in kind else 15
    np.testing.assert_allclose(np.degrees([one.angle for one in readings[:31]]), np.arange(31) * 5 + first, atol=1e-4)


def test_ranges_that_ros_has_cut_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "scan.yaml"
    file.write_text(OF_ROS.format(step=0.1, ranges="\n- 1.0\n- 1.1\n- '...'"))
    with pytest.raises(InputError, match="full-length"):
        import_scan(file)


def _qt(text: str) -> bytes:
    content = text.encode("utf-16-be")
    return struct.pack(">I", len(content)) + content


def test_a_ping1d_has_its_distance_and_its_profile(tmp_path: Path) -> None:
    content = _qt("PingViewer sensor log file") + bytes(4) + _qt("x") * 5 + bytes(8)
    for second in range(3):
        profile = struct.pack("<IHHIIIIH", 1000 + second, 90, 50, second, 0, 2000, 1, 200) + bytes(100) + b"\xc8" * 100
        frame = b"BR" + struct.pack("<HHBB", len(profile), 1300, 1, 0) + profile
        frame += struct.pack("<H", sum(frame) & 0xFFFF)
        content += _qt(f"10:11:{second:02d}.000") + struct.pack(">I", len(frame)) + frame
    file = tmp_path / "log.bin"
    file.write_bytes(content)
    readings = import_scan(file, ImportOptions(speed_of_sound=1500.0)).readings
    np.testing.assert_allclose([one.range or 0.0 for one in readings], [1.0, 1.001, 1.002])
    trace = readings[0].trace
    assert trace.times[np.flatnonzero(trace.samples)[0]] * 1500 / 2 == pytest.approx(1.0, abs=0.01)


def test_an_unknown_format_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scan.csv").write_text("angle_deg,range_cm\n0,50\n")
    with pytest.raises(InputError, match="format 'xls': expected text, carmen"):
        import_scan(tmp_path / "scan.csv", ImportOptions(format="xls"))


# logs of BeeSoft and ARIA, with the units that their programs write


BEESOFT = """
@SENS 24-11-95 23:59:59.500000
#ROBOT 10.000000 20.000000 90.000000

@SENS 24-11-95 23:59:59.900000
#SONAR 4: 100.500000 200.000000 0.000000 50.000000

@SENS 25-11-95 00:00:00.100000
#SONAR 4: 101.000000 199.000000 700.000000 51.000000

"""
ARIA = """LaserOdometryLog
#Created by ARIA's ArLaserLogger
version: 3
sick1pose: 100 0 0.00
sick1conf: -90 90 3
locationTypes: robot robotGlobal

scan1Id: 1
time: 0.50
velocities: 0.00 0.00 0.00
robot: 1000 2000 90.00
scan1: 100 -1500 1100 0 100 800
scan1Id: 2
time: 1.00
robot: 1100 2000 90.00
sick1: 1400 900 0
# End of log
"""


def test_ranges_of_beesoft_are_centimetres_in_directions_that_the_user_states(tmp_path: Path) -> None:
    file = tmp_path / "robot.script"
    file.write_text(BEESOFT)
    with pytest.raises(InputError, match=r"4 ranges without the directions .* step=DEGREES .* 90 or -90"):
        import_scan(file)
    scan = import_scan(file, ImportOptions(step=-90.0, no_echo=700.0))
    assert scan.read_as == ("read as logs of BeeSoft with sonar", "centimetres: by the definition of the format")
    assert [reading.range for reading in scan.readings] == [
        None if metres is None else pytest.approx(metres) for metres in (1.005, 2.0, None, 0.5, 1.01, 1.99, None, 0.51)
    ]
    assert [round(math.degrees(reading.angle)) for reading in scan.readings] == [0, -90, -180, -270] * 2
    assert [reading.sweep for reading in scan.readings] == [0] * 4 + [1] * 4
    assert scan.readings[4].time - scan.readings[0].time == pytest.approx(0.2)  # over midnight


def test_scans_of_aria_have_the_pose_of_their_sensor(tmp_path: Path) -> None:
    file = tmp_path / "map.2d"
    file.write_text(ARIA)
    scan = import_scan(file)
    first, second = scan.readings[:3], scan.readings[3:]
    assert [reading.range for reading in first] == pytest.approx([1.5, 1.0, 0.8])
    assert [math.degrees(reading.angle) for reading in first] == pytest.approx([-90, 0, 90])
    assert first[0].pose == pytest.approx((1.0, 2.1, math.pi / 2))  # the sensor is 0.1 m in front of the robot
    assert second[0].range == pytest.approx(1.4)
    assert second[2].range is None
    assert [math.degrees(reading.angle) for reading in second] == pytest.approx([-90, 0, 90])
    assert second[0].pose == pytest.approx((1.1, 2.1, math.pi / 2))
    assert second[0].time - first[0].time == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("name", "inside", "kind"),
    [
        ("a.xlsx", "[Content_Types].xml", "a spreadsheet"),
        ("a.ods", "mimetype", "a spreadsheet"),
        ("saved.bin", "xl/workbook.xml", "a spreadsheet"),
        ("a.docx", "[Content_Types].xml", "a document"),
        ("a.zip", "scan.csv", "an archive"),
    ],
)
def test_a_file_of_an_office_program_or_an_archive_is_named(tmp_path: Path, name: str, inside: str, kind: str) -> None:
    with zipfile.ZipFile(tmp_path / name, "w") as archive:
        archive.writestr(inside, "x")
    for read in (import_scan, read_log):
        with pytest.raises(InputError, match=f"{name}: is {kind};"):
            read(tmp_path / name)
