"""Wrong and hostile files: every error is one line that names the file, the key, and what was found and expected."""

import os
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from sonarhw_sim.board.profile import MOST_NAME, load_board, parse_board
from sonarhw_sim.files import MOST_BYTES, near_miss
from sonarhw_sim.room.room import load_room, parse_room

from sonarhw.errors import InputError
from sonarhw.wire.limits import MAX_TEXT
from tests.checkout import CHECKOUT
from tests.fixtures.memory_limit import at_most

ROOM = (CHECKOUT / "rooms/laboratory.toml").read_text()
BOARD = (CHECKOUT / "sim/sonarhw_sim/board/shipped/paper.toml").read_text()


def refusal(parse: Callable[[str, str], object], text: str) -> str:
    """Return the error, which is one short line."""
    with pytest.raises(InputError) as refused:
        parse(text, "own.toml")
    message = str(refused.value)
    assert message.startswith("own.toml: ")
    assert message.isprintable()
    assert len(message) < 300
    return message.removeprefix("own.toml: ")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("center", "centre", "posts[0].centre: unknown key; did you mean 'center' (m)? (and 1 more)"),
        ("heading_deg", "heading", "places.door.heading: unknown key; did you mean 'heading_deg' (degrees)?"),
        ("radius", "radius_mm", "posts[0].radius_mm: unknown key; did you mean 'radius' (m)? (and 1 more)"),
        ("radius", "diameter", "posts[0].diameter: unknown key; did you mean 'radius' (m)? (and 1 more)"),
        ('material = "wood"', 'materiel = "wood"', "walls[2].materiel: unknown key; did you mean 'material'? (and 1"),
        ('material = "wood"', 'material = "woods"', "walls[2].material: unknown material 'woods' of 'panel'; did you"),
        ("[materials.wood]", "[material.wood]", "material: unknown key; did you mean 'materials'?"),
        (
            "[[posts]]",
            "[air]\ntemperature = 20.0\n[[posts]]",
            "air.temperature: unknown key; did you mean",
        ),
        ("radius = 0.15", "color = 1\nradius = 0.15", "posts[0].color: unknown key; known: name, center, radius"),
        ("radius = 0.15", "radius = [1, 2]", "posts[0].radius: expected a valid number, got (1, 2)"),
        ("[[posts]]", "[[posts]]\nheight = {a = 1}", "posts[0].height: expected a list of numbers, got {'a': 1}"),
    ],
)
def test_a_misspelt_key_or_material_gets_a_suggestion(old: str, new: str, message: str) -> None:
    assert old in ROOM
    assert refusal(parse_room, ROOM.replace(old, new, 1)).startswith(message)


def test_keys_of_boards_get_suggestions() -> None:
    message = "mount.ahead_mm: unknown key; did you mean 'ahead' (m)?"
    assert refusal(parse_board, BOARD + "[mount]\nahead_mm = 3\n") == message
    assert refusal(parse_board, BOARD.replace("blanking", "blancking")).startswith(
        "blancking: unknown key; did you mean 'blanking' (s)?"
    )


def test_near_misses_ignore_case_and_strange_words_have_none() -> None:
    assert near_miss("Radius", ["radius", "center"]) == "radius"
    assert near_miss("xyzzy", ["radius", "center"]) is None
    assert near_miss("radius" * 100_000, ["radius"]) is None


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("1" + "0" * 5000, "a number has too many digits"),
        ("0x" + "f" * 100_000, "expected a valid number, got a huge number"),
        ("1" + "0" * 400, "expected a valid number, got 1000"),
        ("[" * 100_000, "nested too deeply"),
        ("[" * 30 + "]" * 30, "expected a valid number, got ((((("),
        ("{a = {a = {a = 1}}}", "expected a valid number, got a table"),
        ("nan", "expected a finite number, got nan"),
        ("-inf", "expected a finite number, got -inf"),
        ("1e400", "expected a finite number, got inf"),
        ("1e154", "expected less than or equal to 1000000 "),
        ("true", "expected a valid number, got True"),
        ('"\\u001b[31m"', "expected a valid number, got '\\x1b[31m'"),
        ("1979-05-27", "expected a valid number, got datetime.date(1979, 5, 27)"),
        ('"' + "x" * 10_000 + '"', "expected a valid number, got 'xxx"),
    ],
)
def test_hostile_values_are_one_line(value: str, message: str) -> None:
    assert message in refusal(parse_room, ROOM.replace("radius = 0.15", f"radius = {value}"))
    assert message in refusal(parse_board, BOARD.replace("frequency = ", f"frequency = {value} #"))


@pytest.mark.parametrize(
    "text",
    ["a." * 200_000 + "a = 1", '"a b" . ' * 200_000 + "a = 1", "[a" + ".a" * 200_000 + "]", "x = " + "{a=" * 50_000],
    ids=["dots", "quoted", "table", "inline"],
)
def test_deep_keys_are_one_line(text: str) -> None:
    message = refusal(parse_room, ROOM + "\n" + text)
    assert "more than 100 parts" in message or "too deeply" in message


def test_a_heading_and_a_radius_have_limits() -> None:
    assert refusal(parse_room, ROOM.replace("45.0", "1e154")) == (
        "places.door.heading_deg: expected less than or equal to 36000 degrees, got 1e+154"
    )
    assert "gain_steps" in refusal(parse_board, BOARD + f"gain_steps = [{', '.join(['1e-9'] * 1001)}]\n")


def test_too_many_walls_are_refused_in_bounded_memory() -> None:
    points = ", ".join(f"[{k % 1000}, {k // 1000}]" for k in range(210_000))
    with at_most(400_000_000):
        message = refusal(parse_room, ROOM.replace("points = [[2.45, 0.4], [2.95, 0.85]]", f"points = [{points}]"))
    assert message == "walls[2].points: expected at most 200000 values, got 210000"


@pytest.mark.parametrize("load", [load_room, load_board])
@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "name: missing; it is required"),
        (b"\xff\xfe\x00", "not UTF-8 text (byte 0xff in line 1); save the file as UTF-8"),
        (b"name = 1\n\x00", "not TOML: "),
        (b"name = 'x'\n# \xe9\n", "not UTF-8 text (byte 0xe9 in line 2)"),
    ],
)
def test_other_contents_are_one_line(
    tmp_path: Path, load: Callable[[str], object], content: bytes, message: str
) -> None:
    (tmp_path / "own.toml").write_bytes(content)
    with pytest.raises(InputError) as refused:
        load(str(tmp_path / "own.toml"))
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_byte_order_mark_and_windows_lines_are_accepted(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_bytes(b"\xef\xbb\xbf" + ROOM.replace("\n", "\r\n").encode())
    assert load_room(tmp_path / "own.toml").text == ROOM


@pytest.mark.parametrize("name", ["a\0b.toml", "/dev/zero", "/", "\udcff.toml", "./" + "a" * 5000, "/dev/tty/x.toml"])
def test_hostile_names_are_refused(name: str) -> None:
    for load in (load_room, load_board):
        with pytest.raises(InputError):
            load(name)


def test_a_named_pipe_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    with pytest.raises(InputError, match="it is a named pipe, not a file"):
        load_room(tmp_path / "pipe.toml")


def test_a_large_file_is_refused_before_it_is_read(tmp_path: Path) -> None:
    with (tmp_path / "own.toml").open("wb") as file:
        file.truncate(10**9)
    tracemalloc.start()
    with pytest.raises(InputError, match="is larger than 16 MiB; expected a room file"):
        load_room(tmp_path / "own.toml")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 3 * MOST_BYTES


def test_the_name_of_a_board_fits_into_the_protocol() -> None:
    assert MOST_NAME == MAX_TEXT
    assert parse_board(BOARD.replace('"paper"', f'"{"é" * 30}"', 1), "own").name == "é" * 30
    assert "name: expected at most 60 bytes" in refusal(parse_board, BOARD.replace('"paper"', f'"{"é" * 31}"'))


def test_a_range_offset_makes_no_range_negative() -> None:
    board = parse_board(BOARD + "range_offset = -1.0\n", "own")
    assert board.reported(np.array([0.5, 1.5, np.nan])).tolist() == pytest.approx([0.0, 0.5, np.nan], nan_ok=True)
