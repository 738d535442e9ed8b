"""Which walls, levels or turntable the scan shows to be wrong, found one after the other.

The value is chosen that explains most if it alone is off. Further ones are added while they explain much more.
"""

from collections.abc import Sequence

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.values.parameters import Parameter
from sonarhw_compare.fit.values.warning_kinds import Mismatch

_CLEAR = 20.0  # smallest gain, chi-squared of one value, that is reported; by chance, 1 is expected
_SIMILAR = 6.0  # largest difference of the gains of values that the scan cannot tell apart
_MOST = 3


def shown_mismatches(
    tolerated: Sequence[Parameter], shifts: FloatArray, covariance: FloatArray
) -> tuple[Mismatch, ...]:
    """Return the values that a scan shows to be off, clearest first.

    `shifts` (t,) from the values of room and board, and `covariance` (t, t), are those of the posterior.
    """
    if not len(shifts):
        return ()
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    information = np.linalg.pinv(covariance / np.outer(scale, scale))
    pull = information @ (shifts / scale)
    chosen: list[int] = []
    others: list[tuple[str, ...]] = []
    while len(chosen) < min(_MOST, len(shifts)):
        gains = _gains(information, pull, chosen)
        best = int(gains.argmax())
        if gains[best] < _CLEAR:
            break
        similar = np.flatnonzero(gains > max(gains[best] - _SIMILAR, _CLEAR / 2))
        others.append(tuple(tolerated[row].name for row in similar.tolist() if row != best))
        chosen.append(best)
    among = information[np.ix_(chosen, chosen)]
    sizes, spreads = np.linalg.solve(among, pull[chosen]), np.sqrt(np.diag(np.linalg.inv(among)))
    return tuple(
        Mismatch(tolerated[row], float(size * scale[row]), float(spread * scale[row]), also)
        for row, size, spread, also in zip(chosen, sizes, spreads, others, strict=True)
    )


def _gains(information: FloatArray, pull: FloatArray, chosen: list[int]) -> FloatArray:
    """Return what each value alone explains, chi-squared (t,), if the chosen ones are already off; 0 for those."""
    across = information[:, chosen]
    known = np.linalg.solve(information[np.ix_(chosen, chosen)], np.column_stack((across.T, pull[chosen])))
    left = pull - across @ known[:, -1]
    stiffness = np.diag(information) - (across * known[:, :-1].T).sum(axis=1)
    gains = np.where(stiffness > 1e-9, left**2 / np.maximum(stiffness, 1e-9), 0.0)
    gains[chosen] = 0.0
    return np.asarray(gains)
