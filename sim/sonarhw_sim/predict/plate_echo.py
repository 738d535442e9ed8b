"""The echo of a flat plate straight ahead: the arc over which a board detects it, and the delay of its detection."""

import math
from dataclasses import dataclass

import numpy as np

from sonarhw.readings import FloatArray
from sonarhw_sim.air import Air
from sonarhw_sim.board.first_echo import Sound, first_echoes
from sonarhw_sim.board.gain import uncompensated_db
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.transducer import beam_gain
from sonarhw_sim.board.weighing import BoolArray
from sonarhw_sim.choices import Receiver

_ANGLES = np.linspace(0.0, math.pi / 2, 1801)  # rad from the axis, 0.05° apart
_MIDDLE = 0.5  # share of the arc in which a calibration measures the range
_LATE = 0.004  # m; a calibration takes ranges that exceed those of the middle by more for those of a rim


@dataclass(frozen=True)
class PlateEcho:
    """The echo of a large plate in the main lobe."""

    arc: float  # rad, width of the arc over which the plate is detected; 0: it is not detected
    early_arc: float  # rad, the same without the ends, where faint echoes are detected late
    delay: float  # m, range in the middle of the arc minus distance; 0 without an arc


def plate_echo(board: Board, air: Air, distance: float, stronger_db: float = 0.0) -> PlateEcho:
    """Return the echo of a plate at `distance` m, by `stronger_db` louder than that of a perfect plate."""
    level = stronger_db - float(uncompensated_db(np.array([2 * distance]), board, air)[0])
    delays = (_delays if board.receiver is Receiver.BOARD else _no_delays)(board, air, distance, level)
    arc = _before_first(np.isnan(delays))
    if arc == 0:
        return PlateEcho(0.0, 0.0, 0.0)
    delay = float(np.median(delays[: max(1, round(_MIDDLE * arc))]))
    early = _before_first(~(delays <= delay + _LATE))
    return PlateEcho(2 * float(_ANGLES[arc]), 2 * float(_ANGLES[early]), delay)


def _no_delays(board: Board, air: Air, _distance: float, level: float) -> FloatArray:
    """Return 0 at each angle where the paper's receiver detects the plate, NaN elsewhere, (n,) m."""
    beam = beam_gain(_ANGLES, board.wavenumber(air) * board.aperture_radius)
    levels = level + 40 * np.log10(np.maximum(beam, 1e-9))
    return np.where(levels < board.threshold_db, np.nan, 0.0)


def _delays(board: Board, air: Air, distance: float, level: float) -> FloatArray:
    """Return the delay at each angle where the board's own receiver detects the plate, NaN elsewhere, (n,) m."""
    speed, ahead = air.speed_of_sound, np.array([[1.0, 0.0]])
    loudness = np.array([10 ** (level / 20)], dtype=np.complex128)
    sound = Sound(np.array([2 * distance / speed]), loudness, ahead, ahead, np.empty((0, 0), np.bool_))
    times, paths = first_echoes(_ANGLES, sound, board, speed)
    return np.where(paths == 0, times * speed / 2 - distance, np.nan)


def _before_first(ends: BoolArray) -> int:
    """Return the row of the first true value, else of the last value."""
    return int(ends.argmax()) if ends.any() else len(ends) - 1
