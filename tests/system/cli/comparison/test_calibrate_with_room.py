"""`sonarhw calibrate LOG… --room`: simulated scans give back the board and the reflectance of their simulation."""

import re
from pathlib import Path

import pytest
from sonarhw_cli.app import run
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

PLACES = ("p0", "p1", "p2", "p3")
NXT = load_board("lego-nxt").text
TRUE = (
    NXT.replace("threshold_db = -17.5", "threshold_db = -20.5")
    + """
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
)


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return the logs of a sensor with the board TRUE at p0 to p3, where the walls reflect less than the file says."""
    folder = tmp_path_factory.mktemp("room")
    (folder / "true.toml").write_text(TRUE)
    (folder / "room.toml").write_text(load_room("arena").text.replace("reflectance = 0.9", "reflectance = 0.7"))
    made = []
    for place in PLACES:
        log = folder / f"{place}.mcap"
        board = ["--board", str(folder / "true.toml"), "--own-body"]
        assert (
            run(
                [
                    "-q",
                    "simulate",
                    str(folder / "room.toml"),
                    "--place",
                    place,
                    *board,
                    "--step",
                    "4",
                    "--out",
                    str(log),
                ]
            )
            == 0
        )
        made.append(log)
    return made


def test_the_board_of_simulated_scans_is_found(
    logs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, room, picture = tmp_path / "mine.toml", tmp_path / "walls.toml", tmp_path / "both.png"
    options = ["--board", "lego-nxt", "--out", str(out), "--room-out", str(room), "--plot", str(picture)]
    options += ["--room", "arena"]
    assert run(["calibrate", *map(str, logs), *options]) == 0
    printed = capsys.readouterr().out
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
    assert "own body: turntable angles" in printed
    assert re.search("p0: after (100|9[0-9])% of the echoes within 5 cm", printed)
    assert picture.stat().st_size > 10_000
    assert load_room(room).reflectances[0] == pytest.approx(0.7, abs=0.08)
    assert "# Reflectances found by `sonarhw calibrate`, together with board profile 'mine'" in room.read_text()
    text = out.read_text()
    assert text.startswith("# Calibrated by `sonarhw calibrate` in room 'Arena', beginning with profile 'lego-nxt'")
    assert "# calibrated, 95 % " in text


def test_one_place_proposes_the_own_body_and_does_not_apply_it(
    logs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "one.toml"
    assert run(["calibrate", str(logs[0]), "--room", "arena", "--board", "lego-nxt", "--out", str(out)]) == 0
    printed = capsys.readouterr()
    assert load_board(out).own_body == ()
    assert "perhaps own body; scan from another place" in printed.err
    assert "own_body: stays 0 parts; all logs are from one place" in printed.out
    assert "the room file says 0.9; not used; the profile belongs to the room file" in printed.out


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--room", "arena", "--distance", "1"], "--distance and --room: expected one of them"),
        (["--room", "arena", "--place", "p0"], "--place: expected one for each of 2 logs, got 1"),
        (["--room", "arena", "--pose", "1,2", "--pose", "1,2"], "--pose 1,2: expected X,Y,DEG"),
        (["--room", "arena", "--place", "p0", "--pose", "1,2,3"], "--place and --pose: expected one of them"),
        (["--place", "p0"], "expected --distance of a plate, or --room"),
        (["--distance", "1", "--plot", "a.png"], "--plot: needs --room"),
        (["--distance", "1", "--room-out", "a.toml"], "--room-out: needs --room"),
        (["--room", "arena", "--room-out", "{out}"], "is also --out; choose another name"),
        (["--room", "arena", "--room-out", "a.csv"], "--room-out a.csv: expected a name ending in .toml"),
        (["--room", "arena", "--traces"], "No such option"),
    ],
)
def test_wrong_options_are_one_line_and_leave_no_profile(
    logs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], message: str
) -> None:
    out = tmp_path / "none.toml"
    given = [option.format(out=out) for option in options]
    assert run(["calibrate", *map(str, logs[:2]), *given, "--board", "lego-nxt", "--out", str(out)]) == 2
    assert message in capsys.readouterr().err
    assert not out.exists()


def test_a_url_with_a_room_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "none.toml"
    assert run(["calibrate", "socket://127.0.0.1:1", "--room", "arena", "--out", str(out)]) == 2
    assert "--room arena: expected logs" in capsys.readouterr().err
