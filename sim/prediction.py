"""The prediction: what the board would report at each heading, and by which path.

Takes the paths of a place, a board and headings; hands on a `PredictedScan`, which still knows every echo. Paths are
found once for a whole scan; here they are only weighed by the transducer and held against blanking, threshold, range.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sim.board import Board
from sim.paths import MAX_BOUNCES, RAYS, SLACK, Paths, PathSearch, find_paths
from sim.room import Place, Room
from sim.sequences import BoolArray
from sim.transducer import beam_gain
from sonarhw.readings import FloatArray

# Fainter than this under the threshold, a path is not noticed: of those a room has, nine in ten never are. dB
NOTICED_BELOW_THRESHOLD = 20.0
_BLOCK = 256  # headings weighed at a time, so that long scans need no more memory than what they keep


class Unit(StrEnum):
    """What the transducer's own body does to sound that passes it."""

    PASS = "pass"  # nothing: it is small, the front closes round it
    BLOCK = "block"  # sound that meets its face ends there


@dataclass(frozen=True)
class Echo:
    """One audible arrival at one heading."""

    path: int  # row in the scan's paths
    range: float  # m, as the board would report it
    level_db: float  # at the threshold's input, relative to a perfect wall straight ahead


@dataclass(frozen=True)
class PredictedScan:
    """What a board would report from one place."""

    room: Room
    place: Place
    board: Board
    headings: FloatArray  # (n,), rad in the room
    paths: Paths
    levels: FloatArray  # (n, p) dB of every path at every heading; -inf where nothing arrives
    loud: BoolArray  # (n, p): over the threshold and within range, blanked or not

    @property
    def blanked(self) -> BoolArray:
        """Which paths arrive while the board cannot hear, (p,) bool."""
        return np.asarray(self.paths.lengths / 2 < self.board.blanked_range(self.room.air))

    @property
    def first(self) -> NDArray[np.intp]:
        """The path that wins at each heading, (n,) int; -1: no echo."""
        heard = self.loud & ~self.blanked
        return np.where(heard.any(axis=1), heard.argmax(axis=1), -1) if len(self.paths) else self._silent()

    def _silent(self) -> NDArray[np.intp]:
        return np.full(len(self.headings), -1, dtype=np.intp)

    @property
    def ranges(self) -> FloatArray:
        """Reported range at each heading, (n,) float, m; NaN where there is no echo."""
        # row -1, "no echo", picks the appended NaN
        return self.board.reported(np.append(self.paths.lengths, np.nan)[self.first] / 2)

    def echoes(self, index: int) -> tuple[Echo, ...]:
        """Everything the board could hear at heading `index`, earliest first; the first is what it reports."""
        return tuple(self._echo(index, int(path)) for path in np.flatnonzero(self.loud[index] & ~self.blanked))

    def blanked_echoes(self, index: int) -> tuple[Echo, ...]:
        """What would be loud enough at heading `index` but arrives within blanking, earliest first."""
        return tuple(self._echo(index, int(path)) for path in np.flatnonzero(self.loud[index] & self.blanked))

    def _echo(self, index: int, path: int) -> Echo:
        distance = self.board.reported(self.paths.lengths[path] / 2)
        return Echo(path, float(distance), float(self.levels[index, path]))


@dataclass(frozen=True)
class PredictionOptions:
    """How to follow the sound; the defaults are those of every command."""

    unit: Unit = Unit.PASS
    max_bounces: int = MAX_BOUNCES
    diffraction: bool = True
    rays: int = RAYS


def predict_scan(
    room: Room, place: Place, board: Board, headings: FloatArray, options: PredictionOptions | None = None
) -> PredictedScan:
    """What `board` would report from `place` at `headings` (n,) rad in the room."""
    options = options or PredictionOptions()
    search = PathSearch(
        2 * board.max_range, board.wavelength(room.air), options.max_bounces, options.diffraction, options.rays
    )
    paths = find_paths(room, place.position, search)
    return weigh_paths(room, place, board, headings, paths, options.unit)


def weigh_paths(
    room: Room, place: Place, board: Board, headings: FloatArray, paths: Paths, unit: Unit = Unit.PASS
) -> PredictedScan:
    """The scan that known paths give at `headings` (n,) rad; paths too faint to notice at all of them are left out."""
    headings = np.asarray(headings, dtype=np.float64)
    blocks = [headings[k : k + _BLOCK] for k in range(0, len(headings), _BLOCK)]
    faintest = board.threshold_db - NOTICED_BELOW_THRESHOLD
    noticed = np.zeros(len(paths), dtype=np.bool_)
    for block in blocks:
        noticed |= (_levels(room, place, board, block, paths, unit) >= faintest).any(axis=0)
    paths = paths.select(np.flatnonzero(noticed))
    levels = np.empty((len(headings), len(paths)))
    for k, block in enumerate(blocks):
        levels[k * _BLOCK :][: len(block)] = _levels(room, place, board, block, paths, unit)
    loud = (levels >= board.threshold_db) & (paths.lengths <= 2 * board.max_range + SLACK)
    return PredictedScan(room, place, board, headings, paths, levels, loud)


def _levels(room: Room, place: Place, board: Board, headings: FloatArray, paths: Paths, unit: Unit) -> FloatArray:
    amplitudes = path_amplitudes(room, board, headings, paths)
    if unit is Unit.BLOCK:
        amplitudes[_meets_unit(paths, place, headings, board.aperture_radius)] = 0.0
    with np.errstate(divide="ignore"):
        return np.asarray(20 * np.log10(amplitudes))


def path_amplitudes(room: Room, board: Board, headings: FloatArray, paths: Paths) -> FloatArray:
    """Amplitude of every path at every heading relative to a perfect wall straight ahead, (n, p) float.

    Reflectances, edges and curvature, the beam on departure and arrival, and what air takes beyond the ideal gain.
    """
    ka = board.wavenumber(room.air) * board.aperture_radius
    air = 10 ** (-board.excess_absorption(room.air) * paths.lengths / 20)
    leaving = beam_gain(headings[:, None] - paths.departures, ka)
    arriving = beam_gain(headings[:, None] - paths.arrivals, ka)
    return np.asarray(leaving * arriving * (paths.gains * air))


def _meets_unit(paths: Paths, place: Place, headings: FloatArray, half_width: float) -> BoolArray:
    """Which paths run into the transducer's face on their way, at each heading, (n, p) bool."""
    meets = np.zeros((len(headings), len(paths)), dtype=np.bool_)
    legs = paths.points - np.array(place.position)
    across = np.column_stack((-np.sin(headings), np.cos(headings)))
    for path in range(len(paths)):
        corners = legs[path][~np.isnan(legs[path, :, 0])]
        # the first leg leaves the face and the last ends on it
        for start, end in pairwise(corners[1:-1]):
            if _nearest(start, end) <= half_width:
                meets[:, path] |= _crosses(start, end, across, half_width)
    return meets


def _nearest(start: FloatArray, end: FloatArray) -> float:
    leg = end - start
    share = min(max(-float(start @ leg) / max(float(leg @ leg), 1e-300), 0.0), 1.0)
    return math.hypot(*(start + share * leg))


def _crosses(start: FloatArray, end: FloatArray, across: FloatArray, half_width: float) -> BoolArray:
    """Whether a leg crosses the segment ±half_width along each of `across` (n, 2) through the origin, (n,) bool."""
    leg = end - start
    denominator = leg[0] * across[:, 1] - leg[1] * across[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along_leg = -(start[0] * across[:, 1] - start[1] * across[:, 0]) / denominator
        along_face = (start[0] * leg[1] - start[1] * leg[0]) / denominator
    return np.asarray((denominator != 0) & (along_leg >= 0) & (along_leg <= 1) & (np.abs(along_face) <= half_width))
