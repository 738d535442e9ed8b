"""README and tutorial: examples print what the pages show, pictures exist, all commands are listed."""

import re
import shlex
import shutil
from pathlib import Path

import pytest
import typer
from sonarhw_cli.app import app, run
from sonarhw_sim.board.profile import parse_board

README = Path("README.md").read_text()


TUTORIAL = Path("docs/tutorial.md").read_text()
PRINTING = re.compile(r"```\n\$ sonarhw ((?:simulate|paths) .*?)\n(.*?)```", flags=re.DOTALL)
BLOCKS = PRINTING.findall(README)
EXAMPLES = [(command, printed) for command, printed in BLOCKS if "--out" not in command]


def test_examples_are_figure_9_and_the_step() -> None:
    assert [shlex.split(command)[1] for command, _ in EXAMPLES] == ["rooms/simple.toml", "rooms/doorstep.toml"]


@pytest.mark.parametrize(("command", "printed"), EXAMPLES + PRINTING.findall(TUTORIAL))
def test_example_prints_what_the_page_shows(command: str, printed: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(shlex.split(command)) == 0
    assert capsys.readouterr().out == printed


def test_compare_prints_the_sentence_that_the_readme_shows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    simulate, compare, answer = re.findall(
        r"\$ sonarhw (simulate .*)\n\$ sonarhw (compare .*) \| grep 270\.0°\n(.*)\n", README
    )[0]
    shutil.copytree("rooms", tmp_path / "rooms")
    monkeypatch.chdir(tmp_path)
    assert run(shlex.split(simulate)) == 0
    assert run(shlex.split(compare)) == 0
    assert [line for line in capsys.readouterr().out.splitlines() if "270.0°" in line] == [answer]


def test_import_and_locate_work_as_in_the_readme(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    commands = re.findall(r"\$ sonarhw (import .*)\n\$ sonarhw (locate .*)\n", README)[0]
    assert run(["simulate", "rooms/arena.toml", "--place", "p3", "--board", "lego-nxt", "--step", "6"]) == 0
    rows = [line.split(",") for line in capsys.readouterr().out.splitlines()[1:]]
    lines = [f"{-float(heading):g},{float(distance) * 100 if distance else 255:g}" for heading, distance, *_ in rows]
    shutil.copytree("rooms", tmp_path / "rooms")
    monkeypatch.chdir(tmp_path)
    Path("turret.csv").write_text("\n".join(["turret_deg,range_cm", *lines]) + "\n")
    assert [run(shlex.split(command)) for command in commands] == [0, 0]
    last = capsys.readouterr()
    assert last.err == ""
    assert last.out.splitlines()[-1].startswith("assuming one of the room's places: p3 ")


def test_pictures_exist() -> None:
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", README)
    assert len(pictures) == 3
    assert all(Path(picture).is_file() for picture in pictures)


def test_every_command_is_listed_and_has_help() -> None:
    known = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    commands = {name: command for name, command in known.items() if not command.hidden}
    assert [name for name in commands if f"`sonarhw {name}`" not in README] == []
    assert [name for name, command in commands.items() if not command.help] == []


def test_the_board_profile_in_the_readme_is_valid() -> None:
    profile = next(block for block in re.findall(r"```toml\n(.*?)```", README, flags=re.DOTALL) if "my board" in block)
    board = parse_board(profile, "README.md")
    assert (board.name, len(board.gain_steps), len(board.chirp)) == ("my board", 3, 2)
