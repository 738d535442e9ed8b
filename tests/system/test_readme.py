"""README: pictures exist, the example board is valid. `docs/test_page_blocks.py` runs it."""

import re
from pathlib import Path

import typer
from sonarhw_cli.app import app
from sonarhw_sim.board.profile import load_board

README = Path("README.md").read_text()


def test_pictures_exist() -> None:
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", README)
    assert len(pictures) == 2
    assert all(Path(picture).is_file() for picture in pictures)


def test_every_command_is_listed_and_has_help() -> None:
    known = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    commands = {name: command for name, command in known.items() if not command.hidden}
    page = Path("docs/reference/command_line.md").read_text()
    assert [name for name in commands if f"`sonarhw {name}`" not in page] == []
    assert [name for name, command in commands.items() if not command.help] == []


def test_single_sensors_are_examples_of_the_population() -> None:
    population = load_board("lego-nxt")
    assert population.threshold_sd_db > 0
    assert population.range_sd > 0
    files = sorted(Path("examples").glob("lego_nxt_*.toml"))
    sensors = [load_board(file) for file in files]
    assert [sensor.name for sensor in sensors] == [f"lego-nxt-{name}" for name in "abgikm"]
    deviations = [abs(sensor.threshold_db - population.threshold_db) for sensor in sensors]
    assert 0 < max(deviations) <= 1.96 * population.threshold_sd_db
    assert len({sensor.range_offset for sensor in sensors}) == 6


def test_the_example_board_is_valid() -> None:
    board = load_board("examples/my_board.toml")
    assert (board.name, len(board.gain_steps), len(board.chirp)) == ("my board", 3, 2)
