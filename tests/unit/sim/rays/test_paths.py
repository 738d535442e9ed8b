"""Paths against image sources, closed forms and symmetry."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from sonarhw_sim.air import EdgeStrength
from sonarhw_sim.rays.paths import PathSearch, find_paths
from sonarhw_sim.room.room import Room, load_room

from tests.fixtures.rooms_for_tests import polygon_room, room_of, star_room
from tests.oracles.image_sources import specular_lengths

WAVELENGTH = 0.00696
QUARTER_DEGREE = 1440  # rays


def specular(max_length: float, max_bounces: int = 64, rays: int = QUARTER_DEGREE) -> PathSearch:
    return PathSearch(max_length, WAVELENGTH, max_bounces, diffraction=False, rays=rays)


def missing_from(found: np.ndarray, expected: np.ndarray) -> int:
    """Return how many of the sorted `expected` lengths have no separate match in `found`, to a micrometre."""
    left, missing = list(found), 0
    for length in expected:
        at = int(np.argmin(np.abs(np.array(left) - length))) if left else -1
        if at >= 0 and abs(left[at] - length) < 1e-6:
            left.pop(at)
        else:
            missing += 1
    return missing


def test_specular_paths_are_those_of_image_sources() -> None:
    wanted_in_all = missed = invented = 0
    for seed in range(30):
        room = star_room(seed, 4 + seed % 5, convex=seed % 2 == 0)
        exact = np.array(specular_lengths(room, (0.11, -0.07), 3))
        found = find_paths(room, (0.11, -0.07), specular(40.0, 3)).lengths
        wanted_in_all += len(exact)
        missed += missing_from(found, exact)
        invented += missing_from(exact, found)
    assert wanted_in_all > 300
    assert missed <= 0.01 * wanted_in_all
    assert invented == 0


def test_rectangle_has_the_paths_of_its_image_lattice() -> None:
    room = load_room("rooms/simple.toml")
    (x, y), reach = room.places["figure9"].position, 8.0
    lattice = []
    for i in range(-20, 21):
        for j in range(-20, 21):
            dx = i * 0.928 + (0.0 if i % 2 == 0 else 0.928 - 2 * x)
            dy = j * 0.742 + (0.0 if j % 2 == 0 else 0.742 - 2 * y)
            if (i, j) != (0, 0) and math.hypot(dx, dy) <= reach:
                lattice.append(math.hypot(dx, dy))
    found = find_paths(room, (x, y), PathSearch(reach, WAVELENGTH, diffraction=False)).lengths
    assert len(found) == len(lattice)
    assert missing_from(found, np.array(sorted(lattice))) == 0


def test_right_angle_corner_is_one_path_with_both_reflectances() -> None:
    room = load_room("rooms/simple.toml")
    paths = find_paths(room, (0.774, 0.085), specular(2.1))
    corner = [k for k in range(len(paths)) if set(paths.via(k, room)) == {"top", "left"} and paths.bounces[k] == 2]
    assert len(corner) == 1
    assert paths.via(corner[0], room) == ("top", "left")
    assert paths.lengths[corner[0]] == pytest.approx(2 * math.hypot(0.774, 0.657), abs=1e-12)
    assert paths.gains[corner[0]] == pytest.approx(0.95**2)


@pytest.mark.parametrize("divisor", [2, 4, 6])
def test_corner_of_an_even_divisor_returns_sound_along_its_path(divisor: int) -> None:
    opening = math.pi / divisor
    room = polygon_room([(2.0, 0.0), (0.0, 0.0), (2 * math.cos(opening), 2 * math.sin(opening))], closed=False)
    here = 1.3 * np.array([math.cos(opening * 0.37), math.sin(opening * 0.37)])
    paths = find_paths(room, (float(here[0]), float(here[1])), PathSearch(6.0, WAVELENGTH))
    back = [k for k in range(len(paths)) if paths.bounces[k] == divisor and abs(paths.lengths[k] - 2.6) < 1e-9]
    assert len(back) == 1
    assert paths.arrivals[back[0]] == pytest.approx(paths.departures[back[0]], abs=1e-9)
    assert not any(paths.edges[k] >= 0 and abs(paths.lengths[k] - 2.6) < 1e-9 for k in range(len(paths)))


def test_every_path_has_its_reverse() -> None:
    room = star_room(5, 7, convex=False)
    paths = find_paths(room, (0.2, 0.1), specular(12.0, 4, rays=5760))
    found_rows = {(round(p, 6), round(a, 6), round(d, 6)) for p, d, a in _rows(paths)}
    assert all((round(p, 6), round(d, 6), round(a, 6)) in found_rows for p, d, a in _rows(paths))


def _rows(paths: object) -> list[tuple[float, float, float]]:
    return list(zip(paths.lengths, paths.departures, paths.arrivals, strict=True))  # type: ignore[attr-defined]


def test_angle_in_is_angle_out_at_every_wall() -> None:
    room = star_room(8, 6, convex=False)
    paths = find_paths(room, (0.1, 0.2), specular(10.0, 4))
    checked = 0
    for k in range(len(paths)):
        corners = paths.outline(k)
        for b, surface in enumerate(paths.surfaces[k][: paths.bounces[k]]):
            x0, y0, x1, y1 = room.walls[surface]
            along = np.array([x1 - x0, y1 - y0]) / math.hypot(x1 - x0, y1 - y0)
            before, after = corners[b + 1] - corners[b], corners[b + 2] - corners[b + 1]
            assert before @ along / np.linalg.norm(before) == pytest.approx(after @ along / np.linalg.norm(after))
            checked += 1
    assert checked > 50


def test_lengths_are_the_lengths_of_the_outlines() -> None:
    room = load_room("rooms/laboratory.toml")
    paths = find_paths(room, room.places["bench"].position, PathSearch(9.0, WAVELENGTH))
    assert (paths.edges >= 0).any()
    assert (paths.surfaces >= len(room.walls)).any()
    for k in range(len(paths)):
        legs = np.diff(paths.outline(k), axis=0)
        assert paths.lengths[k] == pytest.approx(np.hypot(*legs.T).sum(), abs=1e-9)
        assert len(paths.outline(k)) == 2 + len(paths.via(k, room))


POST = '[[posts]]\nname = "post"\ncenter = [1.0, 0.0]\nradius = 0.05\nmaterial = "hard"'
FAR_WALL = [(-5.0, -5.0), (-5.0, 5.0)]


def test_post_returns_less_by_its_curvature() -> None:
    room = polygon_room(FAR_WALL, closed=False, extra=POST)
    paths = find_paths(room, (0.0, 0.0), specular(3.0))
    assert len(paths) == 1
    assert paths.lengths[0] == pytest.approx(1.9, abs=1e-9)
    assert paths.gains[0] == pytest.approx(0.9 * math.sqrt(0.05 / (0.05 + 0.95)))


def test_path_over_post_and_wall_has_equal_angles_at_the_post() -> None:
    room = polygon_room([(-3.0, 2.0), (3.0, 2.0)], closed=False, extra=POST.replace("1.0, 0.0", "1.0, 0.3"))
    paths = find_paths(room, (0.0, 0.0), specular(8.0))
    both = [k for k in range(len(paths)) if paths.via(k, room) == ("post", "w[0]")]
    assert len(both) == 1
    here, touch, wall, _ = paths.outline(both[0])
    normal = (touch - (1.0, 0.3)) / 0.05
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    inward, outward = (touch - here) / np.linalg.norm(touch - here), (wall - touch) / np.linalg.norm(wall - touch)
    assert inward @ normal == pytest.approx(-(outward @ normal), abs=1e-9)
    assert wall[1] == pytest.approx(2.0)


def test_free_wall_end_diffracts_with_the_papers_factor() -> None:
    room = polygon_room([(0.35, 0.0), (1.0, -0.4)], closed=False)
    paths = find_paths(room, (0.0, 0.0), PathSearch(0.8, WAVELENGTH, edge_strength=EdgeStrength.PAPER))
    assert [paths.via(k, room) for k in range(len(paths))] == [("w[0]/",)]
    assert paths.lengths[0] == pytest.approx(0.7)
    assert 20 * math.log10(paths.gains[0]) == pytest.approx(-33.0, abs=0.1)


def test_convex_corner_diffracts_from_outside_only() -> None:
    box = [(1.0, -0.5), (2.0, -0.5), (2.0, 0.5), (1.0, 0.5)]
    outside = find_paths(polygon_room(box), (0.0, -0.8), PathSearch(4.0, WAVELENGTH))
    inside = find_paths(polygon_room(box), (1.4, 0.1), PathSearch(4.0, WAVELENGTH))
    assert (outside.edges >= 0).any()
    assert not (inside.edges >= 0).any()


def test_edge_is_reached_by_reflection_too() -> None:
    room = polygon_room(
        [(-2.0, 1.0), (2.0, 1.0)],
        closed=False,
        extra='[[walls]]\nname = "fin"\npoints = [[1.0, 0.2], [1.0, -1.0]]\nmaterial = "hard"',
    )
    paths = find_paths(room, (0.0, 0.0), PathSearch(5.0, WAVELENGTH))
    reflected = [paths.lengths[k] for k in range(len(paths)) if paths.via(k, room) == ("w[0]", "fin[0]/")]
    assert min(reflected) == pytest.approx(math.hypot(1.0, 1.8) + math.hypot(1.0, 0.2))


def test_wall_end_on_another_wall_is_not_free() -> None:
    tee = '[[walls]]\nname = "tee"\npoints = [[0.3, 1.0], [0.3, 0.6]]\nmaterial = "hard"'
    room = polygon_room([(-2.0, 1.0), (2.0, 1.0)], closed=False, extra=tee)
    assert set(room.edges.names) == {"w[0]/", "tee[0]/"}
    assert len(room.edges) == 3


def test_ends_within_a_micrometre_leave_no_gap() -> None:
    gap = 0.9e-6
    room = polygon_room([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0), (0.0, gap)], closed=False)
    tight: Room = polygon_room([(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)])
    a, b = (find_paths(r, (0.7, 0.4), PathSearch(6.0, WAVELENGTH)) for r in (room, tight))
    assert len(a) == len(b)
    assert not len(room.edges.names) > len(tight.edges.names)


def test_place_outside_the_room_has_paths() -> None:
    paths = find_paths(load_room("rooms/simple.toml"), (-1.0, 0.3), PathSearch(3.0, WAVELENGTH))
    assert paths.lengths[0] == pytest.approx(2.0)


def test_place_that_no_sound_returns_to_has_no_paths() -> None:
    room = polygon_room([(1.0, 1.0), (2.0, 1.0)], closed=False)
    assert len(find_paths(room, (0.0, 1.0), specular(9.0))) == 0


def test_screen_narrower_than_the_ray_spacing_hides_the_wall() -> None:
    screen = '[[walls]]\nname = "screen"\npoints = [[-0.0005, 1.0], [0.0005, 1.0]]\nmaterial = "hard"'
    room = polygon_room([(-2.0, 2.0), (2.0, 2.0)], closed=False, extra=screen)
    paths = find_paths(room, (0.0, 0.0), specular(4.5))
    assert ("w[0]",) not in [paths.via(k, room) for k in range(len(paths))]


def test_edge_behind_a_wall_has_no_path() -> None:
    fin = '[[walls]]\nname = "fin"\npoints = [[2.0, 0.1], [2.0, 1.0]]\nmaterial = "hard"'
    room = polygon_room([(1.0, -1.0), (1.0, 1.0)], closed=False, extra=fin)
    paths = find_paths(room, (0.0, 0.0), PathSearch(6.0, WAVELENGTH))
    assert {paths.via(k, room)[-1] for k in range(len(paths))} == {"w[0]", "w[0]/"}


def test_second_wall_flush_with_the_first_changes_nothing() -> None:
    square = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
    board = '[[walls]]\nname = "board"\npoints = [[0.2, 2.0], [1.8, 2.0]]\nmaterial = "hard"'
    plain, boarded, doubled = (
        find_paths(polygon_room(square, extra=extra), (0.7, 0.6), PathSearch(9.0, WAVELENGTH)).lengths
        for extra in ("", board, board.replace("0.2", "0.0").replace("1.8", "2.0"))
    )
    assert boarded == pytest.approx(plain, abs=1e-9)
    assert doubled == pytest.approx(plain, abs=1e-9)


@pytest.mark.parametrize("place", [(1.0, 0.0), (0.0, 0.0), (3.0, 0.0), (1.0, 1.0)])
def test_sensor_on_a_wall_in_a_corner_or_in_line_with_one_has_paths(place: tuple[float, float]) -> None:
    room = polygon_room([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)])
    paths = find_paths(room, place, PathSearch(9.0, WAVELENGTH))
    assert np.isfinite(paths.lengths).all()
    assert np.isfinite(paths.gains).all()
    assert (paths.gains <= 1.0).all()


def test_edge_along_its_own_wall_has_no_path() -> None:
    room, search = polygon_room([(1.0, 0.0), (2.0, 0.0)], closed=False), PathSearch(6.0, WAVELENGTH)
    # edge-on, a plate is silent by the uniform theory
    assert len(find_paths(room, (0.0, 0.0), search)) == 0
    paths = find_paths(room, (0.0, 0.0), replace(search, edge_strength=EdgeStrength.PAPER))
    assert paths.lengths == pytest.approx([2.0])


def test_path_as_long_as_the_limit_and_its_reverse_are_both_listed() -> None:
    room = polygon_room([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0)])
    paths = find_paths(room, (1.13, 0.71), specular(8.0, 4))
    assert [paths.via(k, room)[0] for k in np.flatnonzero(paths.lengths > 7.999)] == ["w[0]", "w[2]"]


def test_sound_spread_by_a_thin_post_reaches_edges_in_all_directions() -> None:
    """The shortest path over the post to the free end of a wall and straight back, by Fermat's principle."""
    post = (1.0, 0.0, 0.01)
    angles = np.radians([40, 70, 100, 125, 235, 260, 290, 320])
    tips = np.column_stack((1.0 + 1.5 * np.cos(angles), 1.5 * np.sin(angles)))
    outer = np.column_stack((1.0 + 2.5 * np.cos(angles), 2.5 * np.sin(angles)))
    room = room_of(np.hstack((tips, outer)), [post])
    paths = find_paths(room, (0.0, 0.0), PathSearch(12.0, WAVELENGTH, 1, True, 5760, EdgeStrength.PAPER, 1e-6))
    number = len(room.walls)
    found = {}
    for row in range(len(paths)):
        if paths.edges[row] >= 0 and paths.bounces[row] == 1 and paths.surfaces[row, 0] == number:
            found.setdefault(int(paths.edges[row]), []).append(float(paths.lengths[row]))

    for x, y in tips.tolist():
        (edge,) = [k for k, at in enumerate(room.edges.points.tolist()) if math.dist(at, (x, y)) < 1e-9]

        def length(turn: float, x: float = x, y: float = y) -> float:
            px, py = 1.0 + 0.01 * math.cos(turn), 0.01 * math.sin(turn)
            return math.hypot(px, py) + math.hypot(px - x, py - y) + math.hypot(x, y)

        middle = (math.pi + math.atan2(y, x - 1.0)) / 2 + (math.pi if y < 0 else 0.0)
        shortest = minimize_scalar(
            length, bounds=(middle - 1.0, middle + 1.0), method="bounded", options={"xatol": 1e-12}
        ).fun
        # there over the post, and back over it
        assert found[edge] == pytest.approx([shortest] * 2, abs=1e-9)
