"""Weighing: how loud each path is at a heading, and which of them is heard first.

Takes paths as plain arrays, directions as unit vectors; hands on amplitudes relative to a perfect wall straight ahead.
Compiled by numba, because a scan weighs every path at every heading. The beam comes from a table between whose nodes
a cubic runs that is right to 10⁻⁹ (`sonarhw_sim.board.transducer.beam_gain` is the closed form).
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import j1, jv

from sonarhw.readings import FloatArray
from sonarhw_sim.board.transducer import beam_gain
from sonarhw_sim.compiled import compiled

BoolArray = NDArray[np.bool_]

_NODES_PER_UNIT = 32  # of x = ka sin α
_SEPARATIONS = 721  # angles between departure and arrival at which the loudest heading is sought


@lru_cache(maxsize=16)
def beam_table(ka: float) -> FloatArray:
    """Values and slopes of 2 J₁(x)/x at x = 0, 1/32, 2/32, ... beyond ka, (n, 2) float."""
    x = np.arange(math.ceil(ka * _NODES_PER_UNIT) + 2) / _NODES_PER_UNIT
    x[0] = 1.0
    table = np.column_stack((2 * j1(x) / x, -2 * jv(2, x) / x))
    table[0] = 1.0, 0.0
    table.flags.writeable = False
    return table


@lru_cache(maxsize=16)
def loudest_by_separation(ka: float) -> FloatArray:
    """The most that both beams together leave of a path at any heading, by the angle between departure and arrival.

    (721,) float for angles of 0 to π; what a path loses at its best heading, so that hopeless ones can be dropped.
    """
    one = beam_gain(np.linspace(-math.pi / 2, math.pi / 2, 2 * _SEPARATIONS - 1), ka)
    # the other is the same, turned by two steps for each separation; beyond 90° there is nothing
    other = np.concatenate((one, np.zeros(len(one))))
    return np.array([float((one * other[2 * turn : 2 * turn + len(one)]).max()) for turn in range(_SEPARATIONS)])


@compiled
def disc(x: float, table: FloatArray) -> float:
    """2 J₁(x)/x with its sign, for x from 0 to as far as the table goes."""
    x *= _NODES_PER_UNIT
    node = int(x)
    t = x - node
    low, high = table[node], table[node + 1]
    step = 1.0 / _NODES_PER_UNIT
    value: float = (
        (1.0 + 2.0 * t) * (1.0 - t) * (1.0 - t) * low[0]
        + t * (1.0 - t) * (1.0 - t) * step * low[1]
        + t * t * (3.0 - 2.0 * t) * high[0]
        + t * t * (t - 1.0) * step * high[1]
    )
    return value


@compiled
def beam(cosine: float, ka: float, table: FloatArray) -> float:
    """Amplitude one way at the angle of that cosine from the axis: |2 J₁(x)/x| cos α, 0 from 90° on."""
    if cosine <= 0.0:
        return 0.0
    amplitude: float = abs(disc(ka * math.sqrt(max(0.0, 1.0 - cosine * cosine)), table)) * cosine
    return amplitude


@compiled
def amplitudes_at(
    heading: float, leaving: FloatArray, arriving: FloatArray, strengths: FloatArray, ka: float, table: FloatArray
) -> FloatArray:
    """Amplitude of every path at a heading (rad), (p,).

    `leaving` and `arriving` (p, 2) are the horizontal parts of the unit vectors along which a path departs and from
    which it comes back; `strengths` (p,) what is left of it before the beam.
    """
    x, y = math.cos(heading), math.sin(heading)
    amplitudes = np.empty(strengths.shape[0])
    for path in range(strengths.shape[0]):
        out = beam(leaving[path, 0] * x + leaving[path, 1] * y, ka, table)
        back = beam(arriving[path, 0] * x + arriving[path, 1] * y, ka, table)
        amplitudes[path] = out * back * strengths[path]
    return amplitudes


@compiled
def first_detected(
    headings: FloatArray,
    leaving: FloatArray,
    arriving: FloatArray,
    strengths: FloatArray,
    points: FloatArray,
    face: float,
    threshold: float,
    ka: float,
    table: FloatArray,
) -> NDArray[np.intp]:
    """The first path over `threshold` (amplitude) at each heading, in the order given, (n,) int; -1: none.

    `points` (p, k, 2) are their corners relative to the sensor, NaN behind; where `face` (m) is over 0, the face of
    the transducer, so far to each side, ends sound that runs into it.
    """
    heard = np.full(headings.shape[0], -1, np.intp)
    for k in range(headings.shape[0]):
        x, y = math.cos(headings[k]), math.sin(headings[k])
        for path in range(strengths.shape[0]):
            if strengths[path] < threshold:
                continue
            level = beam(leaving[path, 0] * x + leaving[path, 1] * y, ka, table) * strengths[path]
            if level < threshold:
                continue
            level *= beam(arriving[path, 0] * x + arriving[path, 1] * y, ka, table)
            if level >= threshold and level > 0.0 and not (face > 0.0 and meets_face(points[path], x, y, face)):
                heard[k] = path
                break
    return heard


@compiled
def meets_face(corners: FloatArray, x: float, y: float, half_width: float) -> bool:
    """Whether a path, corners (k, 2) relative to the sensor, runs into the face of a transducer that points along x, y.

    The first leg leaves the face and the last ends on it: they are not asked.
    """
    last = corners.shape[0] - 1
    while last > 0 and math.isnan(corners[last, 0]):
        last -= 1
    for k in range(1, last - 1):
        # ahead of the face, and aside along it
        ahead, ahead_next = corners[k, 0] * x + corners[k, 1] * y, corners[k + 1, 0] * x + corners[k + 1, 1] * y
        if ahead == ahead_next or ahead * ahead_next > 0.0:
            continue
        aside, aside_next = corners[k, 1] * x - corners[k, 0] * y, corners[k + 1, 1] * x - corners[k + 1, 0] * y
        if abs(aside + (aside_next - aside) * ahead / (ahead - ahead_next)) <= half_width:
            return True
    return False


@compiled
def all_meeting_face(points: FloatArray, heading: float, half_width: float) -> BoolArray:
    """`meets_face` of every path at one heading, (p,) bool."""
    meets = np.empty(points.shape[0], np.bool_)
    for path in range(points.shape[0]):
        meets[path] = meets_face(points[path], math.cos(heading), math.sin(heading), half_width)
    return meets
