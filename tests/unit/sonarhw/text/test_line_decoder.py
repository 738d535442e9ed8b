"""Bytes in any pieces give the same readings, and what is not a reading is counted."""

import random
import tracemalloc
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonarhw.text.decoder import HALF_LINES, MOST_LINE, MOST_PAUSE, NOISE, OTHER_TEXT, LineDecoder, make_decoder
from sonarhw.text.layouts import PRESETS, Layout, layout_of
from sonarhw.text.proposals import propose


def decoder(preset: str = "arduino-radar") -> LineDecoder:
    made = make_decoder(Layout(preset))
    return made


def angles(decoded: list) -> list[float]:
    return [line.heading for line in decoded]


@given(st.lists(st.integers(1, 12)), st.integers(0, 5))
def test_pieces_make_no_difference(sizes: list[int], start: int) -> None:
    data = b"".join(f"{angle},{angle + 7}.".encode() for angle in range(90, 130))[start:]
    whole, pieces = decoder(), decoder()
    expected, found = whole.feed(data), []
    for size in [*sizes, len(data)]:
        piece, data = data[:size], data[size:]
        found += pieces.feed(piece)
    assert found == expected
    assert pieces.ignored == whole.ignored


@pytest.mark.parametrize("cut", range(6))
def test_the_first_line_may_be_cut_and_is_left_out(cut: int) -> None:
    one = decoder()
    assert angles(one.feed(b"190,23.191,24."[cut:])) == [191]
    assert one.ignored[HALF_LINES] == 1


def test_a_first_line_that_cannot_be_cut_is_a_reading() -> None:
    assert len(decoder("maxbotix").feed(b"R0123\rR0124\r")) == 2
    assert len(decoder("jsonl").feed(b'{"angle": 1, "range_cm": 2}\n')) == 1
    assert len(decoder("angle-distance").feed(b"Angle: 1 Distance: 2 cm\n")) == 1


def test_a_reset_within_a_line_does_not_join_two_lines() -> None:
    one = decoder()
    one.feed(b"89,22.90,23.1")
    one.idle(MOST_PAUSE / 2)
    assert angles(one.feed(b"5,30.1")) == [15]  # slow, but the same line
    one.idle(MOST_PAUSE * 1.1)
    assert angles(one.feed(b"6,31.")) == [6]
    assert one.ignored[HALF_LINES] == 2


def test_a_banner_marks_the_next_reading() -> None:
    one = decoder("csv")
    one.feed(b"\n15,30\n")
    (read,) = one.feed(b"Radar v2 ready\r\n15,30\r\n")
    assert read.restarted
    assert one.ignored[OTHER_TEXT] == 1
    assert one.example == "Radar v2 ready"


def test_noise_is_counted_and_needs_no_memory() -> None:
    one, noise = decoder(), bytes(random.Random(1).choices(b"\x80\xfe\xf8\x00\x1e", k=MOST_LINE))
    assert one.feed(noise) == []
    tracemalloc.start()
    for _ in range(7):
        assert one.feed(noise) == []
    assert tracemalloc.get_traced_memory()[0] < 3 * MOST_LINE
    tracemalloc.stop()
    assert one.ignored[NOISE] > 3


def test_a_text_without_ends_of_lines_is_no_noise() -> None:
    one = decoder("csv")
    for _ in range(20):
        one.feed(b"90,23.91,24.92,25." * (MOST_LINE // 30))
    assert one.ignored[NOISE] == 0
    assert one.ignored[HALF_LINES] == 10


@given(
    st.sampled_from(sorted(PRESETS)),
    st.lists(st.one_of(st.binary(max_size=40), st.sampled_from([b"90,23.", b"R0123\r", b"\n", b"angle,range\n"]))),
)
def test_any_bytes_give_only_possible_readings(preset: str, pieces: list[bytes]) -> None:
    one = make_decoder(Layout(preset))
    for piece in pieces:
        for line in one.feed(piece):
            assert line.heading is None or abs(line.heading) <= 720
            assert line.scale is None or all(0 < distance <= 700 for distance in line.ranges)
        one.idle(0.3)


SPACES = "\u00a0\u2003\u2009\u202f\u3000"


@pytest.mark.parametrize(
    ("encoding", "space"), [("cp1252", "\u00a0"), *product(("utf-8", "utf-16", "utf-16-be"), SPACES)]
)
@pytest.mark.parametrize("line", ["{a}_{r}", "_Angle:_{a}_°_Distance:_{r}_cm", '{{"angle":_{a},_"range_cm":_{r}}}'])
def test_spaces_of_other_scripts_are_spaces(encoding: str, space: str, line: str) -> None:
    lines = [line.replace("_", space).format(a=angle, r=20 + 37 * angle % 150) for angle in range(0, 360, 5)]
    text = "\ufeff" * (encoding == "utf-16-be") + "\n".join(lines)
    proposal = propose(text.encode(encoding), begins_whole=True)
    assert angles(proposal.readings) == [*range(0, 360, 5)]
    live = make_decoder(proposal.layout).feed(f"\n{text}\n".encode("utf-8" if "16" in encoding else encoding))
    assert len(live) >= len(lines) - 1


def test_digits_and_marks_of_other_scripts_are_those_of_ascii() -> None:
    one = make_decoder(layout_of({"pattern": "角度：{deg} 距离：{cm}"}))
    decoded = one.feed("\n角度：\u2212９０ 距离：۲۳٫۵\u200e\n".encode())
    assert [(one.heading, one.numbers) for one in decoded] == [(-90, (23.5,))]
