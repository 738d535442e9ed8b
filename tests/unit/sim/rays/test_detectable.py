"""A search with the axes of two transducers finds all paths that they can detect."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from sonarhw_sim.air import EdgeStrength
from sonarhw_sim.board.beam import beam_gain
from sonarhw_sim.rays.fan import Targets, TransducerAxes, all_rays, fan, follow_fan
from sonarhw_sim.rays.paths import Paths, PathSearch, find_paths
from sonarhw_sim.room.room import Room, load_room, with_post

from tests.fixtures.rooms_for_tests import polygon_room

Floats = NDArray[np.float64]

KA = 17.3
FAINTEST = 3e-4
SENDER, LISTENER = (1.72, 1.23), (1.80, 1.20)  # on the laboratory's bench


def with_body(room: Room) -> Room:
    """Return the room with a round body, like that of a ring of sensors, beside both transducers."""
    return with_post(room, (1.76, 1.16, 0.03), "body", 0.95)


def amplitudes(paths: Paths, leaving: float, arriving: float) -> Floats:
    return np.asarray(
        paths.gains * beam_gain(paths.departures - leaving, KA) * beam_gain(paths.arrivals - arriving, KA)
    )


def as_rows(paths: Paths) -> Floats:
    angles = (f(a) for a in (paths.departures, paths.arrivals) for f in (np.cos, np.sin))
    return np.column_stack((paths.lengths, paths.gains, *angles))


@pytest.mark.parametrize("strength", EdgeStrength)
@pytest.mark.parametrize("leaving_deg", [10.0, 100.0, 200.0])
@pytest.mark.parametrize("turned_deg", [0.0, 30.0, 120.0])
def test_no_detectable_path_is_dropped(strength: EdgeStrength, leaving_deg: float, turned_deg: float) -> None:
    room = with_body(load_room("rooms/laboratory.toml"))
    leaving, arriving = math.radians(leaving_deg), math.radians(leaving_deg + turned_deg)
    search = PathSearch(9.0, 0.007, edge_strength=strength, faintest_diffraction=3e-3)
    axes = TransducerAxes(leaving, arriving, KA, FAINTEST)
    every = find_paths(room, SENDER, search, LISTENER)
    detected = as_rows(every.select(np.flatnonzero(amplitudes(every, leaving, arriving) >= FAINTEST)))
    found = find_paths(room, SENDER, replace(search, axes=axes), LISTENER)
    distances, _ = cKDTree(as_rows(found)).query(detected)
    assert len(detected) > 10
    assert distances.max() < 1e-6
    assert len(found) < len(every) / 2


def test_ray_ends_where_it_is_too_faint() -> None:
    room = polygon_room([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    middle, rays = np.array([0.45, 0.55]), fan(64)
    targets = Targets.at(middle[None], np.array([20.0]))
    # with a reflectance of 0.9, six reflections leave more than half, seven less
    half = all_rays(64, 1)._replace(least=np.array([0.5]))
    found = follow_fan(room, middle, rays, targets, 64, half)
    assert len(found.candidates)
    assert found.candidates[:, 1].max() == 6
