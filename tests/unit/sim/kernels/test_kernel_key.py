"""The key of compiled code covers everything that the code depends on."""

import importlib
import pkgutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import sonarhw_compare
import sonarhw_sim
from numba import float64, int64
from numba.core.types import NamedTuple
from sonarhw_sim import compiler as kernel_key
from sonarhw_sim.compiled import compiled
from sonarhw_sim.compiler import digest_of, key_of, slot_of

CPU = ("x86_64", "some", "+avx")
CONSTANTS = "from typing import NamedTuple\n\nLENGTH = {constant}\n\n\nclass Point(NamedTuple):\n    {fields}\n"
CALLEE = """
from keys_under_test.constants import LENGTH, Point
from sonarhw_sim.compiled import {decorator}

@{decorator}
def factor(point):
    {comment}
    return point.x * LENGTH {operator} 2.0
"""
CALLER = """
from keys_under_test.callee import factor
from keys_under_test.constants import Point
from sonarhw_sim.compiled import compiled

@compiled
def scaled(x, y):
    return factor(Point(x, y))
"""
AS_WRITTEN = {
    "constant": "1.0",
    "fields": "x: float\n    y: float",
    "comment": "# one",
    "operator": "+",
    "decorator": "compiled",
}
Key = Callable[..., str]


@pytest.fixture
def key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Key]:
    """Return a function that returns the key of `scaled`, in a newly written package with these changes."""
    folder = tmp_path / "keys_under_test"
    folder.mkdir()
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def written(**changes: str) -> str:
        texts = AS_WRITTEN | changes
        for name, text in {"__init__": "", "constants": CONSTANTS, "callee": CALLEE, "caller": CALLER}.items():
            (folder / f"{name}.py").write_text(text.format(**texts))
        _forget()
        return _key(importlib.import_module("keys_under_test.caller").scaled)

    yield written
    _forget()


def _forget() -> None:
    for name in [name for name in sys.modules if name.startswith("keys_under_test")]:
        del sys.modules[name]
    importlib.invalidate_caches()


def _key(kernel: Any, signature: Any = (float64, float64), processor: tuple[str, ...] = CPU) -> str:
    return key_of(kernel.py_func, "", signature, processor)


@pytest.mark.parametrize(
    "change",
    [{"operator": "-"}, {"constant": "1.5"}, {"constant": "-0.0"}, {"fields": "y: float\n    x: float"}],
    ids=str,
)
@pytest.mark.parametrize("decorator", ["compiled", "inlined"])
def test_the_key_changes_with_what_a_kernel_uses_from_other_files(
    key: Key, change: dict[str, str], decorator: str
) -> None:
    assert key(decorator=decorator, **change) != key(decorator=decorator)


def test_the_key_does_not_change_with_a_comment(key: Key) -> None:
    assert key(comment="# other\n\n    # and longer") == key()


@pytest.mark.parametrize("constant", ["object()", "[1.0]", "__import__('json')", "lambda: 1.0"])
def test_a_kernel_may_not_use_what_the_key_would_miss(key: Key, constant: str) -> None:
    with pytest.raises(TypeError, match=r"kernel keys_under_test\.callee\.factor uses"):
        key(constant=constant)


def test_the_key_changes_with_types_options_and_processor() -> None:
    @compiled
    def kernel(value: float) -> float:
        return value

    keys = [
        _key(kernel),
        _key(kernel, (int64,)),
        _key(kernel, processor=("x86_64", "some", "+avx512f")),
        key_of(kernel.py_func, "fastmath", (float64, float64), CPU),  # type: ignore[attr-defined]
    ]
    assert len(set(keys)) == len(keys)


def test_the_key_changes_with_the_names_of_fields() -> None:
    def of(*fields: str) -> NamedTuple:
        import collections

        return NamedTuple([float64, int64], collections.namedtuple("Point", fields))

    @compiled
    def kernel(value: float) -> float:
        return value

    assert _key(kernel, (of("x", "y"),)) != _key(kernel, (of("y", "x"),))


def test_the_key_changes_with_a_version_and_the_slot_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    @compiled
    def kernel(value: float) -> float:
        return value

    before, slot = _key(kernel), slot_of((float64,), CPU)
    for library in ("numba", "llvmlite", "numpy", f"{sys.version_info.major}.{sys.version_info.minor}"):
        assert library in kernel_key.versions()
    monkeypatch.setattr(kernel_key, "versions", lambda: "numba 99")
    assert _key(kernel) != before
    assert slot_of((float64,), CPU) == slot


def test_the_key_of_every_kernel_covers_all_it_uses() -> None:
    kernels = [
        (name, value)
        for package in (sonarhw_sim, sonarhw_compare)
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
        for name, value in vars(importlib.import_module(module.name)).items()
        if hasattr(value, "py_func")
    ]
    assert {"_follow", "detected", "log_likelihoods"} <= {name for name, _ in kernels}
    for _, kernel in kernels:
        assert digest_of(kernel.py_func)
