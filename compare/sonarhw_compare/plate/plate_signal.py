"""The signal that a board receives from a large flat plate, by the angle between transducer and plate.

The plate is perfect and endless, so that its echo is a single arrival: the image of the receiver in the plate.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from sonarhw_sim.air import Air, Receiver
from sonarhw_sim.board.beam import beam_gain
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.receiver import charge_of_burst, kept_charge
from sonarhw_sim.board.signal import RATE, Arrivals, before_gain, burst_of, gain_at_samples, pulses, uncompensated_db

from sonarhw.readings import FloatArray

WIDEST = math.radians(45.0)  # between transducer and plate; beyond, echoes are not used
_STEP = math.radians(0.25)
_ANGLES = np.arange(-round(WIDEST / _STEP), round(WIDEST / _STEP) + 1, dtype=np.float64) * _STEP
FAINTEST_DB = -80.0  # lower end of levels; the nulls of a beam have none
_KEPT = 64  # plates whose levels are cached


@dataclass(frozen=True)
class PlateLevels:
    """Levels of a plate's echo by angle; 0 dB is a perfect wall straight ahead after the ideal gain."""

    angles: FloatArray  # (n,), rad, increasing; from the perpendicular of the plate to the heading
    peaks: FloatArray  # (n,), dB, of the envelope after the gain
    detected: FloatArray  # (n,), dB, as the detector compares it with the threshold

    def peaks_at(self, angles: FloatArray) -> FloatArray:
        """Return the levels of the peak at `angles` (rad), dB, same shape."""
        return np.asarray(np.interp(angles, self.angles, self.peaks))

    def detected_at(self, angles: FloatArray) -> FloatArray:
        """Return the levels at the detector at `angles` (rad), dB, same shape."""
        return np.asarray(np.interp(angles, self.angles, self.detected))

    def slopes_at(self, angles: FloatArray) -> FloatArray:
        """Return the change of `detected_at` with the angle, dB/rad, same shape."""
        return np.asarray(np.interp(angles, self.angles, self._slopes))

    @cached_property
    def _slopes(self) -> FloatArray:
        return np.asarray(np.gradient(self.detected, self.angles))


@dataclass(frozen=True)
class PlateEnvelopes:
    """Envelopes of a plate's echo after the gain, one row for each angle."""

    times: FloatArray  # (n, k), s since the start of transmission
    samples: FloatArray  # (n, k); 1 is a perfect wall straight ahead after the ideal gain


def plate_levels(board: Board, speed_of_sound: float, distance: float) -> PlateLevels:
    """Return the levels of a plate at `distance` m from the face when it points straight at the plate."""
    # a fit tries many thresholds, on which no level depends
    return _levels(replace(board, threshold_db=0.0), speed_of_sound, distance)


@lru_cache(maxsize=_KEPT)
def _levels(board: Board, speed_of_sound: float, distance: float) -> PlateLevels:
    computed = _computed_angles(board)
    # likewise, the gain acts on pulses that do not depend on its steps
    pulse = _kept_pulses(replace(board, gain_step_db=0.0), speed_of_sound, distance)
    envelopes = pulse.sizes * _gain(pulse, board)
    peaks = _decibels(envelopes.max(axis=1))
    if board.receiver is Receiver.BOARD:
        kept = kept_charge(board)
        charges = lfilter([1.0 - kept], [1.0, -kept], envelopes, axis=1).max(axis=1)
        detected = _decibels(charges / charge_of_burst(board, speed_of_sound))
    else:
        detected = _carrier_levels(board, speed_of_sound, distance, computed)
    if len(computed) < len(_ANGLES):
        peaks, detected = (np.concatenate((one[:0:-1], one)) for one in (peaks, detected))
    return PlateLevels(_ANGLES, peaks, detected)


def _computed_angles(board: Board) -> FloatArray:
    """Return the angles to compute, rad: from 0 on if those to the left have the same levels, else all."""
    return _ANGLES if board.mount.aside else _ANGLES[len(_ANGLES) // 2 :]


def plate_envelopes(board: Board, speed_of_sound: float, distance: float, angles: FloatArray) -> PlateEnvelopes:
    """Return the envelopes at `angles` (n,) rad from the perpendicular of the plate to the heading."""
    pulse = _pulses(board, speed_of_sound, distance, angles)
    return PlateEnvelopes(pulse.at / RATE, pulse.sizes * _gain(pulse, board))


@dataclass(frozen=True)
class _Pulses:
    """Envelopes before the gain, one row for each angle."""

    at: NDArray[np.intp]  # (n, k), numbers of the samples
    sizes: FloatArray  # (n, k)


@lru_cache(maxsize=_KEPT // 2)
def _kept_pulses(board: Board, speed_of_sound: float, distance: float) -> _Pulses:
    return _pulses(board, speed_of_sound, distance, _computed_angles(board))


def _pulses(board: Board, speed_of_sound: float, distance: float, angles: FloatArray) -> _Pulses:
    arrivals = _arrivals(board, speed_of_sound, distance, angles)
    signals, first = pulses(
        before_gain(arrivals, board, speed_of_sound, board.receiver),
        board,
        burst_of(board, speed_of_sound),
        speed_of_sound,
    )
    return _Pulses(np.maximum(first[:, None] + np.arange(signals.shape[1]), 0), np.abs(signals))


def _gain(pulse: _Pulses, board: Board) -> FloatArray:
    """Return the gain at each sample, (n, k)."""
    return np.asarray(gain_at_samples(int(pulse.at.max()) + 1, board, board.receiver)[pulse.at])


def echo_times(board: Board, speed_of_sound: float, distance: float, angles: FloatArray) -> FloatArray:
    """Return the time of arrival at `angles` (n,) rad, s, (n,)."""
    return _arrivals(board, speed_of_sound, distance, angles).times


def _arrivals(board: Board, speed_of_sound: float, distance: float, angles: FloatArray) -> Arrivals:
    """Return the arrival at each angle: the straight line from the sender to the image of the receiver."""
    senders, receivers = board.mount.positions(angles)
    images = np.column_stack((2 * (distance + board.mount.ahead) - receivers[:, 0], receivers[:, 1]))
    ways = images - senders
    lengths = np.hypot(ways[:, 0], ways[:, 1])
    headings = np.column_stack((np.cos(angles), np.sin(angles)))
    leaving = (ways * headings).sum(axis=1) / lengths
    # the way back, seen from the receiver, is the way there reflected in the plate
    arriving = (ways * (1.0, -1.0) * headings).sum(axis=1) / lengths
    air = _air(speed_of_sound)
    return Arrivals(lengths / speed_of_sound, 10 ** (-uncompensated_db(lengths, board, air) / 20), leaving, arriving)


def _carrier_levels(board: Board, speed_of_sound: float, distance: float, angles: FloatArray) -> FloatArray:
    """Return the levels at the detector of the paper's receiver, which weighs the carrier alone, (n,) dB."""
    arrivals, air = _arrivals(board, speed_of_sound, distance, angles), _air(speed_of_sound)
    ka = board.wavenumber(air) * board.aperture_radius
    beams = [beam_gain(np.arccos(np.clip(one, -1, 1)), ka) for one in (arrivals.leaving, arrivals.arriving)]
    return _decibels(np.abs(arrivals.amplitudes) * beams[0] * beams[1])


def _air(speed_of_sound: float) -> Air:
    """Return air of 50 % humidity with this speed of sound; 20 °C if no temperature has it."""
    temperature = Air().temperature_at(speed_of_sound)
    return Air() if temperature is None else Air(temperature)


def _decibels(amplitudes: FloatArray) -> FloatArray:
    return np.asarray(20 * np.log10(np.maximum(amplitudes, 10 ** (FAINTEST_DB / 20))))
