"""Exit statuses, -h, --quiet and --verbose."""

import re
import signal
from pathlib import Path

import pytest
import typer
from sonarhw_cli.app import app, run

from sonarhw.errors import ExitStatus
from tests.checkout import CHECKOUT
from tests.structure import help_texts
from tests.system.cli.instrument.test_scan_command import ENDLESS, end, lines, sonarhw, started

ROOM = CHECKOUT / "rooms" / "simple.toml"
FAKE = f"fake:{ROOM}?place=figure9&pace=max"
SLOW_FAKE = f"fake:{ROOM}?place=figure9"
ELSEWHERE = ["scan", FAKE, "--step", "90", "--room", str(ROOM), "--place", "50,50", "--out"]  # gives a warning


@pytest.mark.parametrize(
    ("status", "command"),
    [
        (ExitStatus.DONE, ["simulate", str(ROOM), "--place", "figure9", "--step", "90"]),
        (ExitStatus.DONE, ["--version"]),
        (ExitStatus.FAILED, ["info", "no-such-port"]),
        (ExitStatus.BAD_INPUT, ["simulate", "no-such-room.toml"]),
        (ExitStatus.BAD_INPUT, ["simulate", str(ROOM), "--no-such-option"]),
    ],
)
def test_exit_status_of_a_command_that_ends_by_itself(status: ExitStatus, command: list[str]) -> None:
    assert sonarhw(*command).returncode == status


def test_exit_status_of_an_interrupted_command(tmp_path: Path) -> None:
    with started("scan", SLOW_FAKE, "--out", tmp_path / "scan.mcap", "--print", *ENDLESS) as process:
        lines(process, 3)
        process.send_signal(signal.SIGINT)
        status, _ = end(process)
    assert status == ExitStatus.INTERRUPTED


def test_h_is_the_help_of_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    words = [[name] for name in commands] + [["log", name] for name in commands["log"].commands] + [[]]
    for command in words:
        assert run([*command, "-h"]) == 0
        short = capsys.readouterr().out
        assert run([*command, "--help"]) == 0
        assert short == capsys.readouterr().out
        assert short.startswith("Usage: ")


def test_a_list_of_commands_shows_whole_sentences_on_a_narrow_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "50")
    for command in ([], ["log"], ["room"], ["profile"]):
        assert run([*command, "--help"]) == 0
        printed = capsys.readouterr().out
        assert "..." not in printed.partition("\nOptions:\n")[2]


def test_commands_stand_under_headings_of_at_most_eight_and_sonarhw_alone_shows_first_steps(
    capsys: pytest.CaptureFixture[str],
) -> None:
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


def test_quiet_leaves_only_results_and_errors(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run([*ELSEWHERE, str(tmp_path / "loud.mcap")]) == 0
    loud = capsys.readouterr().err.splitlines()
    assert len(loud) == 2
    assert "warning" in loud[0]
    assert run(["--quiet", *ELSEWHERE, str(tmp_path / "quiet.mcap"), "--print"]) == 0
    quiet = capsys.readouterr()
    assert (len(quiet.out.splitlines()), quiet.err) == (5, "")
    assert run(["-q", "info", "no-such-port"]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_verbose_prints_what_is_used_and_the_class_of_an_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = str(tmp_path / "scan.mcap")
    in_room = ["--room", str(ROOM), "--place", "figure9"]
    assert run(["--verbose", "scan", FAKE, *in_room, "--step", "90", "--out", log]) == 0
    printed = capsys.readouterr().err
    assert f"sonarhw: {FAKE}: room 'Simple room', place 'figure9', board 'polaroid-6500'\n" in printed
    assert "scanner FAKE-0000" in printed
    assert "speed of sound 34" in printed
    assert run(["--verbose", "log", "info", log]) == 0
    assert capsys.readouterr().err == f"sonarhw: {log}: 4 fake readings\n"
    assert run(["--verbose", "info", "no-such-port"]) == 1
    assert "this is LinkError, exit status 1; see docs/reference/errors.md" in capsys.readouterr().err
    assert run(["info", "no-such-port"]) == 1
    assert "LinkError" not in capsys.readouterr().err
