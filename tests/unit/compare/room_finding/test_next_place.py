"""The next scan is proposed where and towards what a found room is uncertain."""

import math

import pytest
from sonarhw_compare.rooms.candidates import Touches
from sonarhw_compare.rooms.draft import DraftEnd, DraftWall, RoomDraft
from sonarhw_compare.rooms.outcome import next_places
from sonarhw_compare.rooms.refinement import Move
from sonarhw_compare.rooms.search import FoundRoom
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import Place

BOARD = load_board("polaroid-6500")
EAST, NORTH, WEST, SOUTH = 0, 1, 2, 3


def rectangle(**deviations: float) -> FoundRoom:
    """Return a room of 4 by 2 m, whose walls have these standard deviations across (m), all others none."""
    middles = {EAST: (4.0, 1.0), NORTH: (2.0, 2.0), WEST: (0.0, 1.0), SOUTH: (2.0, 0.0)}
    walls = {}
    for key, middle in middles.items():
        half = 1.0 if key in (EAST, WEST) else 2.0
        ends = DraftEnd(-half, (key - 1) % 4), DraftEnd(half, (key + 1) % 4)
        walls[key] = DraftWall(middle, math.pi / 2 + key * math.pi / 2, ends)
    moves = {Move("wall", key, 0): deviations.get(name, 0.0) for name, key in NAMES.items()}
    return FoundRoom(RoomDraft((Place("a", (2.0, 1.0)),), walls), moves, Touches({}, (), (), ()), 0.0)


NAMES = {"east": EAST, "north": NORTH, "west": WEST, "south": SOUTH}


def proposed(found: FoundRoom) -> list[tuple[float, float, float, tuple[tuple[float, float], ...]]]:
    room = found.draft.room(Air())
    return [(*one.position, one.gain, one.sectors) for one in next_places(found, room, BOARD)]


def test_a_wall_is_scanned_from_where_most_readings_are_of_it_and_towards_it() -> None:
    (x, y, gain, sectors), *others = proposed(rectangle(east=0.03))
    # one reading tells ½ ln(1 + 3²) = 1.15 nats; some twenty of them three halves more
    assert 1.15 < gain < 0.5 * math.log1p(72 * 9 * 4)
    assert gain >= others[0][2]
    assert any(first <= angle <= last for first, last in sectors for angle in (0.0, math.tau))
    assert 0.15 < x < 3.85
    assert 0.15 < y < 1.85
    assert len(others) == 2


def test_a_larger_uncertainty_tells_more_by_its_logarithm() -> None:
    small, large = (proposed(rectangle(north=sd))[0] for sd in (0.02, 0.08))
    assert large[2] - small[2] == pytest.approx(math.log(4), abs=0.05)
    assert large[:2] == small[:2]


def test_nothing_is_gained_in_a_room_that_is_known() -> None:
    assert [(gain, sectors) for _, _, gain, sectors in proposed(rectangle())] == [(0.0, ())] * 3


def test_the_best_places_so_far_are_reported_from_the_first_one_on() -> None:
    found, shares, best = rectangle(east=0.03, north=0.02), [], []
    room = found.draft.room(Air())
    places = next_places(
        found, room, BOARD, tick=shares.append, best=lambda known: best.append((len(shares), known[0].gain, known))
    )
    assert best[0][0] == 1  # after the first place
    assert best[-1][2] == places
    gains = [gain for _, gain, _ in best]
    assert gains == sorted(gains)
    # places all over the room come first: a tenth of them has most of what can be gained
    assert [gain for tried, gain, _ in best if tried <= len(shares) / 10][-1] > 0.9 * places[0].gain
