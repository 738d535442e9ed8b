"""The command line before it runs a command, and a prediction, load no slow packages that they do not need."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    ("modules", "heavy"),
    [
        (
            "sonarhw_sim, sonarhw_sim.choices, sonarhw_compare, sonarhw_compare.fit, sonarhw_compare.study",
            "numpy numba",
        ),
        ("sonarhw", "numpy serial lazy_loader sonarhw_sim sonarhw_compare typer"),
        ("sonarhw_compare.fit.values.quantities", "numpy numba scipy emcee"),
        ("sonarhw_sim.predict.models", "scipy.special scipy.spatial scipy.optimize matplotlib"),
        ("sonarhw_cli.app", "numpy numba scipy matplotlib PySide6"),
    ],
)
def test_early_imports_load_no_slow_package(modules: str, heavy: str) -> None:
    program = f"import sys, {modules}; print(sys.modules.keys() & {set(heavy.split())})"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
