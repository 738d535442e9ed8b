"""The command line before it runs a command, and a prediction, load no slow packages that they do not need."""

import subprocess
import sys

import pytest


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
    program = (
        "import sys; from sonarhw_cli.app import run; assert run(['simulate', 'laboratory', '--place', 'bench']) == 0; "
        "print('scipy.linalg' in sys.modules)"
    )
    command = [sys.executable, "-c", program]
    subprocess.run(command, capture_output=True, check=True)  # compiling missing kernels loads scipy.linalg
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "False"
