"""Room files and board profiles: what is read, and that every error is one line with file, key, found and expected."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from sonarhw_sim.air import Air, Receiver
from sonarhw_sim.board.profile import MOST_NAME, Mount, Tone, board_names, load_board, parse_board
from sonarhw_sim.room.room import Place, load_room, parse_room, room_names

from sonarhw.errors import InputError
from sonarhw.wire.limits import MAX_TEXT
from tests.checkout import CHECKOUT
from tests.fixtures.memory_limit import at_most

ROOM = """name = "r"
[materials.m]
reflectance = 0.9
[materials.foam]
table = [
    { incidence_deg = 60.0, frequency = 50000.0, reflectance = 0.8 },
    { incidence_deg = 0.0, frequency = 50000.0, reflectance = 0.2 },
]
[[walls]]
name = "w"
points = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]
material = "m"
[[posts]]
name = "p"
center = [5.0, 5.0]
radius = 0.5
material = "m"
height = [0.0, 0.4]
[places.here]
position = [0.2, 0.3]
heading_deg = 90.0
height = 0.3
[floor]
height = 0.0
material = "m"
[ceiling]
height = 2.5
material = "m"
"""
BOARD = """name = "mine"
aperture_radius = 0.0192
frequency = 49412.0
transmit_cycles = 16
blanking = 0.00238
max_range = 10.7
threshold_db = -40.0
"""
CHIRP = "[[chirp]]\nfrequency = 60000.0\ncycles = 6\n[[chirp]]\nfrequency = 50000.0\ncycles = 10\n"
BODY = "[[own_body]]\nfrom_deg = -10.0\nto_deg = 20.0\nnearest = 0.2\nfarthest = 0.24\n"


def refusal(parse: Callable[[str, str], object], text: str) -> str:
    """Return the error without the name of the file. It is one short line."""
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
        # keys and names
        ('name = "w"', 'name = "w"\ncolour = "red"', "walls[0].colour: unknown key"),
        ("center", "centre", "posts[0].centre: unknown key; did you mean 'center' (m)? (and 1 more)"),
        ("[materials.m]", "[material.m]", "material: unknown key; did you mean 'materials'?"),
        ("[places.here]", "[[places.here]]", "places.here: expected a table, got a list; write [NAME], not [[NAME]]"),
        ('material = "m"', 'material = "wood"', "walls[0].material: unknown material 'wood' of 'w'; defined: m"),
        ('name = "p"', 'name = "w[0]"', "two surfaces are named 'w[0]'"),
        ('material = "m"\n[[posts]]', 'material = "m"\nedges = ["a"]\n[[posts]]', "a name in edges for each of 2 segm"),
        (
            '"m"\n[[p',
            '"m"\nedges = ["a", "b", "c"]\n[[p',
            "in edges for each of 2 segments, got 3; is closed = true missing?",
        ),
        # values
        ("reflectance = 0.9", "reflectance = 1.9", "materials.m.reflectance: expected less than or equal to 1, got"),
        (
            "reflectance = 0.9",
            "reflectance = 90",
            "equal to 1, got 90; if this is in %, write 0.9",
        ),
        ("reflectance = 0.9", "reflectance = nan", "materials.m.reflectance: expected a finite number"),
        ("radius = 0.5", "radius = 0.0", "posts[0].radius: expected greater than 0"),
        ("heading_deg = 90.0", "heading_deg = 1e154", "heading_deg: expected less than or equal to 36000 degrees, got"),
        ("[1.0, 0.0], [1.0, 1.0]]", "[0.0, 0.0]]", "segment 0 of wall 'w'"),
        ("[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]", "[[0.0, 0.0]]", "walls[0].points"),
        ("[1.0, 0.0], [1.0", "[1.0, 0.0, 2.0], [1.0", "walls[0].points[1]: expected 2 values, got 3"),
        ("[1.0, 0.0], [1.0", "[1,0, 0,0], [1.0", "points[1]: expected 2 values, got 4; write numbers with a point"),
        ("position = [0.2, 0.3]\nheading_deg = 90.0\nheight = 0.3", "position = [5.1, 5.1]", "lies inside post 'p'"),
        # heights
        ("height = [0.0, 0.4]", "height = [0.4, 0.0]", "height of post 'p' must be [lower, upper], got [0.4, 0.0]"),
        ("height = 0.3", "height = -0.3", "height of place 'here' must lie between floor and ceiling, 0 to 2.5, got -"),
        ("height = 2.5", "height = 0.0", "the floor must lie below the ceiling, got heights 0 and 0"),
        # tables of reflectances
        ("table = [", "reflectance = 0.5\ntable = [", "materials.foam: reflectance, table: expected one of them"),
        ("60.0, frequency = 50000.0", "60.0, frequency = 6e4", "got no row for 0° at 60000 Hz"),
        ("deg = 0.0, freq", "deg = 60.0, freq", "got 2 rows for 60° at 50000 Hz"),
        ("50000.0", "50.0", "frequency: expected greater than or equal to 1000 Hz, got 50.0; if this is in kHz, write"),
        # not TOML
        ("position = [0.2, 0.3]", "position = [0.2", "; a ] is missing before it"),
        ("radius = 0.5", "radius = 0,5", "'radius = 0,5'; write numbers with a point"),
    ],
)
def test_a_wrong_room_is_refused_with_key_and_reason(old: str, new: str, message: str) -> None:
    assert old in ROOM
    assert message in refusal(parse_room, ROOM.replace(old, new, 1))


def test_a_room_without_walls_is_refused() -> None:
    assert "at least one" in refusal(parse_room, 'name = "empty"')


def test_every_key_of_a_board_is_read_and_has_its_default() -> None:
    board = parse_board(BOARD, "mine.toml")
    assert (board.receiver, board.burst) == (Receiver.FIRST_ECHO, (Tone(frequency=49412.0, cycles=16),))
    assert (board.gain_steps, board.blanking_end, board.mounting.turns_about_face) == ((), board.blanking, True)
    assert (board.threshold_sd_db, board.range_sd) == (0.0, 0.0)
    text = BOARD + (
        'receiver = "board"\nrise_cycles = 2.0\nring_cycles = 11.0\nown_burst_db = 6.0\nintegration_cycles = 4.0\n'
        "gain_steps = [0.002, 0.005]\ngain_step_db = 5.0\nblanking_inhibit = 0.001\nrearm = 0.0005\n"
        "clock_error = -0.01\nthreshold_sd_db = 2.5\nrange_sd = 0.004\n"
    )
    board = parse_board(f"{text}{CHIRP}[mount]\nahead = 0.02\naside = -0.01\n", "mine.toml")
    assert (board.receiver, board.rise_cycles, board.ring_cycles, board.own_burst_db) == (
        Receiver.BOARD,
        2.0,
        11.0,
        6.0,
    )
    assert (board.integration_cycles, board.gain_steps, board.gain_step_db) == (4.0, (0.002, 0.005), 5.0)
    assert (board.rearm, board.clock_error, board.blanking_end) == (0.0005, -0.01, 0.001)
    assert (board.threshold_sd_db, board.range_sd) == (2.5, 0.004)
    assert board.burst == (Tone(frequency=60000.0, cycles=6), Tone(frequency=50000.0, cycles=10))
    assert board.mounting == Mount(ahead=0.02, aside=-0.01)
    assert board.blanked_range(Air()) == pytest.approx(0.001 * 343.987 / 2, rel=1e-4)
    assert parse_board(board.text, "its text") == board


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("blanking", "blancking", "blancking: unknown key; did you mean 'blanking' (s)?"),
        ("", "[mount]\nahead_mm = 3\n", "mount.ahead_mm: unknown key; did you mean 'ahead' (m)?"),
        ("aperture_radius = 0.0192\n", "", "aperture_radius: missing"),
        ("", 'receiver = "best"', "receiver: expected 'first-echo' or 'board', got 'best'"),
        # numbers with a guess of their unit
        ("49412.0", "49.412", "frequency: expected greater than or equal to 1000 Hz, got 49.412; if this is in kHz"),
        ("0.0192", "19.2", "radius: expected less than or equal to 1 m, got 19.2; if this is in mm, write 0.0192"),
        ("0.00238", "2.38", "blanking: expected less than or equal to 1 s, got 2.38; if this is in ms, write 0.00238"),
        ("10.7", "0.4", "max_range: expected more than 0.409 m, where blanking ends, got 0.4; it"),
        ("", "range_offset = -5.0", "range_offset: expected greater than or equal to -1 m, got -5.0; if this is in mm"),
        # the receiver
        ("", "gain_steps = [0.005, 0.002]", "gain_steps: expected increasing times"),
        ("", f"gain_steps = [{', '.join(['1e-9'] * 1001)}]", "gain_steps"),
        ("", "gain_steps = [0.002]\nfixed_gain = true", "fixed_gain and gain_steps: expected one of them; a"),
        ("", "blanking_inhibit = 0.003", "blanking_inhibit: expected 0.00238 s"),
        ("", CHIRP.replace("10", "11"), "chirp: expected transmit_cycles = 16 cycles in all, got 17"),
        ("", CHIRP.replace("60000.0", "80000.0"), "chirp[0].frequency: expected one within 30000 Hz"),
        # mount, ring and own body
        ("", "[mount]\nbody_radius = 0.1\n", "the face would lie inside the body"),
        ("", "[mount]\nseparation = -0.1\n", "mount.separation"),
        ("", "[mount]\nahead = 0.1\n[ring]\nsensors = 4\nradius = 0.1\n", "[mount] and [ring]"),
        ("", "[ring]\nsensors = 4\n", "ring.radius: missing"),
        ("", "[ring]\nsensors = 3\nradius = 0.1\norder = [0, 1, 1]\n", "each sensor from 0 to 2 once"),
        ("", BODY.replace("20.0", "-11.0"), "to_deg"),
        ("", BODY.replace("0.24", "0.1"), "farthest"),
    ],
)
def test_a_wrong_board_is_refused_with_key_and_reason(old: str, new: str, message: str) -> None:
    text = BOARD.replace(old, new, 1) if old else BOARD + new
    assert message in refusal(parse_board, text)


def test_reported_ranges_are_the_nearest_multiples_of_the_rounding_and_never_negative() -> None:
    board = parse_board(BOARD + "rounding = 0.01\nrange_offset = 0.1", "mine.toml")
    reported = board.reported(np.array([0.4149, 0.4151, 0.4199, math.nan]))
    assert reported == pytest.approx([0.51, 0.52, 0.52, math.nan], nan_ok=True)
    assert parse_board(BOARD, "mine.toml").reported(np.array([0.4149])) == pytest.approx([0.4149])
    short = parse_board(BOARD + "range_offset = -1.0\n", "own")
    assert short.reported(np.array([0.5, 1.5])).tolist() == pytest.approx([0.0, 0.5])


def test_gain_steps_of_the_6500_follow_its_clock() -> None:
    steps, end = [], 16 / 49.412e3
    for clocks in (192, *[256] * 7, *[512] * 3):
        end += clocks / 93.33e3
        steps.append(end)
    assert load_board("polaroid-6500").gain_steps == pytest.approx(steps, abs=2e-5)


def test_the_name_of_a_board_fits_into_the_protocol() -> None:
    assert MOST_NAME == MAX_TEXT
    assert parse_board(BOARD.replace("mine", "é" * 30, 1), "own").name == "é" * 30
    assert "name: expected at most 60 bytes" in refusal(parse_board, BOARD.replace("mine", "é" * 31))


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("1" + "0" * 5000, "a number has too many digits"),
        ("0x" + "f" * 100_000, "expected a valid number, got a huge number"),
        ("1" + "0" * 400, "expected a valid number, got 1000"),
        ("[" * 100_000, "nested too deeply"),
        ("[" * 30 + "]" * 30, "expected a valid number, got ((((("),
        ("{a = {a = {a = 1}}}", "expected a valid number, got a table"),
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
    assert message in refusal(parse_room, ROOM.replace("radius = 0.5", f"radius = {value}"))
    assert message in refusal(parse_board, BOARD.replace("frequency = ", f"frequency = {value} #"))


@pytest.mark.parametrize(
    "text",
    ["a." * 200_000 + "a = 1", '"a b" . ' * 200_000 + "a = 1", "[a" + ".a" * 200_000 + "]", "x = " + "{a=" * 50_000],
    ids=["dots", "quoted", "table", "inline"],
)
def test_deep_keys_are_one_line(text: str) -> None:
    message = refusal(parse_room, ROOM + "\n" + text)
    assert "more than 100 parts" in message or "too deeply" in message


def test_too_many_walls_are_refused_in_bounded_memory() -> None:
    points = ", ".join(f"[{k % 1000}, {k // 1000}]" for k in range(210_000))
    with at_most(400_000_000):
        message = refusal(parse_room, ROOM.replace("[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]", points))
    assert message == "walls[0].points: expected at most 200000 values, got 210000"


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
def test_other_contents(tmp_path: Path, load: Callable[[str], object], content: bytes, message: str) -> None:
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


# Names: shipped rooms and boards, and files that have the same names.


OWN_ROOM = (CHECKOUT / "rooms/simple.toml").read_text().replace("Simple room", "My own room")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with a room and a board of the user that have shipped names."""
    for name in ("laboratory.toml", "laboratory", "bare"):
        (tmp_path / name).write_text(OWN_ROOM)
    (tmp_path / "scan.mcap").write_bytes(b"\x89MCAP0\r\n\x01\x00\x00")
    (tmp_path / "picture").write_bytes(b"\x89PNG\r\n\x1a\n\x00\x00")
    (tmp_path / "paper.toml").write_text(BOARD)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_name_is_the_shipped_one_whatever_the_working_directory_holds(folder: Path) -> None:
    assert room_names() == sorted(path.stem for path in (CHECKOUT / "rooms").glob("*.toml"))
    for name in room_names():
        assert load_room(name).text == (CHECKOUT / f"rooms/{name}.toml").read_text()
    assert all(load_board(name).name == name for name in board_names())


# Places by name or numbers.


def test_a_place_is_given_by_name_by_numbers_or_alone() -> None:
    room = parse_room(ROOM, "good.toml")
    assert room.place(None) == room.place("here")
    assert room.place("0.5,0.25") == Place("0.5,0.25", (0.5, 0.25), 0.0)
    assert room.place("0.5,0.25,90") == Place("0.5,0.25,90", (0.5, 0.25), math.pi / 2)
    for pose in ([0.5, 0.25, math.pi / 2], np.array([0.5, 0.25, math.pi / 2])):
        assert room.place(pose) == room.place("0.5,0.25,90")
    # a place at two numbers is named in millimetres and keeps its position
    for position, name in (((0.294701487374397, 0.2505910713629), "0.295,0.251"), ((1.0, -1e-12), "1,0")):
        assert (room.place(position).name, room.place(position).position) == (name, position)
    with pytest.raises(InputError, match="figure7, figure9"):
        load_room("simple").place(None)


@pytest.mark.parametrize(
    "place",
    ["there", "1,2,3,4", "nan,1", "1,2,inf", "1,2,x", "5.2,5.0", (1.0,), (1, 2, 3, 4), [(0.5, 0.2)], ("a", "b"), 1.0],
)
def test_a_wrong_place_is_refused(place: object) -> None:
    with pytest.raises(InputError):
        parse_room(ROOM.replace("height = [0.0, 0.4]\n", ""), "good.toml").place(place)  # type: ignore[arg-type]
