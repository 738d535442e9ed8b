"""Fuzzed inputs of every command: no traceback, one line for an error, no harmed or partial file, no waste.

A normal run uses 20 inputs, with `--soak` 5000. Each has at most 10 s of processor time (180 s for a search) and
1 GB. `python -m tests.soak.fuzz NUMBER 1` repeats an input.
"""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.checkout import CHECKOUT
from tests.conftest import Count
from tests.soak.fuzz import forked_run
from tests.soak.fuzz.command_lines import Case


@pytest.mark.timeout(20_000)
@pytest.mark.skipif(sys.platform != "linux", reason="uses fork and limits of Linux")
def test_no_input_gives_a_traceback_or_harms_a_file(count: Count) -> None:
    command = [sys.executable, "-m", "tests.soak.fuzz", "0", str(count(10, 5000))]
    done = subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def crash() -> int:
    raise ValueError("a fault")


def harm() -> int:
    Path("room.toml").write_text("changed")
    return 0


def leave() -> int:
    Path("out.csv").write_text("half")
    sys.stderr.write("sonarhw: failed\n")
    return 1


def leave_hidden() -> int:
    Path(".sonarhw-1.part").write_text("half")
    return 0


def escape() -> int:
    sys.stdout.write("\x1b[2J")
    return 0


def fail_silently() -> int:
    return 2


def fail_in_two_lines() -> int:
    sys.stderr.write("sonarhw: one\ntwo\n")
    return 2


def allocate() -> int:
    bytearray(3 << 30)
    return 0


def print_nan() -> int:
    sys.stdout.write('{"error": NaN}')
    return 0


@pytest.mark.parametrize(
    ("command", "found"),
    [
        (crash, "exit status 70; prints 'Traceback'"),
        (harm, "harms room.toml"),
        (leave, "leaves out.csv though it failed"),
        (leave_hidden, "leaves .sonarhw-1.part"),
        (escape, r"prints raw ['\x1b']"),
        (fail_silently, "does not print one line about the error"),
        (fail_in_two_lines, "does not print one line about the error"),
        (allocate, "exit status 70; prints 'Traceback'"),
        (print_nan, "prints invalid JSON"),
        (lambda: 3, "exit status 3"),
        (lambda: 0, ""),
    ],
)
def test_each_kind_of_fault_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Callable[[], int], found: str
) -> None:
    monkeypatch.setattr(forked_run, "run", lambda _: command())
    case = Case(["compare", *(["--json"] if command is print_nan else [])], {"room.toml": b"whole"}, ["out.csv"])
    faults, _ = forked_run.faults_of(case, tmp_path)
    assert "; ".join(faults) == found
