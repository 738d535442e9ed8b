"""The threshold of the sensor of a draft, from the likelihood of the readings: of a population, the scans show one."""

import math
from dataclasses import replace

import numpy as np
from scipy.special import softmax

from sonarhw_compare.matching.regions import mean_run
from sonarhw_compare.room_finding.draft import RoomDraft
from sonarhw_compare.room_finding.evidence import ROUGH, Evidence, Scored, all_scored

_STEPS = (2.0, 1.0, 0.5)  # dB, in turn, of the threshold that is searched
_BESIDE = np.arange(-6.0, 7.0)  # dB from the found threshold, at which its probability is computed
_LEAST = 0.5  # dB, least standard deviation


def with_threshold(evidence: Evidence, best: Scored) -> Scored:
    """Return the draft with the threshold that explains most, up to 3.5 dB from the present one.

    If the profile states no spread of the threshold, it is exact.
    """
    for step in _STEPS if evidence.threshold_spread > 0 else ():
        now = best.draft.threshold_db
        tried = [replace(best.draft, threshold_db=now + by) for by in (step, -step)]
        best = max([best, *all_scored(evidence, tried)], key=lambda one: one.score)
    return best


def threshold_deviation(evidence: Evidence, draft: RoomDraft) -> float | None:
    """Return the standard deviation of the threshold of a draft, dB; None if the profile states that it is exact.

    Neighbouring readings of one echo count as one.
    """
    if evidence.threshold_spread == 0:
        return None
    drafts = [replace(draft, threshold_db=draft.threshold_db + by) for by in _BESIDE.tolist()]
    likelihoods = np.zeros(len(drafts))
    for row, one in enumerate(drafts):
        for problem, readings in zip(evidence.problems, evidence.by_reading(one, ROUGH), strict=True):
            arrays = problem.scans[0]
            likelihoods[row] += readings.sum() / mean_run(arrays.angles, arrays.ranges[:, 0])
    weights = softmax(likelihoods + [evidence.log_prior(one) for one in drafts])
    mean = float(weights @ _BESIDE)
    return math.hypot(math.sqrt(float(weights @ (_BESIDE - mean) ** 2)), _LEAST)
