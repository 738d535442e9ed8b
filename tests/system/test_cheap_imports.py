"""Modules that the command line imports before it runs a command do not load slow packages."""

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
        ("sonarhw_compare.fit.values.quantities", "numba scipy emcee"),
        ("sonarhw_cli.app", "numba scipy matplotlib PySide6"),
    ],
)
def test_early_imports_load_no_slow_package(modules: str, heavy: str) -> None:
    program = f"import sys, {modules}; print(sys.modules.keys() & {set(heavy.split())})"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
