"""The objective of a fit: log-likelihood of all scans and what is known beforehand, as a function of plain numbers.

Takes scans, room, board and free parameters; hands on `Problem`, and near any values an `Objective`: paths are searched
there once and then moved (`echo_paths`), so that it costs a fraction of a millisecond. Its argument is one
vector: the parameters, and behind them the numbers that say how readings err (`NOISES`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from sonarhw_sim.air import Air
from sonarhw_sim.board.gain import uncompensated_db
from sonarhw_sim.board.profile import Board
from sonarhw_sim.board.weighing import beam_table
from sonarhw_sim.choices import Receiver
from sonarhw_sim.predict.levels import loud_enough
from sonarhw_sim.predict.prediction import PredictionOptions, search_for
from sonarhw_sim.room.model import Place, Room
from sonarhw_sim.vertical.sections import paths_from

from sonarhw.readings import FloatArray, Reading
from sonarhw_compare.fit.likelihood.echo_likelihood import Ear, Heard, Known, Noise, log_likelihoods
from sonarhw_compare.fit.likelihood.echo_paths import EchoPaths, echo_paths, moved
from sonarhw_compare.fit.likelihood.lateness import lateness_by_level, level_offset_db
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.fit.values.given_twice import check_given_once
from sonarhw_compare.fit.values.parameters import Parameter, applied, start_of
from sonarhw_compare.fit.values.quantities import (
    REFLECTANCE,
    WALL,
    AirQuantity,
    BoardQuantity,
    PlaceQuantity,
    reflectance_of,
)

MOST_ECHOES = 5  # of a ping, that scanners tell
_ROUNDED = 1 / math.sqrt(12)  # standard deviation of what is rounded to 1
# A path 10 dB under the threshold at its best heading is heard by no fit's board; `loud_enough` asks for 20. dB
_LESS_NOTICED = 10.0
_OVERLAPPING = 1.0  # dB, by which levels err at least where echoes that overlap are taken for lone ones


@dataclass(frozen=True)
class NoisePrior:
    """What is known of one number that says how readings err: its logarithm is normal between bounds."""

    name: str
    median: float
    spread: float  # standard deviation of the logarithm
    lower: float
    upper: float
    step: float = 0.15  # of the logarithm, by which it changes the likelihood noticeably


NOISES = (
    NoisePrior("range_m", 0.004, 1.2, 3e-4, 0.08),
    NoisePrior("level_db", 1.0, 0.8, 0.2, 8.0),
    NoisePrior("missed", 0.02, 1.0, 1e-3, 0.4),
    NoisePrior("lost", 0.02, 1.0, 1e-3, 0.4),
    NoisePrior("stray_per_m", 0.02, 1.2, 1e-3, 1.0),
    # thermometers err by half a degree, and the air of a room differs by as much: 0.6 K
    NoisePrior("stretch", 1.0, 1e-3, 0.99, 1.01, 2e-4),
)
COARSE = Noise(0.03, 3.0, 0.15, 0.05, 0.1)  # with which the likelihood is smooth over centimetres and degrees
MIDDLING = Noise(0.01, 1.5, 0.08, 0.03, 0.05)


@dataclass(frozen=True)
class Problem:
    """What is fitted to what."""

    scans: tuple[Heard, ...]
    room: Room
    places: tuple[Place, ...]
    board: Board
    parameters: tuple[Parameter, ...]
    prediction: PredictionOptions
    told_speed: float | None  # m/s, that echo times were made ranges with; None where the air is not free
    rounding: float  # m, of the board
    alike: tuple[float, ...] = ()  # of each scan, how many readings there are to one that says something new; empty: 1

    @property
    def size(self) -> int:
        """How many numbers the objective takes."""
        return len(self.parameters) + len(self.noises)

    @property
    def noises(self) -> tuple[NoisePrior, ...]:
        """What is found of how readings err; where the air is free, that is what stretches ranges."""
        return NOISES if self.told_speed is None else tuple(noise for noise in NOISES if noise.name != "stretch")

    @cached_property
    def steps(self) -> FloatArray:
        """By how much each number changes the objective noticeably, (size,)."""
        own = [parameter.quantity.step for parameter in self.parameters]
        return np.array([*own, *(noise.step for noise in self.noises)], dtype=np.float64)

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper end of each number, (size,)."""
        lower = [*(parameter.lower for parameter in self.parameters), *(math.log(n.lower) for n in self.noises)]
        upper = [*(parameter.upper for parameter in self.parameters), *(math.log(n.upper) for n in self.noises)]
        lower[len(self.parameters)] = math.log(max(NOISES[0].lower, self.rounding * _ROUNDED))
        if self.prediction.receiver is Receiver.BOARD:
            lower[len(self.parameters) + 1] = math.log(_OVERLAPPING)
        return np.array(lower), np.array(upper)

    def start(self) -> FloatArray:
        """Where room, places and board say that it is, with middling noise, (size,)."""
        values = [start_of(parameter, self.places, self.room, self.board) for parameter in self.parameters]
        return self.with_noise(np.array(values), MIDDLING)

    def with_noise(self, values: FloatArray, noise: Noise) -> FloatArray:
        """The first numbers of `values`, with that noise behind them."""
        vector = np.concatenate((values[: len(self.parameters)], np.log(np.array(noise))[: len(self.noises)]))
        return np.asarray(np.clip(vector, *self.bounds))

    def setting(self, values: FloatArray) -> tuple[Room, tuple[Place, ...], Board]:
        """Room, places and board as those numbers make them."""
        chosen = dict(zip(self.parameters, values.tolist(), strict=False))
        return applied(chosen, self.room, self.places, self.board)

    def near(self, values: FloatArray, prediction: PredictionOptions | None = None) -> "Objective":
        """The objective for values near these; paths are searched for with `prediction`, or the problem's own."""
        room, places, board = self.setting(values)
        search = search_for(room, self.board, prediction or self.prediction)
        materials = [parameter.of for parameter in self.parameters if parameter.quantity is REFLECTANCE]
        walls = [parameter.of for parameter in self.parameters if parameter.quantity is WALL]
        found = []
        for place in places:
            paths = paths_from(room, place, search, None, board.aperture_radius)
            paths = paths.select(
                loud_enough(room, replace(board, threshold_db=board.threshold_db + _LESS_NOTICED), paths)
            )
            found.append(echo_paths(paths, room, materials, walls))
        return Objective(self, values.copy(), room, places, tuple(found))


@dataclass(frozen=True)
class Objective:
    """Log-likelihood and prior near the values at which paths were searched."""

    problem: Problem
    values: FloatArray
    room: Room
    places: tuple[Place, ...]
    paths: tuple[EchoPaths, ...]

    def __call__(self, values: FloatArray) -> float:
        """Log-likelihood and prior of those numbers, (size,); -inf outside their bounds."""
        prior = self._log_prior(values)
        if prior == -math.inf:
            return prior
        alike = self.problem.alike or (1.0,) * len(self.paths)
        total = sum(float(self.by_reading(values, k).sum()) / alike[k] for k in range(len(self.paths)))
        return prior + total if math.isfinite(total) else -math.inf

    def by_reading(self, values: FloatArray, scan: int) -> FloatArray:
        """Log-likelihood of every reading of a scan, (n,)."""
        noise = Noise(*np.exp(values[len(self.problem.parameters) :]).tolist())
        place = self._place(values, scan)
        ear, known = self._ear(values, place.heading, noise.stretch), self._known(values, scan, place.position)
        return np.asarray(log_likelihoods(self.problem.scans[scan], known, ear, noise, self._table, self._lateness))

    def _log_prior(self, values: FloatArray) -> float:
        lower, upper = self.problem.bounds
        if not ((values >= lower) & (values <= upper)).all():
            return -math.inf
        middle, spread = self._normal_priors
        return float(-0.5 * (((values - middle) / spread) ** 2).sum())

    @cached_property
    def _normal_priors(self) -> tuple[FloatArray, FloatArray]:
        own = [
            (0.0, math.inf) if parameter.expected is None else (parameter.expected, parameter.deviation or math.inf)
            for parameter in self.problem.parameters
        ]
        middle, spread = np.array([*own, *((math.log(noise.median), noise.spread) for noise in self.problem.noises)]).T
        return middle, spread

    @cached_property
    def _table(self) -> FloatArray:
        board = self.problem.board
        widest = [quantity.put(board, self.problem.parameters[row].upper) for row, quantity in self._board_rows]
        aperture = max(one.aperture_radius for one in (board, *widest))
        coldest = replace(self.room.air, temperature_c=-10.0)
        return beam_table(board.wavenumber(coldest) * aperture)

    @cached_property
    def _lateness(self) -> FloatArray:
        if self.problem.prediction.receiver is Receiver.FIRST_ECHO:
            return np.empty(0)
        return lateness_by_level(self.problem.board, self.room.air.speed_of_sound)

    @cached_property
    def _board_rows(self) -> list[tuple[int, BoardQuantity]]:
        quantities = ((row, one.quantity) for row, one in enumerate(self.problem.parameters))
        return [(row, quantity) for row, quantity in quantities if isinstance(quantity, BoardQuantity)]

    def _board(self, values: FloatArray) -> Board:
        board = self.problem.board
        for row, quantity in self._board_rows:
            board = quantity.put(board, float(values[row]))
        return board

    def _place(self, values: FloatArray, scan: int) -> Place:
        place = self.places[scan]
        for row, parameter in enumerate(self.problem.parameters):
            if isinstance(parameter.quantity, PlaceQuantity) and parameter.scan in (scan, None):
                place = parameter.quantity.put(place, float(values[row]))
        return place

    def _air(self, values: FloatArray) -> Air:
        air = self.room.air
        for row, parameter in enumerate(self.problem.parameters):
            if isinstance(parameter.quantity, AirQuantity):
                air = parameter.quantity.put(air, float(values[row]))
        return air

    def _ear(self, values: FloatArray, heading: float, stretch: float) -> Ear:
        board, speed = self._board(values), self.room.air.speed_of_sound
        if self.problem.told_speed is not None:
            speed = self._air(values).speed_of_sound
            stretch = self.problem.told_speed / speed
        ahead, aside, half = board.mount.ahead, board.mount.aside, board.mount.separation / 2
        return Ear(
            heading=heading,
            ka=math.tau * board.frequency / speed * board.aperture_radius,
            threshold_db=board.threshold_db,
            opens=board.blanking_end * speed / 2 * stretch + board.range_offset,
            closes=board.max_range * stretch + board.range_offset,
            dead=board.rearm * speed / 2 * stretch,
            stretch=stretch,
            offset=board.range_offset,
            sender=(ahead, aside + half),
            listener=(ahead, aside - half),
        )

    def _known(self, values: FloatArray, scan: int, position: tuple[float, float]) -> Known:
        paths, (x, y) = self.paths[scan], self.places[scan].position
        by = position[0] - x, position[1] - y
        out, back = moved(*self._images(values, scan), paths.turn, paths.kind, by)
        return Known(out, back, paths.rise, paths.turn, paths.kind, self._levels(values, scan))

    def _images(self, values: FloatArray, scan: int) -> tuple[FloatArray, FloatArray]:
        """`out` and `back` of paths, where walls have moved."""
        paths = self.paths[scan]
        if not self._wall_rows:
            return paths.out, paths.back
        shifts = values[self._wall_rows] - self.values[self._wall_rows]
        return paths.out + paths.out_by_wall @ shifts, paths.back + paths.back_by_wall @ shifts

    def _levels(self, values: FloatArray, scan: int) -> FloatArray:
        """Level of each path before the beam, dB, (k,)."""
        paths, lengths = self.paths[scan], self._lengths[scan]
        level = paths.gain_db + self._gained[scan] - self._lost[scan]
        if self.problem.told_speed is not None:
            level += self._lost[scan] - uncompensated_db(lengths, self.problem.board, self._air(values))
        if len(self._reflectance_rows):
            ratio = values[self._reflectance_rows] / self._reflectances
            level = level + paths.touches @ (20 * np.log10(np.maximum(ratio, 1e-9)))
        return level

    @cached_property
    def _lengths(self) -> tuple[FloatArray, ...]:
        return tuple(
            _length(paths.out, paths.rise[:, 0]) + _length(paths.back, paths.rise[:, 1]) for paths in self.paths
        )

    @cached_property
    def _lost(self) -> tuple[FloatArray, ...]:
        """What the way takes of each path that the gain does not give back, dB."""
        return tuple(uncompensated_db(lengths, self.problem.board, self.room.air) for lengths in self._lengths)

    @cached_property
    def _gained(self) -> tuple[FloatArray, ...]:
        """What the board's own gain gives each path beyond the ideal one, dB."""
        board, speed = self.problem.board, self.room.air.speed_of_sound
        if self.problem.prediction.receiver is Receiver.FIRST_ECHO:
            return tuple(np.zeros(len(lengths)) for lengths in self._lengths)
        return tuple(level_offset_db(lengths, board, speed) for lengths in self._lengths)

    @cached_property
    def _reflectance_rows(self) -> list[int]:
        return [row for row, one in enumerate(self.problem.parameters) if one.quantity is REFLECTANCE]

    @cached_property
    def _reflectances(self) -> FloatArray:
        return np.array([reflectance_of(self.room, self.problem.parameters[row].of) for row in self._reflectance_rows])

    @cached_property
    def _wall_rows(self) -> list[int]:
        return [row for row, one in enumerate(self.problem.parameters) if one.quantity is WALL]


def _length(vectors: FloatArray, rise: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt((vectors**2).sum(axis=1) + rise**2))


def make_problem(
    scans: Sequence[PlacedScan],
    room: Room,
    board: Board,
    parameters: Sequence[Parameter],
    prediction: PredictionOptions,
    all_echoes: bool,
) -> Problem:
    """Scans, room, board and parameters as one problem. Raises InputError where a scan is given twice."""
    check_given_once(scans)
    air_is_free = any(isinstance(parameter.quantity, AirQuantity) for parameter in parameters)
    told = [reading.speed_of_sound for scan in scans for reading in scan.readings]
    speed = float(np.median(told)) if air_is_free else None
    return Problem(
        tuple(heard(scan.readings, board, speed, all_echoes) for scan in scans),
        room,
        tuple(scan.place for scan in scans),
        board,
        tuple(parameters),
        prediction,
        speed,
        board.rounding,
    )


def heard(readings: Sequence[Reading], board: Board, speed: float | None, all_echoes: bool) -> Heard:
    """Readings as the kernel wants them; where none has a second echo, none was listened for.

    `speed` (m/s) makes ranges of echo times; None: what each reading itself says.
    """
    several = all_echoes and any(len(reading.echo_times) > 1 for reading in readings)
    most = MOST_ECHOES if several else 1
    ranges = np.full((len(readings), most), np.nan)
    counts = np.zeros(len(readings), dtype=np.int64)
    for row, reading in enumerate(readings):
        times = reading.echo_times[:most]
        counts[row] = len(times)
        ranges[row, : len(times)] = np.array(times) * (speed or reading.speed_of_sound) / 2
    angles = np.array([board.heading_at(reading.angle, 0.0) for reading in readings])
    return Heard(angles, ranges, counts, counts == most)
