"""Assignment of predicted echoes to all measured echoes of a reading, and statistics of the residuals.

Each predicted echo is used at most once, and the sum of the residuals is minimal (Hungarian method).
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from sonarhw.readings import FloatArray
from sonarhw_compare.matching.match import TOLERANCE, Comparison, Kind

_TO_DEVIATION = 1.4826  # standard deviation of a normal distribution by its median absolute deviation


@dataclass(frozen=True)
class AssignedEcho:
    """One measured echo and its predicted echo."""

    measured: float  # m, offset added
    predicted: float | None  # m; this and the next two are None without a predicted echo within 5 cm
    path: int | None  # row of the prediction's paths
    level_db: float | None

    @property
    def residual(self) -> float | None:
        """Measured minus predicted, m."""
        return None if self.predicted is None else self.measured - self.predicted


@dataclass(frozen=True)
class EchoStatistics:
    """Statistics of all measured echoes of a scan; readings of the carrier's own body are left out."""

    echoes: int
    explained: float | None  # share with a predicted echo; None without measured echoes
    bias_m: float | None  # median residual; this and the next are None if none is explained
    spread_m: float | None  # standard deviation, from the median absolute deviation


def assigned_echoes(comparison: Comparison, index: int) -> tuple[AssignedEcho, ...]:
    """Return every echo of reading `index`, nearest first, with its predicted echo."""
    measured = np.array(comparison.rows[index].reading.echo_ranges, dtype=np.float64) + comparison.offset
    echoes = comparison.prediction.ping(comparison.rows[index].index).echoes
    chosen = assigned(measured, np.array([echo.range for echo in echoes], dtype=np.float64))
    return tuple(
        AssignedEcho(float(distance), None, None, None)
        if at is None
        else AssignedEcho(float(distance), echoes[at].range, echoes[at].path, echoes[at].level_db)
        for distance, at in zip(measured, chosen, strict=True)
    )


def assigned(measured: FloatArray, predicted: FloatArray) -> list[int | None]:
    """Return for each of `measured` (m,) its row of `predicted` (p,); None without one within 5 cm, all in m."""
    apart = np.abs(measured[:, None] - predicted)
    # all costs beyond the tolerance are equal, so that they do not displace a pair within it
    rows, columns = linear_sum_assignment(np.minimum(apart, 2 * TOLERANCE))
    chosen: list[int | None] = [None] * len(measured)
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        if apart[row, column] <= TOLERANCE:
            chosen[row] = column
    return chosen


def echo_statistics(comparison: Comparison) -> EchoStatistics:
    """Return the statistics of all echoes of a scan."""
    of_room = [index for index, row in enumerate(comparison.rows) if row.kind is not Kind.OWN_BODY]
    echoes = [echo for index in of_room for echo in assigned_echoes(comparison, index)]
    residuals = np.array([echo.residual for echo in echoes if echo.residual is not None], dtype=np.float64)
    if not len(residuals):
        return EchoStatistics(len(echoes), 0.0 if echoes else None, None, None)
    bias = float(np.median(residuals))
    spread = float(_TO_DEVIATION * np.median(np.abs(residuals - bias)))
    return EchoStatistics(len(echoes), len(residuals) / len(echoes), bias, spread)
