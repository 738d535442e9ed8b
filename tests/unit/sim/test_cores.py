"""Work in parts on several cores: the same results as on one, and no threads where the cores are busy already."""

import multiprocessing
from dataclasses import fields, replace
from threading import Event, get_ident

import numpy as np
import pytest
from sonarhw_sim import compiled
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.compiled import in_parts
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import load_room

HEADINGS = np.radians(np.arange(360.0))
Part = tuple[int, int, int]


def _part(begin: int, end: int) -> Part:
    return begin, end, get_ident()


def _bounds(parts: list[Part]) -> list[tuple[int, int]]:
    return [(begin, end) for begin, end, _ in parts]


def _use(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled, "core_count", lambda: count)


@pytest.mark.parametrize(("room_name", "place_name"), [("laboratory", "bench"), ("doorstep", "robot")])
@pytest.mark.parametrize("count", [2, 5])
def test_paths_and_readings_are_the_same_bit_for_bit_on_any_number_of_cores(
    room_name: str, place_name: str, count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
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


def test_no_part_within_a_part_has_threads_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    _use(2, monkeypatch)
    inner = in_parts(lambda begin, end: (get_ident(), in_parts(_part, 10, 1)), 10, 1)
    assert [_bounds(parts) for _, parts in inner] == [[(0, 10)], [(0, 10)]]
    assert all(parts[0][2] == thread for thread, parts in inner)
    # later calls have threads again
    assert len({thread for _, _, thread in in_parts(_part, 10, 1)}) == 2


def test_a_process_of_a_pool_has_no_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    _use(2, monkeypatch)
    monkeypatch.setattr(multiprocessing, "parent_process", object)
    assert in_parts(_part, 10, 1) == [(0, 10, get_ident())]


def test_a_process_that_computes_beside_others_has_no_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    _use(2, monkeypatch)
    monkeypatch.setattr(compiled, "_one_thread", Event())
    compiled.use_one_thread()
    assert in_parts(_part, 10, 1) == [(0, 10, get_ident())]


def test_an_error_in_one_part_reaches_the_caller(monkeypatch: pytest.MonkeyPatch) -> None:
    _use(2, monkeypatch)

    def fail(begin: int, _: int) -> None:
        if begin:
            raise ValueError(begin)

    with pytest.raises(ValueError, match="5"):
        in_parts(fail, 10, 1)
    assert len(in_parts(_part, 10, 1)) == 2
