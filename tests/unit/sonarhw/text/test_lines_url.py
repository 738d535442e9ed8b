"""The URL of a text device: each key, and one line about each mistake."""

import math

import pytest

from sonarhw.errors import InputError
from sonarhw.text_device import HEADER, PRESETS, Printed, read_lines_url


def read(query: str, line: str) -> Printed | str | None:
    return read_lines_url(f"lines:/dev/ttyUSB0?{query}").make_format().read(line)


@pytest.mark.parametrize(
    ("query", "line", "printed"),
    [
        ("preset=arduino-radar", "90,23", Printed(90, 0.23)),
        ("preset=arduino-radar", "90*23", Printed(90, 0.23)),
        ("preset=arduino-radar", "90,0", Printed(90, None)),
        ("preset=arduino-radar&unit=in", "90,10", Printed(90, 0.254)),
        ("preset=arduino-radar&no_echo=357,400", "90,400", Printed(90, None)),
        ("preset=arduino-radar", "90,23,1", None),
        ("preset=arduino-radar", "9023", None),
        ("preset=arduino-radar", "999,23", None),
        ("preset=maxbotix&step=5", "R0123", Printed(None, 0.123)),
        ("preset=maxbotix&step=5", "R5000", Printed(None, None)),
        ("preset=maxbotix&step=5&no_echo=9999", "R5000", Printed(None, 5.0)),
        ("preset=maxbotix&step=5&unit=in", "R100", Printed(None, 2.54)),
        ("preset=maxbotix&step=5", "R01234", None),
        ("preset=angle-distance", "Angle: 90 Distance: 23 cm", Printed(90, 0.23)),
        ("preset=angle-distance", "ANGLE = -90°, Dist = 1.5 m", Printed(-90, 1.5)),
        ("preset=angle-distance", "Angle: 90 degrees | Distance: 230mm", Printed(90, 0.23)),
        ("preset=angle-distance", "Angle: 90 Distance: Out of range", Printed(90, None)),
        ("preset=angle-distance", "Angle: 90 Distance: ", None),
        ("preset=jsonl", '{"heading_deg": 90, "range_cm": 23}', Printed(90, 0.23)),
        ("preset=jsonl", '{"t": 1, "range": 2.5, "angle": 12.5}', Printed(12.5, 0.025)),
        ("preset=jsonl&unit=m", '{"range": 2.5, "angle": 12.5}', Printed(12.5, 2.5)),
        ("preset=jsonl", '{"angle": 90, "distance_mm": null}', Printed(90, None)),
        ("preset=jsonl", '{"angle": true, "distance_mm": 3}', None),
        ("preset=jsonl", '{"angle": 90}', None),
        ("preset=jsonl", "[90, 23]", None),
        ("preset=jsonl", "[" * 100_000, None),
        ("preset=csv", "90,23", Printed(90, 0.23)),
        ("preset=csv", "90.5 23.5", Printed(90.5, 0.235)),
        ("preset=csv", "90,23,1", None),
        ("preset=csv", "90,2_3", None),
        ("preset=csv", "٩٠,23", None),
        ("preset=csv", "nan,23", None),
        ("preset=csv", "90,1e9", None),
        ("preset=jsonl", '{"angle": 1e400, "distance_mm": 3}', None),
        (r"pattern=(?P<heading_deg>\d+),(?P<range_cm>\d+)", "90,23", Printed(90, 0.23)),
        (r"pattern=a(?P<heading_deg>\d%2B)/(?P<range>\d+)&unit=mm", "a90/23", Printed(90, 0.023)),
        (r"pattern=d=(?P<range_m>[\d.]+)&step=2", "d=1.25", Printed(None, 1.25)),
    ],
)
def test_a_line_is_read(query: str, line: str, printed: Printed | None) -> None:
    found = read(query, line)
    if printed is None or printed.range is None:
        assert found == printed
    else:
        assert isinstance(found, Printed)
        assert (found.heading, found.range) == (printed.heading, pytest.approx(printed.range))


def test_a_csv_header_names_columns_and_unit() -> None:
    line_format = read_lines_url("lines:COM3?preset=csv").make_format()
    assert line_format.read("time_ms,Distance (mm),Servo angle") == HEADER
    assert line_format.read("17,230,90") == Printed(90, pytest.approx(0.23))
    assert line_format.read("90,23") is None


@pytest.mark.parametrize("name", PRESETS)
def test_the_example_of_each_preset_is_a_reading(name: str) -> None:
    step = "" if PRESETS[name].prints_angle else "&step=5"
    example = PRESETS[name].example.rpartition("then ")[2].rstrip(".")
    assert isinstance(read(f"preset={name}{step}", example), Printed)


def test_turn_and_zero_give_the_turntable_angle() -> None:
    url = read_lines_url("lines:COM3?preset=arduino-radar&turn=cw&zero=90")
    assert math.degrees(url.turntable_angle(100)) == pytest.approx(-10)
    assert (url.port, url.baud) == ("COM3", 9600)


@pytest.mark.parametrize(
    ("query", "message"),
    [
        ("", "expected preset=NAME or pattern=REGEX: arduino-radar, .*ports --guess"),
        ("preset=radar", "preset=radar: expected arduino-radar"),
        ("preset=csv&pattern=(?P<range_m>.)", "give only one of them"),
        ("preset=csv&speed=3", "unknown key speed; known: baud, preset"),
        ("preset=csv&preset=csv", "a key occurs twice"),
        ("preset=csv&baud=fast", "baud=fast: expected a baud rate"),
        ("preset=csv&unit=ft", "unit=ft: expected m, cm, mm, in"),
        ("preset=csv&turn=left", "turn=left: expected ccw, cw"),
        ("preset=csv&zero=1e9", "zero=1e9: expected degrees from -360 to 360"),
        ("preset=csv&no_echo=none", "no_echo=none: expected a number"),
        ("preset=csv&step=5", "the device prints its angle; remove step"),
        ("preset=maxbotix", "the device prints no angle: add step=DEGREES"),
        ("preset=maxbotix&step=0", "step=0: expected degrees above 0"),
        ("pattern=(", "invalid regular expression"),
        (r"pattern=(?P<heading_deg>\d)", "expected one group"),
        (r"pattern=(?P<range_m>\d)", "add step=DEGREES"),
        (r"pattern=(?P<heading_deg>\d)(?P<range_m>\d)&unit=cm", "the pattern names the unit already"),
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
