"""The rims of closed boxes and of posts with lids: the nearest point of each, and the wedge of wall and lid there."""

import math

import numpy as np
import pytest
from sonarhw_sim.rays.diffraction import by_wedge
from sonarhw_sim.rays.paths import Paths, PathSearch
from sonarhw_sim.room.room import Room, parse_room
from sonarhw_sim.space.sections import paths_from

WAVELENGTH = 0.00695
TOP, SHARE = 0.5, 0.9
PLACE = np.array([0.2, 0.1, 1.0])
CORNERS = np.array([[1.0, -0.2], [1.5, -0.3], [1.6, 0.4], [1.1, 0.35]])
CENTRE, RADIUS = np.array([0.3, 1.2]), 0.1


def _room(lids: bool) -> Room:
    closed = "lids = true\n" if lids else ""
    return parse_room(
        f"""
name = "room"
[materials.hard]
reflectance = {SHARE}
[[walls]]
name = "box"
points = {CORNERS.tolist()}
closed = true
material = "hard"
height = [0.0, {TOP}]
{closed}
[[posts]]
name = "leg"
center = {CENTRE.tolist()}
radius = {RADIUS}
material = "hard"
height = [0.0, {TOP}]
{closed}
[places.here]
position = {PLACE[:2].tolist()}
height = {PLACE[2]}
""",
        "room",
    )


def _bent(lids: bool) -> tuple[Room, Paths]:
    room = _room(lids)
    paths = paths_from(room, room.places["here"], PathSearch(4.0, WAVELENGTH, faintest_diffraction=1e-4))
    return room, paths.select(np.flatnonzero(paths.edges >= len(room.edges)))


def _expected() -> dict[float, float]:
    """Return the amplitude by length, m, of sound straight to the upper edges of a solid box and back."""
    found = {}
    for start, end in zip(CORNERS, np.roll(CORNERS, -1, axis=0), strict=True):
        along = (end - start) / np.hypot(*(end - start))
        at = float((PLACE[:2] - start) @ along)
        if not 0.0 < at < np.hypot(*(end - start)):
            continue
        away = PLACE[:2] - start - at * along
        aside, rise = float(away @ (along[1], -along[0])), PLACE[2] - TOP
        # from the side of the wall, straight down, through the air outside to the lid
        angle, leg = np.array([math.atan2(rise, aside) + math.pi / 2]), np.array([math.hypot(aside, rise)])
        faces = np.full((1, 2), SHARE)
        found[float(2 * leg[0])] = float(abs(by_wedge(angle, angle, np.array([1.5]), faces, leg, leg, WAVELENGTH)[0]))
    return found


def test_rims_of_a_box_with_lids_are_the_edges_of_a_solid() -> None:
    room, paths = _bent(lids=True)
    rows = [k for k in range(len(paths)) if paths.via(k, room)[0].endswith("box lid")]
    expected = _expected()
    assert len(expected) == 2  # one of them is seen across the lid
    assert paths.lengths[rows].tolist() == pytest.approx(sorted(expected), abs=1e-9)
    assert paths.gains[rows].tolist() == pytest.approx([expected[length] for length in sorted(expected)], rel=1e-9)


def test_without_lids_the_rims_are_those_of_sheets() -> None:
    _, paths = _bent(lids=False)
    for length, solid in _expected().items():
        sheet = paths.gains[np.argmin(np.abs(paths.lengths - length))]
        assert abs(20 * math.log10(sheet / solid)) > 0.5


def test_the_rim_of_a_post_with_a_lid_is_louder_than_of_one_with_a_silent_end() -> None:
    (room, closed), (other, open_) = _bent(lids=True), _bent(lids=False)
    length = 2 * math.hypot(np.hypot(*(PLACE[:2] - CENTRE)) - RADIUS, PLACE[2] - TOP)
    rows = [int(np.argmin(np.abs(paths.lengths - length))) for paths in (closed, open_)]
    assert closed.lengths[rows[0]] == pytest.approx(length, abs=1e-9)
    assert open_.lengths[rows[1]] == pytest.approx(length, abs=1e-9)
    assert closed.via(rows[0], room) == ("leg/leg lid",)
    assert open_.via(rows[1], other) == ("leg/",)
    assert closed.gains[rows[0]] > 1.2 * open_.gains[rows[1]]
