"""The wheel works in another folder, also beside files named like its packages, and finds all of its files.

With `--soak` it is installed in a clean environment with every dependency, and runs the demo, which takes minutes;
`make setup` installs the same dependencies. A normal run adds the packages of this environment to an empty one, and
predicts; `test_demo_command.py` runs the demo.
"""

import json
import os
import subprocess
import sys
import sysconfig
import tomllib
import venv
from collections.abc import Callable
from importlib.metadata import distribution, packages_distributions
from pathlib import Path
from zipfile import ZipFile

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from sonarhw_cli.app import run
from sonarhw_sim.compiler import kernel_folders

from tests.checkout import CHECKOUT
from tests.system import hostile


@pytest.mark.timeout(1800)  # with --soak it downloads and installs every dependency
def test_wheel_runs_elsewhere(tmp_path: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    wheel, clean = built_wheel(tmp_path), tmp_path / "clean"
    soak = request.config.getoption("--soak")
    python = install_with_dependencies(wheel, clean) if soak else install(wheel, clean)
    if not soak:
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(kernel_folders()[0]))  # the code of the kernels is the same
    assert (clean / "share" / "man" / "man1" / "sonarhw.1").exists()
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    hostile.fill(elsewhere)
    prediction = "simulate laboratory --place bench --step 30 --out result.png"
    command = [python.with_name("sonarhw"), *("demo --headless result" if soak else prediction).split()]
    subprocess.run(command, check=True, cwd=elsewhere, env=without_python_settings(), capture_output=True)
    if soak:
        assert json.loads((elsewhere / "result" / "summary.json").read_text())["within_5cm"] > 0.8
    assert [*elsewhere.rglob("*.png")]
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


# a base installation, without the extras `gui` and `study`, runs every command but the window and studies


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


# the command line before it runs a command, and a prediction, load no slow packages that they do not need


@pytest.mark.parametrize(
    ("modules", "heavy"),
    [
        ("sonarhw_sim, sonarhw_sim.air, sonarhw_compare, sonarhw_compare.fit", "numpy numba"),
        ("sonarhw", "numpy serial lazy_loader sonarhw_sim sonarhw_compare typer"),
        ("sonarhw_compare.fit.quantities", "numpy numba scipy emcee"),
        ("sonarhw_sim.predict.prediction", "numba scipy.special scipy.spatial scipy.optimize matplotlib"),
        ("sonarhw_sim.files", "numpy"),  # names the shipped rooms and boards in completions and errors
        ("sonarhw_cli.app", "numpy numba scipy matplotlib PySide6 sonarhw.wire.messages sonarhw_cli.hints"),
    ],
)
def test_early_imports_load_no_slow_package(modules: str, heavy: str) -> None:
    program = f"import sys, {modules}; print(sys.modules.keys() & {set(heavy.split())})"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_a_prediction_with_compiled_kernels_loads_no_linear_algebra() -> None:
    arguments = ["simulate", "laboratory", "--place", "bench", "--step", "30"]
    assert run(arguments) == 0  # compiling missing kernels loads scipy.linalg
    program = f"import sys; from sonarhw_cli.app import run; run({arguments}); print('scipy.linalg' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.count("\n") > 12
    assert done.stdout.splitlines()[-1] == "False"
