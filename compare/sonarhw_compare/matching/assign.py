"""Assignment: which predicted echo each echo of a reading is, the later ones of a multi-echo reading as well.

Takes a comparison; hands on pairs of measured and predicted echoes, and figures over all of them. No predicted echo
answers for two measured ones, and together they lie as near as they can (Hungarian method).
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from sonarhw.readings import FloatArray
from sonarhw_compare.matching.match import TOLERANCE, Comparison

_TO_DEVIATION = 1.4826  # a normal's standard deviation over its median absolute deviation


@dataclass(frozen=True)
class AssignedEcho:
    """One measured echo and the predicted one that it is."""

    measured: float  # m, offset added
    predicted: float | None  # m; None, as are the others: no predicted echo is left within 5 cm
    path: int | None  # row of the prediction's paths
    level_db: float | None

    @property
    def residual(self) -> float | None:
        """Measured less predicted, m."""
        return None if self.predicted is None else self.measured - self.predicted


@dataclass(frozen=True)
class EchoStatistics:
    """Figures over every measured echo of a scan."""

    echoes: int
    explained: float | None  # share of them that is a predicted echo; None where nothing was measured
    bias_m: float | None  # median residual; None, as is the next, where none is explained
    spread_m: float | None  # median absolute deviation from that, as a normal's standard deviation


def assigned_echoes(comparison: Comparison, index: int) -> tuple[AssignedEcho, ...]:
    """Every echo of reading `index`, nearest first, with the predicted echo that it is."""
    measured = np.array(comparison.rows[index].reading.echo_ranges, dtype=np.float64) + comparison.offset
    heard = comparison.prediction.echoes(comparison.rows[index].index)
    chosen = assigned(measured, np.array([echo.range for echo in heard], dtype=np.float64))
    return tuple(
        AssignedEcho(float(told), None, None, None)
        if at is None
        else AssignedEcho(float(told), heard[at].range, heard[at].path, heard[at].level_db)
        for told, at in zip(measured, chosen, strict=True)
    )


def assigned(measured: FloatArray, predicted: FloatArray, gate: float = TOLERANCE) -> list[int | None]:
    """For each of `measured` (m,) the row of `predicted` (p,) that it is; None where none is left within `gate`."""
    apart = np.abs(measured[:, None] - predicted)
    # beyond the gate all are alike, so that none pulls a pair from within it
    rows, columns = linear_sum_assignment(np.minimum(apart, 2 * gate))
    chosen: list[int | None] = [None] * len(measured)
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        if apart[row, column] <= gate:
            chosen[row] = column
    return chosen


def echo_statistics(comparison: Comparison) -> EchoStatistics:
    """The figures of all echoes of a scan."""
    echoes = [echo for index in range(len(comparison.rows)) for echo in assigned_echoes(comparison, index)]
    residuals = np.array([echo.residual for echo in echoes if echo.residual is not None], dtype=np.float64)
    if not len(residuals):
        return EchoStatistics(len(echoes), 0.0 if echoes else None, None, None)
    bias = float(np.median(residuals))
    spread = float(_TO_DEVIATION * np.median(np.abs(residuals - bias)))
    return EchoStatistics(len(echoes), len(residuals) / len(echoes), bias, spread)
