"""Shading of the ranges that a board may report: the more opaque, the more probable."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from sonarhw_sim.air import ROOM_TOLERANCE
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.predict.probability import PossibleReading, possible_readings, scan_with_fainter_paths

from sonarhw.readings import FloatArray

_CELLS = 400  # along the range
_UNLIKELY = 0.02  # less probable ranges may be beyond the image
_COLUMNS = 360  # headings in a picture


@dataclass(frozen=True)
class RangeShading:
    """Opacities by heading and range; at the middle of a possible echo, the opacity is its probability."""

    headings: FloatArray  # (n,), rad, evenly spaced all round
    opacities: FloatArray  # (n, m), 0 to 1; columns are cells of range from 0 up to `reach`
    reach: float  # m


def shading_around(
    prediction: PredictedScan,
    options: PredictionOptions | None = None,
    *,
    pings: int = 1,
    room_tolerance: float = ROOM_TOLERANCE,
) -> RangeShading:
    """Return the shading all round the sensor of a prediction with `options`.

    Readings are medians of an odd number of `pings`. `room_tolerance` (m) is the standard deviation of the position of
    each wall. Raises InputError.
    """
    headings = np.arange(_COLUMNS) * 2 * np.pi / _COLUMNS
    scan = scan_with_fainter_paths(prediction.room, prediction.place, prediction.board, headings, options)
    return shading_of([possible_readings(scan, index, pings, room_tolerance) for index in range(_COLUMNS)], headings)


def shading_of(possible: Sequence[Sequence[PossibleReading]], headings: FloatArray) -> RangeShading:
    """Return the shading of the possible readings at each of `headings` (n,), rad, evenly spaced all round."""
    far = [one.range for readings in possible for one in readings if one.range and one.probability > _UNLIKELY]
    reach = 1.05 * max(far, default=1.0)  # slightly beyond all that are likely
    middles = (np.arange(_CELLS) + 0.5) * reach / _CELLS
    return RangeShading(headings, np.array([_opacities(readings, middles) for readings in possible]), reach)


def _opacities(readings: Sequence[PossibleReading], middles: FloatArray) -> FloatArray:
    """Return the opacity of cells with these `middles` (m,), m: bells as high as their probability."""
    cell = middles[1] - middles[0]
    opacities = np.zeros(len(middles))
    for one in readings:
        if one.range is not None:
            away = (middles - one.range) / max(one.spread, cell)
            opacities += one.probability * np.exp(-(away**2) / 2)
    return np.asarray(np.minimum(opacities, 1.0))
