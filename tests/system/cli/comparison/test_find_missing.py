"""`sonarhw compare --find-missing`: a plate that the room file does not contain is found, and written as a room."""

import json
from pathlib import Path

import pytest
from sonarhw_cli.app import run
from sonarhw_sim.room.room import load_room

from tests.fixtures.rooms_for_tests import write_yard


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(write_yard(tmp_path_factory.mktemp("yard")))


def test_the_changed_room_contains_the_plate(log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, plot = tmp_path / "found.toml", tmp_path / "found.svg"
    capsys.readouterr()
    room = str(Path(log).with_name("yard.toml"))
    assert (
        run(["compare", log, "--room", room, "--find-missing", "--json", "--out", str(out), "--plot", str(plot)]) == 0
    )
    figures = json.loads(capsys.readouterr().out)
    found = load_room(out)
    # the point straight ahead is on the first wall; one place shows little of the length, so another one can follow
    assert found.names[4] == "wall 1"
    assert found.walls[4:, [0, 2]] == pytest.approx(0.8, abs=0.02)
    low, high = sorted(found.walls[4, [1, 3]])
    assert low < 1.1 < high
    assert 0.75 < found.walls[4:, [1, 3]].min() < found.walls[4:, [1, 3]].max() < 1.45
    assert figures["causes"][0]["kind"] == "NewWall"
    assert "<!-- found wall or post -->" in plot.read_text()
    assert figures["after"]["within_5cm"] > figures["within_5cm"]


def test_an_unchanged_room_is_not_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "found.toml"
    simulated = tmp_path / "simulated.mcap"
    assert run(["simulate", "simple", "--place", "figure9", "--step", "30", "--out", str(simulated)]) == 0
    capsys.readouterr()
    assert run(["compare", str(simulated), "--find-missing", "--out", str(out)]) == 0
    printed = capsys.readouterr()
    assert printed.out.startswith("no change of the room explains misfits\n")
    assert printed.err.endswith(f"{out}: not written, because the room is unchanged\n")
    assert not out.exists()


def test_out_needs_find_missing(log: str, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert run(["compare", log, "--out", "found.toml"]) == 2
    assert capsys.readouterr().err.startswith("sonarhw: --out: needs --find-missing")
