"""How the level of a diffracted path depends on the reflectances of the two faces of its edge."""

from collections.abc import Sequence

import numpy as np
from sonarhw_sim.rays.diffraction import amplitudes_at_edges
from sonarhw_sim.rays.paths import Paths, PathSearch
from sonarhw_sim.room.room import Room

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.values.quantities import REFLECTANCE

_LOWER = 0.9  # factor of a reflectance at the other end of the difference
# Largest power. Terms of an edge have those of one face, of both, or of none, so it is about 0 to 2; but where they
# cancel each other, a power describes only a small change.
_MOST = 4.0


def edge_powers(paths: Paths, room: Room, materials: Sequence[str], search: PathSearch) -> FloatArray:
    """Return the power with which the reflectance of each material changes the amplitude of an edge, (k, materials).

    It is 0 for paths without an edge. Each reflection of a path adds 1 to it.
    """
    powers, bent = np.zeros((len(paths), len(materials))), np.flatnonzero(paths.edges >= 0)
    if not len(bent) or not materials:
        return powers
    where = paths.edges[bent], paths.bends[bent], paths.points[bent]

    def amplitudes(changed: Room) -> FloatArray:
        waves = np.full(len(bent), search.wavelength)
        return np.maximum(np.abs(amplitudes_at_edges(changed, *where, waves, search.edge_strength)), 1e-12)

    present = amplitudes(room)
    for column, material in enumerate(materials):
        lower = _LOWER * REFLECTANCE.value(room, material)
        ratios = amplitudes(REFLECTANCE.put(room, {material: lower})) / present
        powers[bent, column] = np.clip(np.log(ratios) / np.log(_LOWER), -_MOST, _MOST)
    return powers
