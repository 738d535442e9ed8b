"""A base installation, without the extras `gui` and `study`, runs every command but the window and studies."""

import json
import os
import subprocess
import sys
import tomllib
from collections.abc import Callable
from importlib.metadata import distribution, packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tests.checkout import CHECKOUT

ROOM = CHECKOUT / "rooms" / "kuc_siegel.toml"
# Each import of a package that a base installation lacks fails as if the package were not installed.
WITHOUT = "import sys; sys.modules |= dict.fromkeys({packages!r}); "
MAIN = "from sonarhw_cli.entry import main; main()"
EACH = """
import json
from sonarhw_cli.app import run
for arguments in json.loads(sys.argv[1]):
    assert run(arguments) == 0, arguments
"""
Sonarhw = Callable[..., "subprocess.CompletedProcess[str]"]  # arguments, `status=` expected, environment variables
INSTALL_WINDOW = "run pip install '.[gui]' in the source folder of sonarhw"


def base_distributions() -> set[str]:
    """Return the names of the dependencies of the product, and of theirs."""
    project = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]
    found: set[str] = set()
    waiting = [Requirement(line) for line in project["dependencies"]]
    while waiting:
        requirement = waiting.pop()
        name = canonicalize_name(requirement.name)
        if name in found or not (requirement.marker is None or requirement.marker.evaluate({"extra": ""})):
            continue
        found.add(name)
        waiting += [Requirement(line) for line in distribution(name).requires or ()]
    return found


def packages_to_hide() -> list[str]:
    """Return the importable names of everything installed here that a base installation lacks."""
    kept = base_distributions() | {"sonarhw"}
    hidden = {
        package
        for package, owners in packages_distributions().items()
        if not {canonicalize_name(owner) for owner in owners} & kept
    }
    return sorted(hidden - sys.stdlib_module_names)


@pytest.fixture(scope="module")
def program() -> str:
    hidden = packages_to_hide()
    assert {"PySide6", "pyqtgraph", "pyarrow", "dask", "distributed", "xarray", "pytest"} <= set(hidden)
    return WITHOUT.format(packages=hidden)


@pytest.fixture
def sonarhw(program: str, tmp_path: Path) -> Sonarhw:
    def run(*arguments: str, status: int = 0, **variables: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", program + MAIN, *arguments]
        environment = {**os.environ, **variables}
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == status, (arguments, done.stderr)
        return done

    return run


def test_commands_need_no_extra_and_the_demo_runs_without_the_window(program: str, tmp_path: Path) -> None:
    in_room = ("--room", str(ROOM), "--place", "figure6")
    commands = [
        ["demo"],
        ["scan", f"fake:{ROOM}?place=figure6&seed=1&pace=max", "--out", "scan.mcap", "--step", "15", "--traces"],
        ["simulate", str(ROOM), "--place", "figure6", "--step", "30", "--out", "predicted.png"],
        ["report", "scan.mcap", "--out", "scan.html", *in_room],
        ["fit", "scan.mcap", "--free", "heading", "--samples", "0", *in_room],
        ["compare", "scan.mcap", "--json", "--plot", "overlay.png", *in_room],
    ]
    # in one process, which saves the start of five
    command = [sys.executable, "-c", program + EACH, json.dumps(commands)]
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    without = "The demo runs without a window: the window needs PySide6, which is not installed: "
    assert done.stdout.startswith(f"{without}{INSTALL_WINDOW}")
    assert json.loads(done.stdout[done.stdout.index("\n{") :])["within_5cm"] > 0.5  # of 24 readings
    for written in ("demo-result/overlay.png", "predicted.png", "overlay.png", "scan.html"):
        assert (tmp_path / written).stat().st_size > 1000


def test_window_names_the_extra_to_install(sonarhw: Sonarhw) -> None:
    error = sonarhw("gui", str(ROOM), status=1, QT_QPA_PLATFORM="offscreen").stderr
    assert error == f"sonarhw: the window needs PySide6, which is not installed: {INSTALL_WINDOW}\n"
