"""Prior of tolerated values. How far they are off is unknown, so several standard deviations are possible.

All walls have one standard deviation, the aperture another, and so on. It is the stated one or a fraction of it. Where
the scan shows no mismatch, the small ones are more probable, and the intervals of a fit stay narrow. Reflectances are
not among these values: a room file states measured walls and assumed reflectances, so theirs is the stated one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.values.parameters import Parameter
from sonarhw_compare.fit.values.quantities import REFLECTANCE

LEVELS = np.array([1.0, 0.3, 0.1, 0.02])  # of the stated standard deviation
PROBABILITIES = np.array([0.1, 0.1, 0.2, 0.6])  # of the levels


@dataclass(frozen=True)
class TolerancePrior:
    """Prior of t tolerated values in g groups: a mixture of normal distributions for each group."""

    rows: NDArray[np.intp]  # (t,), of the vector
    groups: FloatArray  # (g, t), 1 where a value belongs to a group
    middle: FloatArray  # (t,)
    widest: FloatArray  # (t,), standard deviations as stated

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return the logarithm of the density of vectors (m, size) relative to the widest normal one's middle, (m,)."""
        squares = (((values[:, self.rows] - self.middle) / self.widest) ** 2) @ self.groups.T
        logs = -0.5 * squares[:, :, None] / LEVELS**2 + self._weights
        most = logs.max(axis=2, keepdims=True)
        sums = most[:, :, 0] + np.log(np.exp(logs - most).sum(axis=2))
        return np.asarray(sums.sum(axis=1))

    @cached_property
    def _weights(self) -> FloatArray:
        """The logarithm of the weight of each level of each group, (g, levels)."""
        return np.asarray(np.log(PROBABILITIES) - self.groups.sum(axis=1)[:, None] * np.log(LEVELS))


def tolerance_prior(parameters: Sequence[Parameter]) -> TolerancePrior:
    """Return the prior of those parameters that are tolerated, without reflectances; a group for each quantity."""
    rows = [row for row, one in enumerate(parameters) if one.is_tolerated and one.quantity is not REFLECTANCE]
    quantities = list(dict.fromkeys(parameters[row].quantity for row in rows))
    groups = [[float(parameters[row].quantity is quantity) for row in rows] for quantity in quantities]
    return TolerancePrior(
        np.array(rows, dtype=np.intp),
        np.array(groups, dtype=np.float64).reshape(len(quantities), len(rows)),
        np.array([parameters[row].expected or 0.0 for row in rows]),
        np.array([parameters[row].deviation or 1.0 for row in rows]),
    )
