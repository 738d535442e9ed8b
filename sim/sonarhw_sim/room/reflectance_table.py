"""Reflectance of a material by angle of incidence and frequency."""

from dataclasses import dataclass

import numpy as np

from sonarhw.readings import FloatArray


@dataclass(frozen=True)
class ReflectanceTable:
    """Values at every combination of some angles and frequencies; between them, they change evenly."""

    angles: FloatArray  # (a,), rad from the perpendicular, increasing
    frequencies: FloatArray  # (f,), Hz, increasing
    values: FloatArray  # (a, f), amplitude ratios

    @property
    def largest(self) -> float:
        """The largest value."""
        return float(self.values.max())

    def at(self, angles: FloatArray, frequencies: FloatArray) -> FloatArray:
        """Return the reflectance at `angles` (k,) rad and `frequencies` (m,) Hz, (k, m).

        Beyond its ends, the table continues with its last values.
        """
        by_angle = np.array([np.interp(angles, self.angles, column) for column in self.values.T])
        return np.array([np.interp(frequencies, self.frequencies, one) for one in by_angle.T]).reshape(
            len(angles), len(frequencies)
        )
