"""The URL of a text device: each key, and one line about each mistake."""

import math

import pytest

from sonarhw.errors import InputError
from sonarhw.text.decoder import make_decoder
from sonarhw.text.layouts import PRESETS, BinaryFrame, Layout
from sonarhw.text.numbers import HEADER, PART, Printed
from sonarhw.text_device import read_lines_url


def read(query: str, line: str) -> tuple[Printed, ...] | str | None:
    return read_lines_url(f"lines:/dev/ttyUSB0?{query}").layout.make_format().read(line)


@pytest.mark.parametrize(
    ("query", "line", "printed"),
    [
        ("preset=arduino-radar", "90,23", (90, 0.23)),
        ("preset=arduino-radar", "90,0", (90, None)),
        ("preset=arduino-radar&unit=in", "90,10", (90, 0.254)),
        ("preset=arduino-radar&no_echo=357,400", "90,400", (90, None)),
        ("preset=arduino-radar", "90,23,1", None),
        ("preset=arduino-radar", "999,23", None),
        ("preset=maxbotix&step=5", "R0123", (None, 0.123)),
        ("preset=maxbotix&step=5&no_echo=9999", "R5000", (None, 5.0)),
        ("preset=maxbotix&step=5", "R01234", None),
        ("preset=angle-distance", "Angle: 90 Distance: 23 cm", (90, 0.23)),
        ("preset=angle-distance", "ANGLE = -90°, Dist = 1.5 m", (-90, 1.5)),
        ("preset=angle-distance", "Angle: 90 Distance: Out of range", (90, None)),
        ("preset=angle-distance", "Angle: 90 Distance: ", None),
        ("preset=jsonl", '{"heading_deg": 90, "range_cm": 23}', (90, 0.23)),
        ("preset=jsonl", '{"t": 1, "range": 2.5, "angle": 12.5}', (12.5, "2.5 of an unknown unit")),
        ("preset=jsonl", '{"scan": {"angle": 12.5, "range": {"value": 2.5, "unit": "ft"}}}', (12.5, 0.762)),
        ("preset=jsonl", '{"theta_rad": 0.5, "duration_us": 1000}', (28.64788975654116, 0.1719934)),
        ("preset=jsonl", '{"angle": 90, "distance_mm": null}', (90, None)),
        ("preset=jsonl", '{"angle": true, "distance_mm": 3}', None),
        ("preset=jsonl", "[90, 23]", None),
        ("preset=jsonl", "[" * 100_000, None),
        ("preset=csv", "90,23", (90, "23 of an unknown unit")),
        ("preset=csv&unit=cm", "90,23", (90, 0.23)),
        ("preset=csv&unit=cm", "90;23,5", (90, 0.235)),
        ("preset=csv&unit=m&angle=rad", "1 2", (57.29577951308232, 2.0)),
        ("preset=csv&unit=cm", "90,fuera de rango", (90, None)),
        ("preset=csv", "90,23,1", None),
        ("preset=csv", "٩٠,23", None),
        ("preset=jsonl", '{"angle": 1e400, "distance_mm": 3}', None),
        (r"pattern=a(?P<heading_deg>\d%2B)/(?P<range>\d+)&unit=mm", "a90/23", (90, 0.023)),
        ("pattern={deg}:{cm}", "90: 23", (90, 0.23)),
        ("pattern=Angle {deg} Dist {cm} cm", "angle 90  dist 23,5cm", (90, 0.235)),
        ("pattern=Angle {deg} Dist {cm} cm", "Angle 90 Dist out of range", (90, None)),
        ("pattern={-},{deg},{-},{in}", "17,90,x,10", (90, 0.254)),
        ("pattern={deg},{cm}", "90,23,5", None),
        ("pattern={step}/{mm}&step=1.8", "50/230", (90, 0.23)),
        (r"pattern=d=(?P<range_m>[\d.]+)&step=2", "d=1.25", (None, 1.25)),
    ],
)
def test_a_line_is_read(query: str, line: str, printed: tuple[float | None, float | str | None] | None) -> None:
    found = read(query, line)
    if printed is None:
        assert found is None
        return
    (reading,) = found
    assert reading.heading == (None if printed[0] is None else pytest.approx(printed[0]))
    if isinstance(printed[1], str):
        assert reading.scale is None
        assert f"{reading.numbers[0]:g} of an unknown unit" == printed[1]
    else:
        assert reading.ranges == (() if printed[1] is None else (pytest.approx(printed[1]),))


def test_a_csv_header_names_columns_and_unit() -> None:
    line_format = read_lines_url("lines:COM3?preset=csv").layout.make_format()
    assert line_format.read("time_ms,Distance (mm),Servo angle") == HEADER
    assert line_format.read("17,230,90") == (Printed(90, (230,), 0.001, time=0.017),)
    assert line_format.read("90,23") is None
    assert line_format.read("Angle_cw\tInches") == HEADER
    assert line_format.read("30\t10") == (Printed(-30, (10,), 0.0254),)


def test_a_pattern_reads_lines_sensors_and_sweeps() -> None:
    """A reading on two lines, a ring of sensors, two mounted sensors, several echoes, a sweep in a line."""

    def readings(query: str, *lines: str) -> list[tuple[float | None, tuple[float, ...]]]:
        line_format = read_lines_url(f"lines:COM3?{query}").layout.make_format()
        read = [line_format.read(line) for line in lines]
        assert all(one == PART for one in read[:-1])
        return [(one.heading, tuple(round(distance, 6) for distance in one.ranges)) for one in read[-1]]

    assert readings(r"pattern=Angle: {deg}°\nDist: {cm} cm", "Angle: 15°", "Dist: 22 cm") == [(15, (0.22,))]
    ring = readings("pattern=[{-}={cm}cm ]...&step=90", "0=23cm 1=45cm 2=0cm 3=7cm")
    assert ring == [(0, (0.23,)), (90, (0.45,)), (180, ()), (270, (0.07,))]
    assert readings("pattern={deg}: L{cm@90} R{cm@-90}", "10: L23 R45") == [(100, (0.23,)), (-80, (0.45,))]
    assert readings("pattern={deg} {cm} {cm}", "10 45 23") == [(10, (0.23, 0.45))]
    sweep = readings("pattern={-},[{cm},]...&step=2", "1,100,101,102,")
    assert sweep == [(0, (1.0,)), (2, (1.01,)), (4, (1.02,))]
    assert readings("pattern=[{deg}:{mm};]...", "15:100;20:230") == [(15, (0.1,)), (20, (0.23,))]


@pytest.mark.parametrize(("frame", "unit"), [("ff03e8ea", "a02yyuw"), ("220064 86".replace(" ", ""), "urm37")])
def test_binary_messages_are_read_and_damaged_ones_are_counted(frame: str, unit: str) -> None:
    decoder = make_decoder(Layout(unit, step=5.0))
    message = bytes.fromhex(frame)
    damaged = message[:-1] + b"\0"
    readings = decoder.feed(message[2:] + message + damaged + message)
    assert [one.ranges for one in readings] == [(1.0,), (1.0,)]
    assert decoder.ignored["noise"] >= 4


def test_two_bytes_without_a_sum_are_a_range_if_the_sensor_can_measure_it() -> None:
    decoder = make_decoder(Layout("us100", step=5.0))
    assert [one.ranges for one in decoder.feed(b"\xff\x03\xe8\x80\x04\x4c")] == [(1.0,), (1.1,)]
    assert decoder.ignored["noise"] == 2


@pytest.mark.parametrize("name", PRESETS)
def test_the_example_of_each_preset_is_a_reading(name: str) -> None:
    if isinstance(PRESETS[name].make, BinaryFrame):
        return
    step = "" if PRESETS[name].prints_angle else "&step=5"
    example = PRESETS[name].example.rpartition("then ")[2].rstrip(".")
    assert isinstance(read(f"preset={name}{step}", example), tuple)


def test_turn_and_zero_give_the_turntable_angle() -> None:
    url = read_lines_url("lines:COM3?preset=arduino-radar&turn=cw&zero=90")
    assert math.degrees(url.turntable_angle(100)) == pytest.approx(-10)
    assert (url.port, url.baud) == ("COM3", 9600)


@pytest.mark.parametrize(
    ("query", "message"),
    [
        ("", "expected preset=NAME or pattern=PATTERN: arduino-radar, .*ports --guess"),
        ("preset=radar", "preset=radar: expected arduino-radar"),
        ("preset=csv&pattern=(?P<range_m>.)", "give only one of them"),
        ("preset=csv&preset=csv", "a key occurs twice"),
        ("preset=csv&baud=4000001", "baud=4000001: expected a baud rate"),
        ("preset=csv&unit=km", "unit=km: expected m, cm, mm, in, ft, yd, us"),
        ("pattern={deg} {km}", "unknown field {km}; fields: {angle}, {deg}"),
        ("pattern={deg}", "expected a range such as {cm}"),
        ("pattern={deg} {deg} {cm}", "expected one angle"),
        ("pattern={step} {cm}", "counted in steps: add step=DEGREES"),
        ("pattern=[{cm} ]...", "add step=DEGREES"),
        ("pattern={deg} {cm}&unit=mm", "the pattern names the unit already"),
        ("preset=csv&zero=1e9", "zero=1e9: expected degrees from -360 to 360"),
        ("preset=arduino-radar&step=5", "the device prints its angle; remove step"),
        ("preset=maxbotix", "the device prints no angle: add step=DEGREES"),
        ("pattern=(", "invalid regular expression"),
        (r"pattern=(?P<heading_deg>\d)", "with one group"),
    ],
)
def test_a_mistake_is_one_line_with_the_url(query: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as raised:
        read_lines_url(f"lines:/dev/ttyUSB0?{query}")
    assert str(raised.value).startswith("lines:/dev/ttyUSB0?")
    assert "\n" not in str(raised.value)


def test_a_port_is_needed() -> None:
    with pytest.raises(InputError, match="port missing"):
        read_lines_url("lines:?preset=csv")
