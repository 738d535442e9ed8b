"""Commands and `fake:` URLs accept the names of shipped rooms in any working directory."""

from pathlib import Path

import pytest
from sonarhw_cli.app import run

from sonarhw.log import read_log
from tests.checkout import CHECKOUT

LABORATORY = (CHECKOUT / "rooms/laboratory.toml").read_text()


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_shipped_room_is_simulated_from_any_folder(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["simulate", "simple", "--place", "figure9", "--board", "paper", "--from", "270", "--to", "271"]) == 0
    assert capsys.readouterr().out.splitlines()[1].startswith("270,0.827,")
    assert run(["paths", "simple", "--place", "figure9", "--max-bounces", "0", "--no-diffraction"]) == 0


def test_a_scan_of_a_fake_in_a_shipped_room_is_compared_and_located(capsys: pytest.CaptureFixture[str]) -> None:
    url = "fake:laboratory?place=bench&seed=1&pace=max"
    assert run(["scan", url, "--out", "s.mcap", "--room", "laboratory", "--place", "bench", "--step", "30"]) == 0
    metadata = read_log(Path("s.mcap")).metadata
    assert (metadata.room_file, metadata.room_text) == ("laboratory.toml", LABORATORY)
    assert run(["compare", "s.mcap", "--room", "laboratory", "--place", "bench"]) == 0
    assert run(["report", "s.mcap", "--room", "laboratory", "--out", "s.html"]) == 0
    assert run(["map", "s.mcap", "--room", "laboratory"]) == 0


@pytest.mark.parametrize(
    "command",
    [
        ["simulate", "labratory"],
        ["paths", "labratory"],
        ["fake", "labratory"],
        ["info", "fake:labratory?place=bench"],
        ["scan", "fake:simple?place=figure9", "--room", "labratory", "--out", "s.mcap"],
        ["gui", "--room", "labratory"],
    ],
    ids=" ".join,
)
def test_a_misspelt_room_gets_a_suggestion(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(command) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "unknown room 'labratory'; did you mean 'laboratory'? known: arena" in line


def test_a_study_names_shipped_rooms_and_its_own_files(tmp_path: Path) -> None:
    (tmp_path / "studies").mkdir()
    (tmp_path / "studies/own.toml").write_text(LABORATORY.replace('"Laboratory"', '"Own"'))
    spec = tmp_path / "studies/spec.toml"
    spec.write_text('name = "s"\n[[rooms]]\nfile = "simple"\n[[rooms]]\nfile = "own.toml"\n[headings]\nstep = 90.0\n')
    from sonarhw_compare.study import load_study

    assert [room.name for room in load_study(spec).rooms] == ["Simple room", "Own"]
