"""`sonarhw --install-completion`: the installed scripts, the completions, and their speed."""

import os
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from sonarhw_cli.app import run

from tests.fixtures.commands import COMMAND


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty home folder, with the command on the PATH."""
    script = tmp_path / "bin" / "sonarhw"
    script.parent.mkdir()
    script.write_text(f'#!/bin/sh\nexec {shlex.join(COMMAND)} "$@"\n')
    script.chmod(0o755)
    monkeypatch.setenv("PATH", str(script.parent), prepend=os.pathsep)
    monkeypatch.setenv("HOME", str(tmp_path))
    return tmp_path


def output(arguments: list[str], **environment: str) -> str:
    """Return the standard output of a command."""
    done = subprocess.run(arguments, env=os.environ | environment, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_bash_completes_commands_options_and_choices_after_installation(home: Path) -> None:
    assert "bash completion installed" in output(["bash", "-c", "sonarhw --install-completion; true"])
    ask = 'source ~/.bashrc; COMP_WORDS=($1); COMP_CWORD=$2; _sonarhw_completion sonarhw; echo "${COMPREPLY[@]}"'
    for words, index, wanted in [
        ("sonarhw simulate --receiver b", 3, "board"),
        ("sonarhw simulate nowhere --place ", 4, ""),
    ]:
        assert output(["bash", "-c", ask, "bash", words, str(index)]).strip() == wanted


@pytest.mark.parametrize(
    ("words", "index", "wanted"),
    [
        ("sonarhw simu", 1, "simulate"),
        ("sonarhw log ", 2, "info export recover"),
        ("sonarhw simulate --rece", 2, "--receiver"),
        ("sonarhw simulate --receiver b", 3, "board"),
        ("sonarhw simulate lab", 2, "laboratory"),
        ("sonarhw simulate laboratory --place ", 4, "bench door"),
        ("sonarhw simulate laboratory --board pap", 4, "paper paper-b12"),
        ("sonarhw simulate nowhere --place ", 4, ""),
    ],
)
def test_commands_options_and_choices_are_completed(
    words: str, index: int, wanted: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    # as the script for bash calls the command
    for name, value in (("_SONARHW_COMPLETE", "complete_bash"), ("COMP_WORDS", words), ("COMP_CWORD", str(index))):
        monkeypatch.setenv(name, value)
    with pytest.raises(SystemExit) as end:
        run([])
    assert not end.value.code
    assert capsys.readouterr().out.split() == wanted.split()


@pytest.mark.parametrize(
    ("shell", "installed", "wanted"),
    [("zsh", ".zfunc/_sonarhw", '"simulate":'), ("fish", ".config/fish/completions/sonarhw.fish", "simulate\t")],
)
def test_other_shells_get_a_script_and_completions(home: Path, shell: str, installed: str, wanted: str) -> None:
    printed = output(["sonarhw", "--install-completion", shell], _TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION="1")
    assert f"{shell} completion installed in {home / installed}" in printed
    assert f"_SONARHW_COMPLETE=complete_{shell}" in (home / installed).read_text()
    completion = {"_SONARHW_COMPLETE": f"complete_{shell}", "_TYPER_COMPLETE_ARGS": "sonarhw simu"}
    assert wanted in output(["sonarhw"], _TYPER_COMPLETE_FISH_ACTION="get-args", **completion)
