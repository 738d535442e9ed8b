"""Evaluation of predicted silence: how well predicted levels separate headings without an echo from the others.

The score of a heading is `PredictedScan.over_threshold`, the level of the loudest predicted echo over the threshold.
"""

from collections.abc import Sequence

import numpy as np

from sonarhw.readings import FloatArray


def roc_area(scores: FloatArray, sounding: Sequence[bool]) -> float | None:
    """Return the area under the ROC curve of scores (n,); a higher score predicts an echo, and 0.5 is chance.

    Consider all pairs of a heading with an echo and one without. The area is the share of pairs in which the heading
    with an echo has the higher score; ties count half. None if all headings are of one kind.
    """
    echo = np.asarray(sounding, dtype=np.bool_)
    silent = np.sort(scores[~echo])
    if echo.all() or not echo.any():
        return None
    below, up_to = (np.searchsorted(silent, scores[echo], side) for side in ("left", "right"))
    return float((below + up_to).mean() / (2 * len(silent)))
