"""`sonarhw room` and `sonarhw profile`: templates, checks, drawings; options that cannot be meant."""

import json
from pathlib import Path

import pytest
from sonarhw_cli.app import run
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room

from tests.checkout import CHECKOUT

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_new_room_is_clean_and_is_simulated(capsys: Capture) -> None:
    assert run(["room", "new", "own.toml"]) == 0
    assert run(["room", "check", "own.toml"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "own.toml: no findings; 7 walls, 1 post, 1 place"
    assert run(["simulate", "own.toml", "--step", "90"]) == 0


def test_a_new_room_of_a_size_has_four_walls_and_the_place(capsys: Capture) -> None:
    assert run(["room", "new", "--size", "3.2x2.4", "--place", "1.6,0.12"]) == 0
    assert "heading 0 assumed" in capsys.readouterr().err
    room = load_room("./room.toml")
    assert sorted(map(tuple, room.walls[:, :2].tolist())) == [(0, 0), (0, 2.4), (3.2, 0), (3.2, 2.4)]
    assert (len(room.posts), room.places["scanner"].position) == (0, (1.6, 0.12))
    assert run(["room", "check", "room.toml"]) == 0


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--size", "3.2"], "--size 3.2: expected width and depth in metres"),
        (["--size", "3x2", "--place", "4,1"], "--place 4,1: is not in the room"),
        (["--size", "3x2", "--place", "desk"], "--place desk: expected X,Y in metres"),
        (["--place", "1,1"], "--place needs --size"),
    ],
)
def test_a_size_that_is_none_is_refused(options: list[str], expected: str, capsys: Capture) -> None:
    assert run(["room", "new", "own.toml", *options]) == 2
    assert expected in capsys.readouterr().err
    assert not Path("own.toml").exists()


def test_an_imported_room_is_written_with_how_it_was_read(capsys: Capture) -> None:
    Path("plan.json").write_text(
        '{"type": "LineString", "coordinates": [[0, 0], [3.2, 0], [3.2, 2.4], [0, 2.4], [0, 0]]}'
    )
    assert run(["room", "import", "plan.json"]) == 2
    assert "give it with --unit. m: 3.2 by 2.4 m" in capsys.readouterr().err
    assert run(["room", "import", "plan.json", "--unit", "m"]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0] == "unit: m"
    assert out[-1] == "plan.toml: 4 walls, 0 posts; places: none: commands take --place X,Y,DEG; 0 findings"
    assert run(["room", "check", "plan.toml"]) == 0
    assert run(["room", "import", "plan.json", "--unit", "m"]) == 2
    assert "exists already; choose another --out or add --force" in capsys.readouterr().err


def test_a_new_profile_is_the_default_board_and_is_clean() -> None:
    assert run(["profile", "new", "own.toml"]) == 0
    assert run(["profile", "check", "own.toml"]) == 0
    assert load_board("./own.toml").frequency == load_board("polaroid-6500").frequency


@pytest.mark.parametrize("group", ["room", "profile"])
def test_new_overwrites_nothing(group: str, capsys: Capture) -> None:
    Path("own.toml").write_text("mine")
    assert run([group, "new", "own.toml"]) == 2
    assert run([group, "new", "own.txt"]) == 2
    assert run([group, "new", "no/such/own.toml"]) == 2
    existing, suffix, folder = capsys.readouterr().err.splitlines()
    assert existing == "sonarhw: own.toml: exists already; choose another name"
    assert suffix == "sonarhw: own.txt: expected a name ending in .toml"
    assert "no such folder: no/such" in folder
    assert Path("own.toml").read_text() == "mine"


def test_check_prints_draws_and_exits_with_1(capsys: Capture) -> None:
    text = (CHECKOUT / "rooms/simple.toml").read_text().replace('"Simple room"', '"$x^$ \\u001b[31m"')
    Path("own.toml").write_text(text + "[materials.unused]\nreflectance = 1\n[places.out]\nposition = [3.0, 3.0]\n")
    for suffix, start in (("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")):
        assert run(["room", "check", "own.toml", "--plot", f"p.{suffix}"]) == 1
        assert Path(f"p.{suffix}").read_bytes().startswith(start)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("1: place 'out': is outside the room, at 3, 3 m; ")
    assert lines[1].startswith("2: material 'unused': no wall")
    assert "own.toml: 2 findings; 4 walls, 0 posts, 3 places" in lines
    assert run(["room", "check", "own.toml", "--json"]) == 1
    figures = json.loads(capsys.readouterr().out)
    assert [finding["kind"] for finding in figures["findings"]] == ["place outside", "unused material"]
    assert figures["findings"][0]["at"] == [[3.0, 3.0]]


def test_check_lists_every_error_of_a_refused_file_and_exits_with_2(capsys: Capture) -> None:
    Path("own.toml").write_text("nam = 'x'\n[[posts]]\nname = 'p'\n")
    assert run(["room", "check", "own.toml"]) == 2
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "own.toml: nam: unknown key; did you mean 'name'?"
    assert lines[-1].endswith("errors; no command accepts this file")
    assert run(["profile", "check", "own.toml"]) == 2
    assert "aperture_radius: missing; it is required" in capsys.readouterr().out
    assert run(["room", "check", "own.toml", "--json"]) == 2
    assert len(json.loads(capsys.readouterr().out)["refused"]) == len(lines) - 1


def test_lists_name_what_is_shipped(capsys: Capture) -> None:
    assert run(["room", "list"]) == run(["profile", "list"]) == 0
    out = capsys.readouterr().out
    assert "laboratory      places: bench, door\n" in out
    assert "polaroid-6500   49.412 kHz, to 10.7 m\n" in out


def test_a_scan_without_echoes_says_why(capsys: Capture) -> None:
    assert run(["simulate", "figure2a", "--place", "stand", "--step", "90"]) == 0
    assert "warning: no echo: the nearest wall is 40 m away, and board 'polaroid-6500' reports at most 10.7 m" in (
        capsys.readouterr().err
    )


def test_the_end_of_headings_may_be_just_behind_the_start(capsys: Capture) -> None:
    assert run(["simulate", "simple", "--place", "figure9", "--model", "nearest", "--to", "1e-9"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 2


@pytest.mark.parametrize(
    ("room", "height", "message"),
    [
        ("doorstep", float("nan"), "height: expected a finite number (m), got nan"),
        ("doorstep", -1.0, "height -1: expected metres between "),
        ("doorstep", 1e9, "height 1e+09: expected metres between "),
        ("simple", 0.5, "height 0.5: has no effect: room 'Simple room' has no floor or ceiling"),
    ],
)
def test_a_height_that_cannot_be_is_refused(room: str, height: float, message: str, capsys: Capture) -> None:
    place = next(iter(load_room(room).places))
    assert run(["simulate", room, "--place", place, "--step", "90", "--out", "s.mcap"]) == 0
    capsys.readouterr()
    assert run(["locate", "s.mcap", "--height", str(height)]) == 2
    assert capsys.readouterr().err.startswith(f"sonarhw: {message}")


def test_a_range_beyond_the_board_is_answered_and_one_beyond_reason_refused(capsys: Capture) -> None:
    scan = ["scan", "fake:simple?place=figure9&pace=max", "--out", "s.mcap", "--step", "90", "--max-range"]
    assert run([*scan, "800"]) == 0
    assert "--max-range 800: board 'polaroid-6500' detects echoes to 10.7 m; each ping now" in capsys.readouterr().err
    for wrong in ("1e308", "nan", "0", "-1"):
        assert run([*scan, wrong, "--force"]) == 2
        assert "expected metres above 0, at most 1000" in capsys.readouterr().err
