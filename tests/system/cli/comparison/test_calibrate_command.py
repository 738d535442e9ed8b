"""`sonarhw calibrate` with a served board: the written profile is valid and has the simulated offset and angle."""

import math
from pathlib import Path

import pytest
from sonarhw_cli.app import run
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.room_echoes import plate_echo

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import serve
from sonarhw.sound_speed import speed_of_sound
from tests.fixtures.plate import Plate

DISTANCE = 1.25
CHIRP = """
[[chirp]]
frequency = 50000.0
cycles = 10
[[chirp]]
frequency = 48000.0
cycles = 6
"""


def calibrated(out: Path, *options: str) -> int:
    """Calibrate with a plate 2 degrees to the left of its stated angle, whose ranges are 8 mm longer than predicted."""
    longer = 0.008 + plate_echo(load_board("polaroid-6500"), Air(), DISTANCE).delay
    board = FakeBoard(Plate(DISTANCE, math.radians(2.0), longer, speed_of_sound(20.0)))
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        return run(["calibrate", endpoint.url, "--distance", str(DISTANCE), "--out", str(out), *options])


def test_the_profile_contains_offset_and_home_angle_of_the_plate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "bench.toml"
    assert calibrated(out) == 0
    printed = capsys.readouterr().out
    assert "range offset +8." in printed
    profile, shipped = load_board(str(out)), load_board("polaroid-6500")
    assert profile.name == "bench"
    assert profile.range_offset == pytest.approx(0.008, abs=0.001)
    assert profile.home_angle_deg == pytest.approx(-2.0, abs=0.26)
    assert (profile.frequency, profile.blanking, profile.threshold_db) == (
        shipped.frequency,
        shipped.blanking,
        shipped.threshold_db,
    )
    assert "# m, measured minus true; before: 0\n" in profile.text
    # again, with the written profile: its keys are replaced, not added
    assert calibrated(out, "--board", str(out), "--force") == 2
    again = tmp_path / "again.toml"
    assert calibrated(again, "--board", str(out)) == 0
    assert load_board(str(again)).range_offset == pytest.approx(profile.range_offset, abs=1e-5)


ROOM = """
name = "Plate"
[materials.steel]
reflectance = 0.95
[[walls]]
name = "far"
points = [[-3.0, -3.5], [4.0, -3.5], [4.0, 3.5], [-3.0, 3.5]]
closed = true
material = "steel"
[places.bench]
position = [0.0, 0.0]
"""


def plate(distance: float, tilt: float = 0.0, width: float = 0.5) -> str:
    """Return a plate straight ahead, turned by `tilt` degrees, for a room file."""
    x, y = math.sin(math.radians(tilt)) * width / 2, math.cos(math.radians(tilt)) * width / 2
    points = [[distance + x, -y], [distance - x, y]]
    return f'[[walls]]\nname = "plate"\npoints = {points}\nmaterial = "steel"\n'


def post(distance: float, radius: float) -> str:
    return f'[[posts]]\nname = "post"\ncenter = [{distance + radius}, 0.0]\nradius = {radius}\nmaterial = "steel"\n'


@pytest.mark.parametrize(("tilt", "seed"), [(0.0, 2), (3.0, 4), (-6.0, 2)])
def test_a_plate_in_a_simulated_room_gives_right_values(tmp_path: Path, tilt: float, seed: int) -> None:
    """The fake stands some millimetres from its place, and its thermometer is wrong by some tenths of a degree."""
    room, out = tmp_path / "room.toml", tmp_path / "bench.toml"
    room.write_text(ROOM + plate(DISTANCE, tilt))
    url = f"fake:{room}?place=bench&pace=max&seed={seed}"
    assert run(["calibrate", url, "--distance", str(DISTANCE), "--out", str(out)]) == 0
    found = load_board(str(out))
    # the near rim of a turned plate is some millimetres farther than the plate, so noise hides where it begins
    assert found.home_angle_deg == pytest.approx(-tilt, abs=0.6 if tilt else 0.3)
    assert found.range_offset == pytest.approx(DISTANCE * (math.cos(math.radians(tilt)) - 1), abs=0.010)
    if tilt < -5:  # a side lobe misses a plate of 50 cm
        assert found.aperture_radius == load_board("polaroid-6500").aperture_radius


@pytest.mark.parametrize(
    ("objects", "seen"),
    [
        ("", "the plate is detected at 0 headings"),
        (plate(DISTANCE + 0.2), "the echo comes from 1.4"),
        (plate(DISTANCE - 0.2), "the echo comes from 1.0"),
        (plate(DISTANCE, tilt=12.0), "degrees, expected 0 degrees within 10"),
        (plate(DISTANCE, tilt=25.0), ""),
        (plate(DISTANCE, width=1.0, tilt=40.0), ""),
        (post(DISTANCE, 0.03), "for a flat plate and this board profile"),
        (post(DISTANCE, 0.1), "for a flat plate and this board profile"),
    ],
    ids=["no plate", "too far", "too near", "tilt 12", "tilt 25", "tilt 40", "thin post", "post"],
)
def test_anything_but_a_plate_at_the_stated_distance_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], objects: str, seen: str
) -> None:
    room, out = tmp_path / "room.toml", tmp_path / "bench.toml"
    room.write_text(ROOM + objects)
    url = f"fake:{room}?place=bench&pace=max&seed=1"
    assert run(["calibrate", url, "--distance", str(DISTANCE), "--out", str(out)]) == 1
    error = capsys.readouterr().err
    assert seen in error
    assert error.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize(
    ("distance", "direction"),
    [
        (1.0, 180),
        pytest.param(1.5, 0, marks=pytest.mark.soak),
        pytest.param(1.0, 270, marks=pytest.mark.soak),
    ],
)
def test_clutter_of_a_laboratory_is_no_plate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], distance: float, direction: int
) -> None:
    out = tmp_path / "bench.toml"
    options = ["--distance", str(distance), "--direction", str(direction), "--step", "1", "--out", str(out)]
    assert run(["calibrate", "fake:rooms/laboratory.toml?place=bench&pace=max", *options]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize(
    ("name", "trailing"),
    [
        ("bench", "[mount]\nahead = 0.01\n"),
        ("bench", CHIRP),
        ('a "quoted" name', CHIRP),
        ("back\\slash", CHIRP),
        ("newline\n#", CHIRP),
        ("umlaut ä", CHIRP),
    ],
)
def test_keys_go_to_the_top_of_the_profile_and_any_name_is_valid(tmp_path: Path, trailing: str, name: str) -> None:
    given, out = tmp_path / "given.toml", tmp_path / f"{name}.toml"
    given.write_text(f"# mine\n{load_board('polaroid-6500').text}\n# below\n{trailing}")
    assert calibrated(out, "--board", str(given)) == 0
    before, after = load_board(str(given)), load_board(str(out))
    assert after.name == name
    assert after.range_offset == pytest.approx(0.008, abs=0.001)
    assert (after.mount, after.chirp) == (before.mount, before.chirp)
    kept = [line for line in given.read_text().splitlines() if line and not line.startswith("name")]
    assert [line for line in out.read_text().splitlines() if line in kept] == kept
