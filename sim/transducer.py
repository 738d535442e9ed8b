"""The transducer: how much sound leaves it, and is heard by it, away from its axis.

Takes angles from the axis; hands on amplitude ratios. One way; a reading pays it on departure and on arrival.
"""

import numpy as np
from scipy.special import j1

from sonarhw.readings import FloatArray


def beam_gain(angles: FloatArray, ka: float) -> FloatArray:
    """Amplitude at `angles` (rad) from the axis relative to straight ahead, one way, 0..1, same shape.

    A disc of radius a at wavenumber k: |2 J₁(x)/x| cos α with x = ka sin α; nothing at 90° and beyond. It is the
    carrier's part of Kuc and Siegel's h_R, whose integral is cos α (Kuc and Siegel 1987; CIM-92-9 eq. 1).
    """
    cosine = np.cos(angles)
    x = ka * np.sin(angles)
    safe = np.where(np.abs(x) < 1e-8, 1.0, x)
    disc = np.where(np.abs(x) < 1e-8, 1.0, np.abs(2 * j1(safe) / safe))
    return np.asarray(np.where(cosine > 0, disc * cosine, 0.0))
