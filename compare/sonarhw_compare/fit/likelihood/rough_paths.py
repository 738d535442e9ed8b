"""Rough surfaces in a likelihood: each kept patch has the power of all that are received together with it."""

from dataclasses import replace

import numpy as np
from sonarhw_sim.board.beam import amplitudes_at, beam_table
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.signal import Patches, covered_by_burst
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.room import Room

_EVERY = 4  # patch is kept: they are then 2° apart, and the beam is wider
_IN_BEAM = 0.3  # least amplitude by the beam of a transducer that points at a patch in the plan


def with_summed_patches(paths: Paths, room: Room, board: Board) -> Paths:
    """Return the paths with few patches of rough surfaces, each as loud as all are if the transducer points at it.

    A likelihood weighs each path alone, while a receiver adds the power of all patches that burst and beam cover.
    """
    rows = np.flatnonzero(paths.scattered)
    if not len(rows):
        return paths
    ka, speed = board.wavenumber(room.air) * board.aperture_radius, room.air.speed_of_sound
    burst, patches = covered_by_burst(board, speed), paths.select(rows)
    gains, phases = paths.gains.copy(), np.nan_to_num(paths.phases)
    kept = ~paths.scattered
    for k in np.argsort(patches.departures, kind="stable")[::_EVERY].tolist():
        beams = amplitudes_at(
            float(patches.departures[k]), patches.leaving, patches.arriving, np.ones(len(rows)), ka, beam_table(ka)
        )
        together = Patches(patches.lengths, patches.spreads, patches.gains * beams)
        until = patches.lengths[k : k + 1]
        kept[rows[k]] = beams[k] >= _IN_BEAM
        gains[rows[k]] = np.sqrt(together.power_between(until - burst, until)[0]) / max(beams[k], _IN_BEAM)
    return replace(paths, gains=gains, phases=phases).select(np.flatnonzero(kept))
