"""README: pictures exist, all commands are listed, the board profile is valid. `docs/test_page_blocks.py` runs it."""

import re
from pathlib import Path

import typer
from sonarhw_cli.app import app
from sonarhw_sim.board.profile import parse_board

README = Path("README.md").read_text()


def test_the_example_board_is_the_profile_on_the_page() -> None:
    (profile,) = re.findall(r"```toml\n(name = \"my board\".*?)```", README, flags=re.DOTALL)
    assert Path("examples/my_board.toml").read_text() == profile


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
