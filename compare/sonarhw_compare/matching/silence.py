"""Silence: how well a prediction tells the headings at which a board hears nothing from the others.

Takes a score for each heading, the higher the surer of an echo; hands on the area under the ROC curve. The score is
`PredictedScan.over_threshold`, the level of the loudest predicted echo over the threshold, from the prediction alone.
"""

from collections.abc import Sequence

import numpy as np

from sonarhw.readings import FloatArray


def roc_area(scores: FloatArray, sounding: Sequence[bool]) -> float | None:
    """The chance that a sounding heading has a higher score (n,) than a silent one, ties counting half; 0..1.

    That is the area under the ROC curve: Mann and Whitney's statistic over the number of pairs. 0.5 is guessing. None
    where no heading is silent, or all are.
    """
    heard = np.asarray(sounding, dtype=np.bool_)
    pairs = int(heard.sum()) * int((~heard).sum())
    if pairs == 0:
        return None
    # -inf, "nothing arrives", has a rank like any other; scipy.stats does the same, and takes half a second to load
    _, which, counts = np.unique(scores, return_inverse=True, return_counts=True)
    ranks = (np.cumsum(counts) - (counts - 1) / 2)[which]
    won = ranks[heard].sum() - heard.sum() * (heard.sum() + 1) / 2
    return float(won / pairs)
