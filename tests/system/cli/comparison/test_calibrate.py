"""`sonarhw calibrate`: a served board, scans of a plate and of a known room give back the board of the scanner."""

import math
import re
from pathlib import Path

import pytest
from sonarhw_cli.app import run
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.room_echoes import plate_echo
from sonarhw_sim.room.room import load_room

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import serve
from sonarhw.sound_speed import speed_of_sound
from tests.fixtures.commands import printed, printed_json, sonarhw
from tests.fixtures.plate import Plate
from tests.fixtures.plate_scans import WALL

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


def test_the_profile_has_offset_and_home_angle(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
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


@pytest.mark.parametrize(("tilt", "seed"), [(0.0, 2), pytest.param(3.0, 4, marks=pytest.mark.soak), (-6.0, 2)])
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
        pytest.param(plate(DISTANCE, tilt=25.0), "", marks=pytest.mark.soak),
        (plate(DISTANCE, width=1.0, tilt=40.0), ""),
        pytest.param(post(DISTANCE, 0.03), "for a flat plate and this board profile", marks=pytest.mark.soak),
        (post(DISTANCE, 0.1), "for a flat plate and this board profile"),
    ],
    ids=["no plate", "too far", "too near", "tilt 12", "tilt 25", "tilt 40", "thin post", "post"],
)
def test_no_plate_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], objects: str, seen: str) -> None:
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
    [(1.0, 180), pytest.param(1.5, 0, marks=pytest.mark.soak), pytest.param(1.0, 270, marks=pytest.mark.soak)],
)
def test_clutter_of_a_laboratory_is_no_plate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], distance: float, direction: int
) -> None:
    out = tmp_path / "bench.toml"
    options = ["--distance", str(distance), "--direction", str(direction), "--step", "2", "--out", str(out)]
    assert run(["calibrate", "fake:rooms/laboratory.toml?place=bench&pace=max", *options]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    assert not out.exists()


def test_keys_go_to_the_top_of_the_profile_and_any_name_is_valid(tmp_path: Path) -> None:
    name, trailing = 'a "quoted" back\\slash, an ä and a\n# new line', f"[mount]\nahead = 0.01\n{CHIRP}"
    given, out = tmp_path / "given.toml", tmp_path / f"{name}.toml"
    given.write_text(f"# mine\n{load_board('polaroid-6500').text}\n# below\n{trailing}")
    assert calibrated(out, "--board", str(given), "--step", "1") == 0
    before, after = load_board(str(given)), load_board(str(out))
    assert after.name == name
    assert after.range_offset == pytest.approx(0.008, abs=0.001)
    assert (after.mount, after.chirp) == (before.mount, before.chirp)
    kept = [line for line in given.read_text().splitlines() if line and not line.startswith("name")]
    assert [line for line in out.read_text().splitlines() if line in kept] == kept


# logs


PLATES = {"near": 0.25, "middle": 0.5, "far": 1.0}  # m
HIDDEN = {"aperture_radius": 0.0178, "gain_step_db": 3.3, "threshold_db": -36.5, "blanking": 0.0017}
SECTOR = ("--from", "-40", "--to", "40")
TRUE = """
turntable_scale = 1.05
home_angle_deg = 6.0
range_offset = -0.02
clock_error = 0.015
[[own_body]]
from_deg = 40.0
to_deg = 70.0
nearest = 0.12
farthest = 0.16
"""


def changed(values: dict[str, float]) -> str:
    """Return the shipped profile with other values."""
    text = load_board("polaroid-6500").text
    for key, value in values.items():
        text = re.sub(f"^{key} = .*$", f"{key} = {value}", text, flags=re.MULTILINE)
    return text


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the start profile, and logs of a wall by a fake scanner with other constants."""
    folder = tmp_path_factory.mktemp("plates")
    places = "".join(f"[places.{name}]\nposition = [{-one}, 0.0]\n" for name, one in PLATES.items())
    (folder / "wall.toml").write_text(WALL + places)
    (folder / "hidden.toml").write_text(changed(HIDDEN))
    (folder / "start.toml").write_text(changed({"blanking": 0.0008}))
    for name in PLATES:
        # with seed 1, the post of the fake is in the beam
        url = f"fake:{folder / 'wall.toml'}?place={name}&board={folder / 'hidden.toml'}&pace=max&seed=2"
        options = (*SECTOR, "--step", "2", "--pings", "3", "--traces", "--board", folder / "start.toml")
        printed("scan", url, *options, "--out", folder / f"{name}.mcap")
    return folder


def test_the_profile_contains_the_constants_of_the_scanner(folder: Path) -> None:
    logs = [folder / f"{name}.mcap" for name in PLATES]
    distances = [text for distance in PLATES.values() for text in ("--distance", str(distance))]
    files = ("--board", folder / "start.toml", "--out", folder / "mine.toml")
    text = printed("calibrate", *logs, *distances, *files)
    assert "aperture_radius: 0.017" in text
    assert "; before: 0.0192" in text
    found = load_board(folder / "mine.toml")
    assert found.name == "mine"
    assert found.aperture_radius == pytest.approx(HIDDEN["aperture_radius"], rel=0.02)
    assert found.gain_step_db == pytest.approx(HIDDEN["gain_step_db"], abs=0.5)
    assert found.blanking == pytest.approx(HIDDEN["blanking"], abs=20e-6)
    assert found.max_range == load_board("polaroid-6500").max_range
    assert "#   middle.mcap: plate at 0.5 m" in found.text


def test_a_plate_scanned_now_gives_what_a_log_of_the_same_scan_gives(folder: Path) -> None:
    board = {"aperture_radius": 0.0178, "threshold_db": -36.5}
    (folder / "louder.toml").write_text(changed(board))
    url = f"fake:{folder / 'wall.toml'}?place=far&board={folder / 'louder.toml'}&pace=max&seed=1"
    log = folder / "now.mcap"
    printed("scan", url, "--from", "-30", "--to", "30", "--step", "0.5", "--pings", "3", "--out", log)
    options = ("--distance", "1", "--board", "polaroid-6500", "--out", folder / "now.toml", "--force")
    results = [printed_json("calibrate", source, *options) for source in (url, log)]
    now, later = ({one["key"]: one for one in result["findings"]} for result in results)
    assert results[0]["plate"]["headings"] > 20
    assert now.pop("range_offset")["value"] == pytest.approx(results[0]["plate"]["range_offset"], abs=1e-5)
    assert now.pop("home_angle_deg")["low"] < 0.3
    assert now == later
    kept = {"blanking", "rise_cycles", "gain_step_db", "own_burst_db"}
    assert [set(result["kept"]) for result in results] == [kept, kept]
    for key, value in board.items():
        assert now[key]["low"] <= value <= now[key]["high"]


def test_logs_that_determine_no_value_give_no_profile(folder: Path, tmp_path: Path) -> None:
    log, out = tmp_path / "plate.mcap", tmp_path / "mine.toml"
    wall = ("simulate", folder / "wall.toml", "--place", "far", "--board", "hc-sr04")
    printed(*wall, *SECTOR, "--step", "1", "--out", log)
    # without --board, the calibration begins with the board of the log
    done = sonarhw("calibrate", log, "--distance", "1", "--out", out)
    assert f"aperture_radius: stays {load_board('hc-sr04').aperture_radius:g}" in done.stdout
    assert "mine.toml: not written: the logs determine no value" in done.stderr
    wrong = sonarhw("calibrate", folder / "far.mcap", "--distance", "2.5", "--out", out)
    assert "far.mcap: the plate is detected at 0 headings" in wrong.stderr
    assert (done.returncode, wrong.returncode, out.exists()) == (1, 1, False)


@pytest.fixture(scope="module")
def in_room(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Logs of a sensor with the board TRUE at p0, p1 and p3, where the walls reflect less than the file says."""
    folder = tmp_path_factory.mktemp("room")
    board = load_board("lego-nxt").text.replace("threshold_db = -17.5", "threshold_db = -20.5") + TRUE
    (folder / "true.toml").write_text(board)
    (folder / "room.toml").write_text(load_room("arena").text.replace("reflectance = 0.9", "reflectance = 0.7"))
    logs = [folder / f"p{number}.mcap" for number in (0, 1, 3)]
    for log in logs:
        options = ("--board", folder / "true.toml", "--own-body", "--step", "5", "--out", log)
        printed("simulate", folder / "room.toml", "--place", log.stem, *options)
    return logs


def test_the_board_of_simulated_scans_is_found(in_room: list[Path], tmp_path: Path) -> None:
    out, room, picture = tmp_path / "mine.toml", tmp_path / "walls.toml", tmp_path / "both.png"
    options = ("--room", "arena", "--board", "lego-nxt")
    text = printed("calibrate", *in_room, *options, "--out", out, "--room-out", room, "--plot", picture)
    found = load_board(out)
    assert found.threshold_db == pytest.approx(-20.5, abs=1.5)
    assert found.aperture_radius == pytest.approx(0.00375, rel=0.15)
    assert found.turntable_scale == pytest.approx(1.05, abs=0.01)
    assert found.home_angle_deg == pytest.approx(6.0, abs=1.5)
    assert found.range_offset == pytest.approx(-0.02, abs=0.008)
    assert found.clock_error == pytest.approx(0.015, abs=0.006)
    part = found.own_body[0]
    assert part.spans(0.96)
    assert 0.105 <= part.nearest <= 0.13  # the true range, and 2.5 cm more at both sides
    assert 0.15 <= part.farthest <= 0.175
    assert "own body: turntable angles" in text
    assert re.search("p0: after (100|9[0-9])% of the echoes within 5 cm", text)
    assert picture.stat().st_size > 10_000
    assert load_room(room).reflectances[0] == pytest.approx(0.7, abs=0.08)
    assert "# Reflectances found by `sonarhw calibrate`, together with board profile 'mine'" in room.read_text()
    profile = out.read_text()
    assert profile.startswith("# Calibrated by `sonarhw calibrate` in room 'Arena', beginning with profile 'lego-nxt'")
    assert "# calibrated, 95 % " in profile


def test_one_place_proposes_the_own_body_and_does_not_apply_it(in_room: list[Path], tmp_path: Path) -> None:
    out = tmp_path / "one.toml"
    done = sonarhw("calibrate", in_room[0], "--room", "arena", "--board", "lego-nxt", "--out", out)
    assert (done.returncode, load_board(out).own_body) == (0, ())
    assert "perhaps own body; scan from another place" in done.stderr
    assert "own_body: stays 0 parts; all logs are from one place" in done.stdout
    assert "the room file says 0.9; not used; the profile belongs to the room file" in done.stdout
