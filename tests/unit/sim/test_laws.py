"""Laws of sound in any room: reciprocity, energy, symmetry. Rooms and places are random.

Rays sample the room. An edge visible through a slit narrower than their spacing may be found by one search and not by
another, with all its diffracted paths, so two searches may differ in a few paths. Posts spread neighbouring rays, so
paths over posts have their own test.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from sonarhw_sim.air import EdgeStrength
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.rays.paths import Paths, PathSearch, find_paths
from sonarhw_sim.room.room import Place, Room

from tests.fixtures.rooms_for_tests import room_of

Floats = NDArray[np.float64]


SEARCH = PathSearch(max_length=7.0, wavelength=0.00696, max_bounces=4)


STRENGTHS = pytest.mark.parametrize("edge_strength", EdgeStrength)


_SAME = 1e-6  # m, amplitude ratio and rad


_LOUD = 0.03  # amplitude ratio, -30 dB


@dataclass(frozen=True)
class Furnished:
    """Walls round the origin, a plate and a post within them, and two places."""

    walls: Floats  # (n, 4), m
    posts: Floats  # (m, 3), m
    reflectances: Floats  # (n + m,)
    places: Floats  # (2, 2), m

    @property
    def room(self) -> Room:
        return room_of(self.walls, self.posts, self.reflectances)

    def search(self, search: PathSearch = SEARCH) -> Paths:
        source, receiver = self.places.tolist()
        return find_paths(self.room, tuple(source), search, receiver=tuple(receiver))

    def rows(self, search: PathSearch = SEARCH) -> Floats:
        """Return length, gain, departure and arrival of each path that touches no post, (n, 6)."""
        paths = self.search(search)
        return rows(paths.select(np.flatnonzero(~by_posts(paths, self))))


def rows(paths: Paths) -> Floats:
    """Return length, gain, departure and arrival of each path, (n, 6)."""
    angles = (np.cos(paths.departures), np.sin(paths.departures), np.cos(paths.arrivals), np.sin(paths.arrivals))
    return np.column_stack((paths.lengths, paths.gains, *angles))


def by_posts(paths: Paths, furnished: Furnished) -> NDArray[np.bool_]:
    """Return which paths touch a post, (n,) bool."""
    return np.asarray((paths.surfaces >= len(furnished.walls)).any(axis=1))


def furnish(seed: int) -> Furnished:
    random = np.random.default_rng(seed)
    corners = int(random.integers(4, 8))
    angles = (np.arange(corners) + random.uniform(-0.2, 0.2, corners)) * math.tau / corners
    ring = random.uniform(1.2, 2.0, (corners, 1)) * np.column_stack((np.cos(angles), np.sin(angles)))
    plate = random.uniform(-0.8, 0.8, (1, 4))
    walls = np.vstack((np.hstack((ring, np.roll(ring, -1, axis=0))), plate))
    posts = np.column_stack((random.uniform(-0.8, 0.8, (1, 2)), random.uniform(0.02, 0.2, 1)))
    return Furnished(walls, posts, random.uniform(0.2, 1.0, corners + 2), random.uniform(-0.4, 0.4, (2, 2)))


rooms = st.integers(0, 2**32).map(furnish)


def count_missing(expected: Floats, found: Floats) -> int:
    """Return how many of the expected rows are not found."""
    if not len(expected) or not len(found):
        return len(expected)
    distances, _ = cKDTree(found).query(expected, distance_upper_bound=_SAME)
    return int(np.isinf(distances).sum())


def assert_same_rows(one: Floats, other: Floats) -> None:
    few = 3 + 0.05 * max(len(one), len(other))
    assert count_missing(one, other) <= few
    assert count_missing(other, one) <= few


@STRENGTHS
@settings(max_examples=6, deadline=None)
@given(rooms)
def test_swapping_source_and_receiver_reverses_every_path(edge_strength: EdgeStrength, furnished: Furnished) -> None:
    search = replace(SEARCH, edge_strength=edge_strength)
    there = furnished.rows(search)
    back = replace(furnished, places=furnished.places[::-1]).rows(search)
    assert_same_rows(there, back[:, [0, 1, 4, 5, 2, 3]])


def test_loud_paths_over_posts_are_reversed_too() -> None:
    loud = lost = 0
    for furnished in map(furnish, range(8)):
        paths = furnished.search()
        there = rows(paths.select(np.flatnonzero(by_posts(paths, furnished) & (paths.gains > _LOUD))))
        back = rows(replace(furnished, places=furnished.places[::-1]).search())
        loud += len(there)
        lost += count_missing(there, back[:, [0, 1, 4, 5, 2, 3]])
    assert loud > 200
    assert lost <= 0.02 * loud


def test_every_path_back_to_its_start_has_its_reverse() -> None:
    # with one transducer both take the same time, so without the reverse their sum is 6 dB too faint
    for furnished in map(furnish, range(2)):
        paths = find_paths(furnished.room, tuple(furnished.places[0].tolist()), replace(SEARCH, max_length=10.0))
        there = rows(paths)
        assert by_posts(paths, furnished).sum() > 100
        assert count_missing(there, there[:, [0, 1, 4, 5, 2, 3]]) == 0


@STRENGTHS
@settings(max_examples=6, deadline=None)
@given(rooms)
def test_no_path_is_louder_than_its_reflectances_allow(edge_strength: EdgeStrength, furnished: Furnished) -> None:
    # one path alone; what bends past an obstacle beside it may add to it
    paths = furnished.search(replace(SEARCH, edge_strength=edge_strength, shadows=False))
    allowed = np.append(furnished.reflectances, 1.0)[paths.surfaces].prod(axis=1)
    if edge_strength is EdgeStrength.UNIFORM:
        # no edge is louder than the louder of its walls
        room = furnished.room
        louder = room.reflectances[room.edges.faces].max(axis=1, initial=0.0)
        allowed *= np.append(louder, 1.0)[paths.edges]
    assert (paths.gains > 0).all()
    assert (paths.gains <= allowed * (1 + 1e-12)).all()
    flat = (paths.edges < 0) & (paths.surfaces < len(furnished.walls)).all(axis=1)
    assert paths.gains[flat] == pytest.approx(allowed[flat])


@settings(max_examples=6, deadline=None)
@given(rooms)
def test_no_path_is_shorter_than_the_straight_line_or_than_its_legs(furnished: Furnished) -> None:
    paths = furnished.search()
    source, receiver = furnished.places
    assert (paths.lengths >= math.dist(source, receiver) - 1e-9).all()
    for path in range(len(paths)):
        outline = paths.outline(path)
        assert paths.lengths[path] == pytest.approx(np.hypot(*np.diff(outline, axis=0).T).sum(), abs=1e-8)
        assert outline[0] == pytest.approx(source)
        assert outline[-1] == pytest.approx(receiver)


@STRENGTHS
@settings(max_examples=6, deadline=None)
@given(rooms, st.floats(0, math.tau), st.floats(-9, 9), st.floats(-9, 9), st.booleans())
def test_moving_turning_and_mirroring_the_room_changes_nothing(
    edge_strength: EdgeStrength, furnished: Furnished, turn: float, x: float, y: float, mirrored: bool
) -> None:
    search = replace(SEARCH, edge_strength=edge_strength)
    side = -1.0 if mirrored else 1.0
    motion = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]) @ np.diag([1.0, side])
    before = furnished.rows(search)
    after = _mapped(furnished, lambda points: points @ motion.T + (x, y)).rows(search)
    assert_same_rows(np.column_stack((before[:, :2], before[:, 2:4] @ motion.T, before[:, 4:] @ motion.T)), after)


@settings(max_examples=5, deadline=None)
@given(rooms, st.floats(0.1, 30))
def test_a_scaled_room_at_a_scaled_wavelength_has_the_same_paths(furnished: Furnished, scale: float) -> None:
    search = replace(SEARCH, max_length=scale * SEARCH.max_length, wavelength=scale * SEARCH.wavelength)
    larger = replace(_mapped(furnished, lambda points: scale * points), posts=scale * furnished.posts)
    after = larger.rows(search)
    after[:, 0] /= scale
    assert_same_rows(furnished.rows(), after)


def _mapped(furnished: Furnished, motion: Callable[[Floats], Floats]) -> Furnished:
    return replace(
        furnished,
        walls=motion(furnished.walls.reshape(-1, 2)).reshape(-1, 4),
        posts=np.column_stack((motion(furnished.posts[:, :2]), furnished.posts[:, 2])),
        places=motion(furnished.places),
    )


@settings(max_examples=6, deadline=None)
@given(rooms)
def test_an_additional_wall_adds_only_its_own_paths(furnished: Furnished) -> None:
    room = furnished.room
    plate = len(furnished.walls) - 1
    fewer = replace(furnished, walls=furnished.walls[:plate], reflectances=np.delete(furnished.reflectances, plate))
    paths = furnished.search()
    own = [room.names[plate] in "/".join(paths.via(path, room)).split("/") for path in range(len(paths))]
    others = paths.select(np.flatnonzero(~np.array(own, dtype=np.bool_) & ~by_posts(paths, furnished)))
    assert count_missing(rows(others), fewer.rows()) <= 3 + 0.05 * len(others)


@settings(max_examples=5, deadline=None)
@given(rooms, st.floats(0.1, 1.0))
def test_lower_reflectance_weakens_a_path_once_for_every_reflection(furnished: Furnished, duller: float) -> None:
    unbent = replace(SEARCH, diffraction=False)
    bright = furnished.search(unbent)
    dull = replace(furnished, reflectances=duller * furnished.reflectances).search(unbent)
    assert dull.lengths == pytest.approx(bright.lengths)
    assert dull.gains == pytest.approx(bright.gains * duller**bright.bounces)


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 2**32), st.floats(-1, 1))
def test_scan_from_the_axis_of_a_symmetric_room_is_symmetric(seed: int, x: float) -> None:
    random = np.random.default_rng(seed)
    upper = np.column_stack((np.sort(random.uniform(-2, 2, 4)), random.uniform(0.3, 2, 4)))
    half = np.hstack((upper[:-1], upper[1:]))
    both = np.vstack((half, half * (1, -1, 1, -1)))
    room = room_of(both, reflectances=[0.9] * 6)
    aside = np.radians(np.arange(2.5, 180, 5.0))
    place = Place("axis", (x, 0.0))
    left, right = (predict_scan(room, place, load_board("paper"), headings) for headings in (aside, -aside))
    # where two paths are within rounding of the threshold or of each other, either may win
    assert np.isclose(left.ranges, right.ranges, atol=1e-6, equal_nan=True).sum() >= len(aside) - 1
