"""Rooms and boards by name, and files that have the same names."""

from pathlib import Path

import pytest
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import load_room, room_names

from sonarhw.errors import InputError
from tests.checkout import CHECKOUT

OWN_ROOM = (CHECKOUT / "rooms/simple.toml").read_text().replace("Simple room", "My own room")
OWN_BOARD = (CHECKOUT / "sim/sonarhw_sim/board/shipped/paper.toml").read_text().replace('"paper"', '"my own"', 1)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with a room and a board of the user that have shipped names."""
    (tmp_path / "laboratory.toml").write_text(OWN_ROOM)
    (tmp_path / "laboratory").write_text(OWN_ROOM)
    (tmp_path / "bare").write_text(OWN_ROOM)
    (tmp_path / "scan.mcap").write_bytes(b"\x89MCAP0\r\n\x01\x00\x00")
    (tmp_path / "picture").write_bytes(b"\x89PNG\r\n\x1a\n\x00\x00")
    (tmp_path / "paper.toml").write_text(OWN_BOARD)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_shipped_room_loads_by_its_name(folder: Path) -> None:
    assert room_names() == sorted(path.stem for path in (CHECKOUT / "rooms").glob("*.toml"))
    for name in room_names():
        assert load_room(name).text == (CHECKOUT / f"rooms/{name}.toml").read_text()


def test_a_name_is_the_shipped_one_whatever_the_working_directory_holds(folder: Path) -> None:
    assert load_room("laboratory").name == "Laboratory"
    assert load_board("paper").name == "paper"


@pytest.mark.parametrize("name", ["laboratory.toml", "./laboratory", "./bare", Path("bare"), Path("laboratory")])
def test_a_suffix_a_slash_or_a_path_names_a_file(folder: Path, name: Path | str) -> None:
    assert load_room(name).name == "My own room"


@pytest.mark.parametrize("name", ["paper.toml", "./paper.toml", Path("paper.toml")])
def test_boards_follow_the_same_rule(folder: Path, name: Path | str) -> None:
    assert load_board(name).name == "my own"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("labratory", "unknown room 'labratory'; did you mean 'laboratory'? known: arena, corridor, "),
        ("Simple", "unknown room 'Simple'; did you mean 'simple'? known: "),
        ("xyzzy", "unknown room 'xyzzy'; known: arena, "),
        ("bare", "unknown room 'bare'; did you mean the file ./bare? known: "),
        ("paper", "unknown room 'paper'; did you mean the file ./paper.toml? known: "),
        ("../simple", "../simple: no such file"),
        ("a" * 100_000, "aaa…; known: arena, "),
    ],
)
def test_an_unknown_name_lists_the_shipped_ones_and_a_near_miss(folder: Path, name: str, message: str) -> None:
    with pytest.raises(InputError) as refusal:
        load_room(name)
    assert message in str(refusal.value)
    assert len(str(refusal.value)) < 400
    assert "laboratory" in str(refusal.value) or "/" in name


@pytest.mark.parametrize(
    ("name", "kind"), [("scan.mcap", "a log"), ("./scan.mcap", "a log"), ("picture", "not a text file")]
)
def test_a_log_or_a_picture_is_not_suggested(folder: Path, name: str, kind: str) -> None:
    with pytest.raises(InputError) as refusal:
        load_room(name)
    file = name.removeprefix("./")
    assert str(refusal.value) == f"{file}: is {kind}; expected a room file, whose name ends in .toml"


def test_an_unknown_board_lists_the_shipped_ones_and_a_near_miss() -> None:
    with pytest.raises(InputError, match=r"'poloroid-6500'; did you mean 'polaroid-6500'\? known: hc-sr04"):
        load_board("poloroid-6500")
