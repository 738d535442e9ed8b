"""Compiled code: its key covers all that it depends on, damaged files are not used, and parts run on several cores."""

import importlib
import multiprocessing
import pkgutil
from dataclasses import fields, replace
from pathlib import Path
from threading import get_ident

import matplotlib.font_manager  # noqa: F401  # its first import starts a process, which no unit test may
import numpy as np
import pytest
import sonarhw_compare
import sonarhw_sim
from sonarhw_sim import compiled as compiled_module
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.compiled import compiled, compiled_part, in_parts
from sonarhw_sim.compiler import digest_of, kernel_folders
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import load_room

from sonarhw.readings import FloatArray


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


# Files of compiled code.


def test_numba_cache_dir_replaces_the_default_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("numba.core.config.CACHE_DIR", "")
    installation, home = kernel_folders()
    assert installation.parent.name == "sonarhw_sim"
    assert home != installation
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path))
    assert kernel_folders() == [tmp_path]


# Kernels are called by Python, their parts by kernels only.


@compiled_part
def _half(value: float) -> float:
    return value / 2


@compiled
def _sum_of_halves(values: FloatArray) -> float:
    total = 0.0
    for value in values:
        total += _half(value)
    return total


def test_a_part_is_called_by_kernels_and_refuses_calls_by_python() -> None:
    with pytest.raises(TypeError, match="_half can be called by kernels only"):
        _half(3.0)
    assert _sum_of_halves(np.array([1.0, 2.0])) == 1.5
    with pytest.raises(TypeError, match="_half can be called by kernels only"):
        _half(3.0)


# Parts on several cores.


HEADINGS = np.radians(np.arange(360.0))


Part = tuple[int, int, int]


def _part(begin: int, end: int) -> Part:
    return begin, end, get_ident()


def _bounds(parts: list[Part]) -> list[tuple[int, int]]:
    return [(begin, end) for begin, end, _ in parts]


def _use(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled_module, "core_count", lambda: count)


@pytest.mark.parametrize(("room_name", "place_name"), [("laboratory", "bench"), ("doorstep", "robot")])
@pytest.mark.parametrize("count", [3])
def test_any_cores_same_bits(room_name: str, place_name: str, count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    room, board = load_room(room_name), replace(load_board("polaroid-6500"), max_range=6.0)

    def scan() -> PredictedScan:
        return predict_scan(room, room.places[place_name], board, HEADINGS)

    _use(1, monkeypatch)
    one = scan()
    _use(count, monkeypatch)
    several = scan()
    assert len(one.paths) > 100
    for field in fields(one.paths):
        expected, found = getattr(one.paths, field.name), getattr(several.paths, field.name)
        assert expected.tobytes() == found.tobytes(), field.name
    assert one.ranges.tobytes() == several.ranges.tobytes()
    assert (one.winners == several.winners).all()


def test_parts_are_consecutive_and_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    _use(3, monkeypatch)
    assert _bounds(in_parts(_part, 10, 1)) == [(0, 3), (3, 6), (6, 10)]
    assert _bounds(in_parts(_part, 10, 5)) == [(0, 5), (5, 10)]
    assert _bounds(in_parts(_part, 10, 6)) == [(0, 10)]
    assert _bounds(in_parts(_part, 0, 1)) == [(0, 0)]


def test_a_process_of_a_pool_has_no_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    _use(2, monkeypatch)
    monkeypatch.setattr(multiprocessing, "parent_process", object)
    assert in_parts(_part, 10, 1) == [(0, 10, get_ident())]


def test_an_error_in_one_part_reaches_the_caller(monkeypatch: pytest.MonkeyPatch) -> None:
    _use(2, monkeypatch)

    def fail(begin: int, _: int) -> None:
        if begin:
            raise ValueError(begin)

    with pytest.raises(ValueError, match="5"):
        in_parts(fail, 10, 1)
    assert len(in_parts(_part, 10, 1)) == 2


def test_no_part_within_a_part_has_threads_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    _use(2, monkeypatch)
    inner = in_parts(lambda begin, end: (get_ident(), in_parts(_part, 10, 1)), 10, 1)
    assert [_bounds(parts) for _, parts in inner] == [[(0, 10)], [(0, 10)]]
    assert all(parts[0][2] == thread for thread, parts in inner)
    # later calls have threads again
    assert len({thread for _, _, thread in in_parts(_part, 10, 1)}) == 2
