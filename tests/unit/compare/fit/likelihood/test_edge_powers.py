"""Levels of diffracted paths as functions of reflectances, against a new search of paths."""

from dataclasses import replace

import numpy as np
from sonarhw_compare.fit import free_parameters
from sonarhw_compare.fit.likelihood import edge_powers
from sonarhw_compare.fit.objective import make_problem
from sonarhw_compare.fit.result import FitOptions, PlacedScan
from sonarhw_sim.air import EdgeStrength
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import PredictionOptions, search_for
from sonarhw_sim.rays.paths import find_paths
from sonarhw_sim.room.room import Place, load_room

from sonarhw.readings import FloatArray, Reading

ARENA, BOARD = load_room("rooms/arena.toml"), load_board("polaroid-6500")
HERE = Place("here", (0.95, 0.55))
LOWER = 0.8  # of the reflectance


def levels_of(reflectance: float, searched: float) -> tuple[FloatArray, FloatArray]:
    """Return lengths, m, and levels, dB, of all paths with this reflectance of the walls, searched with another one."""
    free = free_parameters(["reflectance"], [""], ARENA, BOARD)
    scan = PlacedScan([Reading(0, 0, 0, 0.0, 0.0, (0.006,), 343.0)], HERE)
    problem = make_problem([scan], ARENA, BOARD, free, FitOptions().prediction, all_echoes=False)
    values = problem.start()
    values[0] = searched
    objective = problem.near(values)
    values[0] = reflectance
    paths = objective.paths[0]
    lengths = [np.hypot(*each.T) for each in (paths.out, paths.back)]
    return lengths[0] + lengths[1], objective._levels(values[None], 0)[0]


def test_a_lower_reflectance_lowers_diffracted_paths_as_a_new_search_does() -> None:
    present = float(ARENA.reflectances[0])
    lengths, levels = levels_of(LOWER * present, present)
    new_lengths, new_levels = levels_of(LOWER * present, LOWER * present)
    # the louder ones of a higher reflectance are among the paths, so the search finds more of them
    assert len(lengths) > len(new_lengths) > 300
    same = np.abs(lengths - new_lengths[:, None]) < 1e-9
    assert same.any(axis=1).all()
    errors = np.where(same, np.abs(levels - new_levels[:, None]), np.inf).min(axis=1)
    assert (errors < 0.3).mean() > 0.98


def test_edges_have_powers_of_the_faces_and_other_paths_have_none() -> None:
    search = search_for(ARENA, BOARD, PredictionOptions())
    paths = find_paths(ARENA, HERE.position, search)
    powers = edge_powers(paths, ARENA, [ARENA.materials[0]], search)[:, 0]
    assert (powers[paths.edges < 0] == 0).all()
    assert powers.max() > 1.0
    of_paper = replace(search, edge_strength=EdgeStrength.PAPER)
    assert (edge_powers(paths, ARENA, [ARENA.materials[0]], of_paper) == 0).all()
