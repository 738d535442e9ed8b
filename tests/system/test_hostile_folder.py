"""A user's own `sim.py`, `gui/` or `rooms/` in the working folder does not break a command.

`test_package.py` uses the Python API in such a folder.
"""

import os
import subprocess
import sys
from pathlib import Path

from tests.system import hostile

SEARCH = os.environ.get("PYTHONPATH", "")  # path of a checkout that is not installed


def test_files_named_like_our_modules_in_the_working_folder_break_nothing(tmp_path: Path) -> None:
    hostile.fill(tmp_path)
    command = (sys.executable, "-c", "from sonarhw_cli.entry import main; main()")
    hostile.assert_commands_run([sys.executable], command, tmp_path, SEARCH)


def test_python_imports_those_files_by_their_names(tmp_path: Path) -> None:
    hostile.fill(tmp_path)
    done = subprocess.run([sys.executable, "-c", "import compare"], cwd=tmp_path, capture_output=True, check=False)
    assert b"a file of the user" in done.stderr
