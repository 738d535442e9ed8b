"""`python -m sonarhw` is the command."""

import subprocess
import sys

import sonarhw


def test_python_m_sonarhw_runs_the_command() -> None:
    done = subprocess.run([sys.executable, "-m", "sonarhw", "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"sonarhw {sonarhw.__version__}\n"


def test_its_exit_status_is_that_of_the_command() -> None:
    done = subprocess.run([sys.executable, "-m", "sonarhw", "no-such-command"], capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("sonarhw: ")
