"""Help: -h of every command, its lists of commands, arguments and values."""

import re

import pytest
import typer
from sonarhw_cli.app import app, run

from tests.structure import help_texts


def test_h_is_the_help_of_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    words = [[name] for name in commands] + [["log", name] for name in commands["log"].commands] + [[]]
    for command in words:
        assert run([*command, "-h"]) == 0
        short = capsys.readouterr().out
        assert run([*command, "--help"]) == 0
        assert short == capsys.readouterr().out
        assert short.startswith("Usage: ")


def test_commands_stand_under_headings_of_at_most_eight(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--help"]) == 0
    listed = capsys.readouterr().out.partition("\nScan:\n")[2]
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    headings = re.split(r"\n\n(?:Predict|Compare|Files|Scanner set-up):\n", listed)
    names = [re.findall(r"^  (\w+)  ", heading, re.M) for heading in headings]
    shown = {name for name, command in commands.items() if not command.hidden}
    assert {name for heading in names for name in heading} == shown
    assert [len(heading) <= 8 for heading in names] == [True] * 5
    assert run([]) == 2
    steps = re.findall(r"^  sonarhw (\w+)", capsys.readouterr().err, re.M)
    assert (len(steps), set(steps) <= set(commands)) == (3, True)


def test_the_help_shows_arguments_and_values_as_typed_and_no_python_types() -> None:
    texts = help_texts()
    assert "Usage: sonarhw fit [OPTIONS] LOG...\n" in texts["sonarhw fit"]
    assert "\n  LOG...  Logs (*.mcap), whole or torn.  [required]\n" in texts["sonarhw fit"]
    assert "Usage: sonarhw ports [OPTIONS] [PORT]...\n" in texts["sonarhw ports"]
    assert "\n  --step NUMBER " in texts["sonarhw scan"]
    assert "\n  --invert mark|cam|motor " in texts["sonarhw wiring"]
    assert [name for name, text in texts.items() if re.search(r"<[a-z]|\{(?!(?:deg|cm)\})", text)] == []
