"""Silence: how well a prediction separates the headings at which a board hears nothing from the others.

The score of a heading is `PredictedScan.over_threshold`, the level of the loudest predicted echo over the threshold.
"""

from collections.abc import Sequence

import numpy as np

from sonarhw.readings import FloatArray


def roc_area(scores: FloatArray, sounding: Sequence[bool]) -> float | None:
    """Return the area under the ROC curve of scores (n,), the higher the surer of an echo; 0.5 is guessing.

    It is the share of pairs of a sounding and a silent heading in which the sounding one has the higher score; ties
    count half. None where no heading is silent, or all are.
    """
    heard = np.asarray(sounding, dtype=np.bool_)
    silent = np.sort(scores[~heard])
    if heard.all() or not heard.any():
        return None
    below, up_to = (np.searchsorted(silent, scores[heard], side) for side in ("left", "right"))
    return float((below + up_to).mean() / (2 * len(silent)))
