"""The wheel works in a clean environment and in another folder, also beside files named like its packages."""

import json
import os
import subprocess
import sys
import venv
from pathlib import Path
from zipfile import ZipFile

import pytest

from tests.checkout import CHECKOUT
from tests.system import hostile


@pytest.mark.timeout(1800)  # it downloads and installs every dependency
def test_wheel_runs_the_demo_from_another_folder(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "build", "--outdir", str(tmp_path), str(CHECKOUT)]
    subprocess.run(build, check=True, capture_output=True)
    wheel = next(tmp_path.glob("*.whl"))
    assert {name[: len("sonarhw")] for name in ZipFile(wheel).namelist()} == {"sonarhw"}
    venv.create(tmp_path / "clean", with_pip=True)
    python = tmp_path / "clean" / "bin" / "python"
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    options = ["--quiet", "--no-compile", "--constraint", str(CHECKOUT / "constraints.txt")]
    subprocess.run([python, "-m", "pip", "install", *options, str(wheel)], check=True, env=environment)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    command = [python.with_name("sonarhw"), "demo", "--headless", "result"]
    subprocess.run(command, check=True, cwd=elsewhere, env=environment, capture_output=True)
    summary = json.loads((elsewhere / "result" / "summary.json").read_text())
    assert summary["within_5cm"] > 0.8
    assert (elsewhere / "result" / "overlay.png").exists()
    assert (elsewhere / "result" / "scan.mcap").exists()
    hostile.fill(elsewhere)
    hostile.use_everything([str(python)], [str(python.with_name("sonarhw"))], elsewhere)
