"""Compiled kernels follow their sources, and an unreadable cache is replaced."""

import importlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

CALLEE = "from sonarhw_sim.compiled import compiled\n\n@compiled\ndef factor() -> float:\n    return {}\n"
CALLER = """from typing import NamedTuple

from kernels_under_test.callee import factor
from sonarhw_sim.compiled import compiled

class {0}(NamedTuple):
    length: float

@compiled
def scaled(value: {0}) -> float:
    return factor() * value.length

def result() -> float:
    return scaled({0}(2.0))
"""
Compute = Callable[[str, str], float]


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    folder = tmp_path / "kernels_under_test"
    folder.mkdir()
    (folder / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    yield folder
    _forget()


@pytest.fixture
def compute(package: Path) -> Compute:
    """Return a function that computes in a newly imported package, with this factor and this class name."""

    def result(factor: str, name: str) -> float:
        (package / "callee.py").write_text(CALLEE.format(factor))
        (package / "caller.py").write_text(CALLER.format(name))
        _forget()
        return float(importlib.import_module("kernels_under_test.caller").result())

    return result


def _forget() -> None:
    for name in [name for name in sys.modules if name.startswith("kernels_under_test")]:
        del sys.modules[name]
    importlib.import_module("sonarhw_sim.compiled")._digest.cache_clear()
    importlib.invalidate_caches()


def test_a_kernel_follows_a_kernel_of_another_file(compute: Compute) -> None:
    assert compute("3.0", "Value") == 6.0
    assert compute("3.25", "Value") == 6.5


def test_a_cache_that_names_a_removed_class_is_replaced(compute: Compute) -> None:
    assert compute("3.0", "Value") == 6.0
    assert compute("3.0", "RenamedValue") == 6.0


def test_an_unreadable_cache_is_replaced(package: Path, compute: Compute) -> None:
    assert compute("3.0", "Value") == 6.0
    indexes = list(package.rglob("scaled*.nbi")) or list(package.rglob("*.nbi"))
    assert indexes
    for index in indexes:
        index.write_bytes(b"torn")
    assert compute("3.0", "Value") == 6.0
    assert all(index.read_bytes() != b"torn" for index in indexes)
