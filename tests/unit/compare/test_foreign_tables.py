"""Tables with a ring a line, `rostopic echo`, JSON texts, traces of oscilloscopes and logs of a Ping1D."""

import json
import math
import struct
from pathlib import Path

import numpy as np
import pytest
from sonarhw_compare.imports import ImportOptions, import_scan

from sonarhw.errors import InputError

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
