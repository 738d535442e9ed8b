"""A working folder with files named like our modules, each of which raises at import, and a user's work in it."""

import json
import os
import subprocess
from collections.abc import Sequence
from pathlib import Path

from tests.checkout import CHECKOUT

RAISE = 'raise RuntimeError(f"imported {__file__}, a file of the user")\n'
FILES = (
    *("sim.py", "gui.py", "cli.py", "compare.py", "tests.py", "rooms.py", "readings.py", "errors.py", "wire.py"),
    *("sim/__init__.py", "gui/__init__.py", "rooms/__init__.py", "benchmarks/__init__.py", "setup.py"),
)
USE_THE_API = """
import importlib, pkgutil, sys
import numpy as np
from sonarhw import Reading, Scanner, ScanOrder, sector
from sonarhw.errors import MissingExtra
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import load_room
import sonarhw_cli, sonarhw_compare, sonarhw_gui, sonarhw_rooms, sonarhw_sim

room = load_room("room.toml")
assert len(predict_scan(room, room.place("figure6"), load_board("paper"), np.array([0.0, 1.0])).ranges) == 2
for package in (sys.modules[name] for name in [*sys.modules] if name.startswith("sonarhw") and "." not in name):
    for module in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        if module.name.endswith("__main__"):
            continue
        try:
            importlib.import_module(module.name)
        except MissingExtra as error:
            assert "pip install '.[study]'" in str(error), error
"""
# all of them in one process, which saves the start of twenty
RUN_COMMANDS = """
import json, sys
from typer.main import get_command
from sonarhw_cli.app import app, run

def helps(command, *names):
    yield [*names, "--help"]
    for name, part in getattr(command, "commands", {}).items():
        yield from helps(part, *names, name)

for arguments in (*helps(get_command(app)), *json.loads(sys.argv[1])):
    assert run(arguments) == 0, arguments
"""
COMMANDS = (
    "--version",
    "ports",
    "simulate room.toml --place figure6 --step 90 --out simulated.csv",
    "paths room.toml --place figure6 --out paths.csv",
    "import simulated.csv --out imported.mcap --heading heading_deg --range range_m",
    "log info scanned.mcap",
    "log export scanned.mcap --out scan.csv",
    "log recover scanned.mcap --out again.mcap",
    "compare scanned.mcap --room room.toml --place figure6 --json --plot overlay.png",
    "compare imported.mcap --room room.toml --place figure6",
    "fit imported.mcap --room room.toml --place figure6 --free heading --samples 0 --json",
    "report scanned.mcap --room room.toml --place figure6 --out report.html",
)


def fill(folder: Path) -> None:
    """Write the hostile files, and a room file to work with."""
    for name in FILES:
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(RAISE)
    (folder / "room.toml").write_text((CHECKOUT / "rooms" / "kuc_siegel.toml").read_text(encoding="utf-8"))


def use_api(python: Sequence[str], folder: Path) -> None:
    """Use the Python API in `folder`, which is also the first place where Python searches modules."""
    (folder / "script.py").write_text(USE_THE_API)
    _run([*python, "script.py"], folder, "")


def assert_commands_run(python: Sequence[str], sonarhw: Sequence[str], folder: Path, search: str = "") -> None:
    """Assert that the commands run in `folder`, which is also the first place where Python searches modules."""
    fake = [*sonarhw, "fake", "room.toml", "--place", "figure6", "--tcp", "127.0.0.1:0", "--pace", "max"]
    with subprocess.Popen(
        fake, cwd=folder, env=_environment(folder, search), stdout=subprocess.PIPE, text=True
    ) as scanner:
        try:
            url = scanner.stdout.readline().strip()
            commands = [f"info {url}", f"scan {url} --out scanned.mcap --step 30", *COMMANDS]
            all_of_them = json.dumps([command.split() for command in commands])
            printed = _run([*python, "-c", RUN_COMMANDS, all_of_them], folder, search)
        finally:
            scanner.terminate()
    assert printed.count("Usage: sonarhw") > 20


def _run(arguments: Sequence[str], folder: Path, search: str) -> str:
    environment = _environment(folder, search)
    done = subprocess.run(arguments, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, (arguments, done.stderr)
    return done.stdout


def _environment(folder: Path, search: str) -> dict[str, str]:
    own = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return own | {"PYTHONPATH": os.pathsep.join(part for part in (str(folder), search) if part)}
