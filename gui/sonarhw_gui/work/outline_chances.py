"""The probability of ranges at each heading of the predicted outline, as an image for the range view."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw.readings import FloatArray
from sonarhw_gui.scene.scene_edit import room_and_place
from sonarhw_gui.work.prediction_requests import PathsFound

if TYPE_CHECKING:
    from sonarhw_sim.probability.reading_chances import PossibleReading

_CELLS = 400  # along the range
_UNLIKELY = 0.02  # less probable ranges may be beyond the image


@dataclass(frozen=True)
class OutlineChances:
    """Opacities by heading and range; at the middle of a possible echo, the opacity is its probability."""

    generation: int  # of the scene
    headings: FloatArray  # (n,), rad, evenly spaced from 0
    opacities: FloatArray  # (n, m), 0 to 1; rows are cells of range from 0 up to `reach`
    reach: float  # m


@dataclass(frozen=True)
class ChancesRequest:
    """Find the probabilities for the outline of these paths."""

    found: PathsFound

    def answer(self) -> OutlineChances:
        """Search the fainter paths, and weigh the possible readings at every heading of the outline."""
        # slow to load, and few boards state a spread
        from sonarhw_sim.probability.reading_chances import possible_readings, scan_with_fainter_paths

        found, scene = self.found, self.found.scene
        room, _ = room_and_place(scene)
        headings = found.outline.headings
        scan = scan_with_fainter_paths(room, scene.pose, scene.board, headings, found.options)
        possible = [possible_readings(scan, index) for index in range(len(headings))]
        reach = _reach(possible)
        middles = (np.arange(_CELLS) + 0.5) * reach / _CELLS
        opacities = np.array([_opacities(readings, middles) for readings in possible])
        return OutlineChances(found.generation, headings, opacities, reach)


def has_chances(outline: PredictedScan) -> bool:
    """Return whether the board states a spread, so that an outline has probabilities to show."""
    board = outline.board
    return board.ring is None and bool(board.threshold_sd_db or board.range_sd)


def _reach(possible: list[tuple["PossibleReading", ...]]) -> float:
    """Return a range slightly beyond all that are likely, m."""
    far = [one.range for readings in possible for one in readings if one.range and one.probability > _UNLIKELY]
    return 1.05 * max(far, default=1.0)


def _opacities(readings: tuple["PossibleReading", ...], middles: FloatArray) -> FloatArray:
    """Return the opacity of cells with these `middles` (m,), m: bells as high as their probability."""
    cell = middles[1] - middles[0]
    opacities = np.zeros(len(middles))
    for one in readings:
        if one.range is not None:
            away = (middles - one.range) / max(one.spread, cell)
            opacities += one.probability * np.exp(-(away**2) / 2)
    return np.asarray(np.minimum(opacities, 1.0))
