"""The wheel works in another folder, also beside files named like its packages, and finds all of its files.

With `--soak` it is installed in a clean environment with every dependency, which takes minutes; `make setup` installs
the same dependencies. A normal run adds the packages of this environment to an empty one.
"""

import json
import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path
from zipfile import ZipFile

import pytest
from sonarhw_sim.compiler import kernel_folders

from tests.checkout import CHECKOUT
from tests.system import hostile


@pytest.mark.timeout(1800)  # with --soak it downloads and installs every dependency
def test_wheel_runs_the_demo(tmp_path: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    wheel, clean = built_wheel(tmp_path), tmp_path / "clean"
    soak = request.config.getoption("--soak")
    python = install_with_dependencies(wheel, clean) if soak else install(wheel, clean)
    if not soak:
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(kernel_folders()[0]))  # the code of the kernels is the same
    assert (clean / "share" / "man" / "man1" / "sonarhw.1").exists()
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    hostile.fill(elsewhere)
    command = [python.with_name("sonarhw"), "demo", "--headless", "result"]
    subprocess.run(command, check=True, cwd=elsewhere, env=without_python_settings(), capture_output=True)
    summary = json.loads((elsewhere / "result" / "summary.json").read_text())
    assert summary["within_5cm"] > 0.8
    assert (elsewhere / "result" / "overlay.png").exists()
    assert (elsewhere / "result" / "scan.mcap").exists()
    hostile.use_api([str(python)], elsewhere)
    if soak:
        hostile.assert_commands_run([str(python)], [str(python.with_name("sonarhw"))], elsewhere)


def built_wheel(folder: Path) -> Path:
    """Build the wheel; all of its files are in packages whose names begin with `sonarhw`."""
    build = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(CHECKOUT)]
    subprocess.run(build, check=True, capture_output=True)
    wheel = next(folder.glob("*.whl"))
    names = ZipFile(wheel).namelist()
    assert {name[: len("sonarhw")] for name in names} == {"sonarhw"}
    assert "sonarhw/images/uno-hc-sr04-servo.hex" in names  # sonarhw flash
    return wheel


def install(wheel: Path, clean: Path) -> Path:
    """Install the wheel in a new environment that imports its dependencies from this one; return its Python."""
    venv.create(clean)
    python = clean / "bin" / "python"
    packages = clean / "lib" / f"python{sysconfig.get_python_version()}" / "site-packages"
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib"))
    pip = [sys.executable, "-m", "pip", "--python", str(python)]
    environment = without_python_settings()
    subprocess.run([*pip, "install", "--quiet", "--no-compile", "--no-deps", wheel], check=True, env=environment)
    subprocess.run([*pip, "check"], check=True, env=environment)
    return python


def install_with_dependencies(wheel: Path, clean: Path) -> Path:
    """Install the wheel and the locked versions of its dependencies in a new environment; return its Python."""
    venv.create(clean, with_pip=True)
    python, environment = clean / "bin" / "python", without_python_settings()
    install = [python, "-m", "pip", "install", "--quiet", "--no-compile", "--no-build-isolation"]
    for names in (["build"], ["base", "gui"]):
        locked = [f"--requirement={CHECKOUT}/requirements/{name}.txt" for name in names]
        subprocess.run([*install, "--no-deps", "--require-hashes", *locked], check=True, env=environment)
    subprocess.run([*install, "--no-deps", wheel], check=True, env=environment)
    subprocess.run([python, "-m", "pip", "check"], check=True, env=environment)
    return python


def without_python_settings() -> dict[str, str]:
    """Return the environment without the variables of Python."""
    return {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
