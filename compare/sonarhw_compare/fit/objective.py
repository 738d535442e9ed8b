"""The objective of a fit: log-likelihood of all scans plus log-prior, as a function of a vector.

A `Problem` returns an `Objective` near any values. Paths are searched there once and then moved (`echo_paths`), so one
call takes a fraction of a millisecond. The vector holds the parameters, then the logarithms of the noise (`NOISES`).
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import repeat

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.air import Air, Receiver
from sonarhw_sim.board.beam import beam_table
from sonarhw_sim.board.profile import Board, axis_beside, from_axis, uncompensated_db, without_own_body
from sonarhw_sim.predict.predicted_scan import loud_enough
from sonarhw_sim.predict.prediction import PredictionOptions, search_for
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.room import Place, Room
from sonarhw_sim.space.sections import paths_from_each

from sonarhw.readings import BoolArray, FloatArray, Reading
from sonarhw_compare.fit import likelihood, quantities
from sonarhw_compare.fit.parameters import Parameter, applied, start_of
from sonarhw_compare.fit.result import PlacedScan, check_given_once

# all quantities of the board that the likelihood depends on
_OF_BOARD = (
    quantities.OFFSET,
    quantities.SLOPE,
    quantities.AHEAD,
    quantities.ASIDE,
    quantities.SCALE,
    quantities.AXIS_X,
    quantities.AXIS_Y,
    quantities.THRESHOLD,
    quantities.APERTURE,
)


# Prior of tolerated values. How far they are off is unknown, so several standard deviations are possible.
#
# All walls have one standard deviation, the aperture another, and so on. It is the stated one or a fraction of it.
# Where the scan shows no mismatch, the small ones are more probable, and the intervals of a fit stay narrow.
# Reflectances are not among these values: a room file states measured walls and assumed reflectances, so theirs is
# the stated one.


LEVELS = np.array([1.0, 0.3, 0.1, 0.02])  # of the stated standard deviation
PROBABILITIES = np.array([0.1, 0.1, 0.2, 0.6])  # of the levels


@dataclass(frozen=True)
class TolerancePrior:
    """Prior of t tolerated values in g groups: a mixture of normal distributions for each group."""

    rows: NDArray[np.intp]  # (t,), of the vector
    groups: FloatArray  # (g, t), 1 where a value belongs to a group
    middle: FloatArray  # (t,)
    widest: FloatArray  # (t,), standard deviations as stated

    def __call__(self, values: FloatArray) -> FloatArray:
        """Return the logarithm of the density of vectors (m, size) relative to the widest normal one's middle, (m,)."""
        squares = (((values[:, self.rows] - self.middle) / self.widest) ** 2) @ self.groups.T
        logs = -0.5 * squares[:, :, None] / LEVELS**2 + self._weights
        most = logs.max(axis=2, keepdims=True)
        sums = most[:, :, 0] + np.log(np.exp(logs - most).sum(axis=2))
        return np.asarray(sums.sum(axis=1))

    @cached_property
    def _weights(self) -> FloatArray:
        """The logarithm of the weight of each level of each group, (g, levels)."""
        return np.asarray(np.log(PROBABILITIES) - self.groups.sum(axis=1)[:, None] * np.log(LEVELS))


def tolerance_prior(parameters: Sequence[Parameter]) -> TolerancePrior:
    """Return the prior of those parameters that are tolerated, without reflectances; a group for each quantity."""
    rows = [
        row
        for row, parameter in enumerate(parameters)
        if parameter.is_tolerated and parameter.quantity is not quantities.REFLECTANCE
    ]
    tied = list(dict.fromkeys(parameters[row].quantity for row in rows))
    groups = [[float(parameters[row].quantity is quantity) for row in rows] for quantity in tied]
    return TolerancePrior(
        np.array(rows, dtype=np.intp),
        np.array(groups, dtype=np.float64).reshape(len(tied), len(rows)),
        np.array([parameters[row].expected or 0.0 for row in rows]),
        np.array([parameters[row].deviation or 1.0 for row in rows]),
    )


MOST_ECHOES = 5  # maximum number of echoes that a scanner reports for one ping
_ROUNDED = 1 / math.sqrt(12)  # standard deviation of the error of rounding to 1
_KEPT_BELOW_THRESHOLD = 14.0  # dB; the threshold may change by some decibels
_SMOOTH = math.log(2.0)  # of dB, least error of levels in the smooth objective
_DIFFRACTED_FURTHER = 6.0  # dB below the threshold: how much fainter diffracted paths are searched
_TOGETHER = 8  # vectors, whose paths are moved at once; those of more do not fit into the cache of a processor
_OVERLAPPING = 1.0  # dB, least error of levels where overlapping echoes are modelled as single ones


@dataclass(frozen=True)
class NoisePrior:
    """Prior of one kind of noise: its logarithm is normal between bounds."""

    name: str
    median: float
    spread: float  # standard deviation of the logarithm
    lower: float
    upper: float
    step: float = 0.15  # of the logarithm: a change that has a clear effect on the likelihood


NOISES = (
    NoisePrior("range_m", 0.004, 1.2, 3e-4, 0.08),
    NoisePrior("level_db", 1.0, 0.8, 0.2, 8.0),
    NoisePrior("missed", 0.02, 1.0, 1e-3, 0.4),
    NoisePrior("lost", 0.02, 1.0, 1e-3, 0.4),
    NoisePrior("stray_per_m", 0.02, 1.2, 1e-3, 1.0),
    # a thermometer has an error of half a degree, and the air of a room varies by as much: 0.6 K
    NoisePrior("stretch", 1.0, 1e-3, 0.99, 1.01, 2e-4),
)
COARSE = likelihood.ReadingNoise(0.03, 3.0, 0.15, 0.05, 0.1)  # makes the likelihood smooth over centimetres and degrees
MODERATE = likelihood.ReadingNoise(0.01, 1.5, 0.08, 0.03, 0.05)


@dataclass(frozen=True)
class Problem:
    """Scans, model and free parameters of a fit."""

    scans: tuple[likelihood.ScanArrays, ...]
    room: Room
    places: tuple[Place, ...]
    board: Board
    parameters: tuple[Parameter, ...]
    prediction: PredictionOptions
    reported_speed: float | None  # m/s, for ranges from echo times; None if the air is not free
    rounding: float  # m, of the board
    shares: tuple[FloatArray, ...] = ()  # (n,) by scan: what its readings count as; empty: 1 each, all are independent
    averages: bool = False  # whether values of `tolerance_prior` have that prior, not the widest normal one
    memory: likelihood.PathMemory = field(default_factory=likelihood.PathMemory, compare=False, repr=False)

    @property
    def receiver(self) -> Receiver:
        """The receiver of the model."""
        return self.prediction.receiver_of(self.board)

    @property
    def mean_share(self) -> float:
        """What a reading counts as on average."""
        return float(np.concatenate(self.shares).mean()) if self.shares else 1.0

    @property
    def size(self) -> int:
        """The length of the vector."""
        return len(self.parameters) + len(self.noises)

    @property
    def widenings(self) -> FloatArray:
        """Factor of the standard deviation of each value, (size,); 1 where the model is exact."""
        factors = np.ones(self.size)
        if self.receiver is Receiver.BOARD:
            factors[: len(self.parameters)] = [parameter.quantity.overlap for parameter in self.parameters]
        return factors

    @property
    def noises(self) -> tuple[NoisePrior, ...]:
        """The kinds of noise that are fitted. A free speed of sound replaces `stretch`."""
        return NOISES if self.reported_speed is None else tuple(noise for noise in NOISES if noise.name != "stretch")

    @cached_property
    def steps(self) -> FloatArray:
        """A change of each value that has a clear effect on the objective, (size,)."""
        own = [parameter.quantity.step for parameter in self.parameters]
        return np.array([*own, *(noise.step for noise in self.noises)], dtype=np.float64)

    @property
    def level_row(self) -> int:
        """The row of the error of levels in a vector; `NOISES` begins with the error of ranges."""
        return len(self.parameters) + 1

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bound of each value, (size,) each."""
        lower = [*(parameter.lower for parameter in self.parameters), *(math.log(n.lower) for n in self.noises)]
        upper = [*(parameter.upper for parameter in self.parameters), *(math.log(n.upper) for n in self.noises)]
        lower[len(self.parameters)] = math.log(max(NOISES[0].lower, self.rounding * _ROUNDED))
        if self.receiver is Receiver.BOARD:
            lower[self.level_row] = math.log(_OVERLAPPING)
        return np.array(lower), np.array(upper)

    def with_redundancies(self, redundancies: Iterable[float]) -> "Problem":
        """Return the problem with these numbers of readings per independent reading, by scan."""
        pairs = zip(self.scans, redundancies, strict=True)
        return replace(self, shares=tuple(np.full(len(scan.angles), 1 / redundancy) for scan, redundancy in pairs))

    def start(self) -> FloatArray:
        """Return the values of the given room, places and board, with `MODERATE` noise, (size,)."""
        values = [start_of(parameter, self.places, self.room, self.board) for parameter in self.parameters]
        return self.with_noise(np.array(values), MODERATE)

    def with_noise(self, values: FloatArray, noise: likelihood.ReadingNoise) -> FloatArray:
        """Return the parameters in `values` followed by this noise, (size,)."""
        vector = np.concatenate((values[: len(self.parameters)], np.log(np.array(noise))[: len(self.noises)]))
        return np.asarray(np.clip(vector, *self.bounds))

    def setting(self, values: FloatArray) -> tuple[Room, tuple[Place, ...], Board]:
        """Return room, places and board for these values."""
        chosen = dict(zip(self.parameters, values.tolist(), strict=False))
        return applied(chosen, self.room, self.places, self.board)

    def with_tolerated(self, tolerated: Sequence[Parameter]) -> "Problem":
        """Return the problem with these parameters after its own."""
        return replace(self, parameters=(*self.parameters, *tolerated))

    def with_values_of(self, tolerated: Sequence[Parameter], values: FloatArray) -> FloatArray:
        """Return a vector of the problem before `with_tolerated` as one after it, with present values, (size,)."""
        count, present = len(self.parameters), [parameter.expected or 0.0 for parameter in tolerated]
        return np.concatenate((values[:count], present, values[count:]))

    def without(self, rows: BoolArray) -> "Problem":
        """Return the problem with the parameters in `rows` (size,) fixed at their present values."""
        kept = tuple(parameter for parameter, leaves in zip(self.parameters, rows.tolist(), strict=False) if not leaves)
        return replace(self, parameters=kept)

    @cached_property
    def tolerance_prior(self) -> TolerancePrior:
        """Prior of the tolerated values if their standard deviations are unknown."""
        return tolerance_prior(self.parameters)

    def rows_of(self, quantity: quantities.Quantity) -> list[int]:
        """Return the rows of all parameters of a quantity."""
        return [row for row, parameter in enumerate(self.parameters) if parameter.quantity is quantity]

    def pose_rows(self, scan: int) -> list[int]:
        """Return the rows of the parameters of the place of a scan."""
        return [
            row
            for row, parameter in enumerate(self.parameters)
            if isinstance(parameter.quantity, quantities.PlaceQuantity) and parameter.scan in (scan, None)
        ]

    def near(self, values: FloatArray, prediction: PredictionOptions | None = None) -> "Objective":
        """Return the objective near these values. Paths are searched with `prediction` or the problem's own options."""
        prediction = prediction or self.prediction
        room, places, board = self.setting(values)
        key = (self.board, self.places, self.parameters, prediction, values[: len(self.parameters)].tobytes())
        paths = self.memory.paths(self.room, key, lambda: self._searched(room, board, places, prediction))
        return Objective(self, values.copy(), room, places, paths)

    def near_each(self, places: Sequence[Place], longest: float = math.inf) -> list["Objective"]:
        """Return the objective near each of these places of one scan, of a problem whose parameters are those of it.

        Paths longer than `longest` m are left out.
        """
        return near_together([replace(self, places=(place,)) for place in places], longest)

    @cached_property
    def _together(self) -> float:
        """The largest difference in length, m, of paths that the receiver adds as one arrival."""
        if not self.board.sum_arrivals or self.receiver is Receiver.BOARD:
            return 0.0
        return self.board.wavelength(self.room.air)

    def _searched(
        self,
        room: Room,
        board: Board,
        places: Sequence[Place],
        prediction: PredictionOptions,
        longest: float = math.inf,
    ) -> tuple[likelihood.EchoPaths, ...]:
        """Return the paths from each place in a room, as a board needs them."""
        # faint paths change the level of a louder one little, so the search is that of paths that are detected alone
        # but for those that become audible while the values change, from the threshold of `board` on
        fainter = replace(self.board, sum_arrivals=False, threshold_db=board.threshold_db - _DIFFRACTED_FURTHER)
        search = search_for(room, fainter, prediction)
        search = replace(search, max_length=min(search.max_length, longest))
        materials, walls = (
            [self.parameters[row].of for row in self.rows_of(quantity)]
            for quantity in (quantities.REFLECTANCE, quantities.WALL)
        )

        def echoes_of(paths: Paths) -> likelihood.EchoPaths:
            paths = likelihood.with_reverses(likelihood.with_summed_patches(paths, room, board), board)
            paths = paths.select(loud_enough(room, board, paths, _KEPT_BELOW_THRESHOLD))
            kept = likelihood.echo_paths(paths, room, materials, walls, self._together)
            return kept._replace(powers=kept.powers + likelihood.edge_powers(paths, room, materials, search))

        axes = [board.at_axis(board.faced(place)) for place in places]
        return tuple(map(echoes_of, paths_from_each(room, axes, search, board.aperture_radius)))


def near_together(problems: Sequence[Problem], longest: float = math.inf) -> list["Objective"]:
    """Return the objective near the start of each problem of one scan; they differ only in this scan and its place.

    Their paths are searched together, which takes half of the time. Those longer than `longest` m are left out.
    """
    if not problems:
        return []
    first, places = problems[0], [place for problem in problems for place in problem.places]
    searched = first._searched(first.room, first.board, places, first.prediction, longest)
    return [
        Objective(problem, problem.start(), problem.room, problem.places, (paths,))
        for problem, paths in zip(problems, searched, strict=True)
    ]


@dataclass(frozen=True)
class Objective:
    """Log-likelihood plus log-prior near the values at which paths were searched.

    Board, turning axis and air of a vector are plain numbers: copies of room and board for each would be slow.
    """

    problem: Problem
    values: FloatArray
    room: Room
    places: tuple[Place, ...]
    paths: tuple[likelihood.EchoPaths, ...]

    def __call__(self, values: FloatArray) -> float:
        """Return log-likelihood plus log-prior of a vector, (size,); -inf outside the bounds."""
        return float(self.many(values[None])[0])

    def many(self, values: FloatArray) -> FloatArray:
        """Return the same of several vectors (m, size) at once, (m,); this takes less time than one by one."""
        totals = self._log_priors(values)
        inside = np.flatnonzero(np.isfinite(totals))
        shares = self.problem.shares
        for begin in range(0, len(inside), _TOGETHER):
            rows = inside[begin : begin + _TOGETHER]
            for scan in range(len(self.paths)):
                by_reading = self._by_reading(values[rows], scan)
                totals[rows] += by_reading @ shares[scan] if shares else by_reading.sum(axis=1)
        return np.where(np.isfinite(totals), totals, -math.inf)

    def smooth(self, values: FloatArray) -> FloatArray:
        """Return `many` of vectors (m, size) with an error of levels of at least 2 dB, so that steps are flat."""
        smooth, level = values.copy(), self.problem.level_row
        smooth[:, level] = np.maximum(smooth[:, level], _SMOOTH)
        totals, inside = np.full(len(values), -math.inf), np.isfinite(self._log_priors(values))
        totals[inside] = self.many(smooth[inside])
        return totals

    def of_poses(
        self, readings: likelihood.ScanArrays, poses: FloatArray, noise: likelihood.ReadingNoise
    ) -> FloatArray:
        """Return the log-likelihood of readings at poses (m, 3) near that of the only scan, without a prior, (m,)."""
        board, vector, paths = self.problem.board, self.values, self.paths[0]
        levels, present = self._levels(vector[None], 0)[0], self._present
        (x, y), headings = poses[:, :2].T, poses[:, 2] + math.radians(board.home_angle_deg)
        axes = from_axis(x, y, (np.cos(headings), np.sin(headings)), board.axis_x, board.axis_y)
        searched = likelihood.PathArrays(paths.out, paths.back, paths.rise, paths.turn, paths.kind, paths.until, levels)
        chosen = self._for_kernel(vector, present, 0.0, noise.stretch)
        moves, totals = np.column_stack(axes) - self._axes[0], np.empty(len(poses))
        likelihood.sum_likelihoods(
            readings, searched, moves, headings, chosen, noise, self._table, self._lateness, totals
        )
        return totals

    def by_reading(self, values: FloatArray, scan: int) -> FloatArray:
        """Return the log-likelihood of each reading of a scan, (n,)."""
        return np.asarray(self._by_reading(values[None], scan)[0])

    def _by_reading(self, values: FloatArray, scan: int) -> FloatArray:
        """Return the log-likelihood of each reading of a scan for several vectors (m, size), (m, n)."""
        readings, echo_paths = self.problem.scans[scan], self.paths[scan]
        likelihoods = np.empty((len(values), len(readings.angles)))
        noises = np.exp(values[:, len(self.problem.parameters) :])
        rows = zip(values, noises.tolist(), self._images(values, scan), self._levels(values, scan), strict=True)
        for row, (vector, of_noise, (out, back), levels) in enumerate(rows):
            noise = likelihood.ReadingNoise(*of_noise)
            numbers = self._of_board(vector)
            x, y, heading = self._axis_pose(vector, scan, numbers)
            by = x - self._axes[scan][0], y - self._axes[scan][1]
            paths = likelihood.PathArrays(
                out, back, echo_paths.rise, echo_paths.turn, echo_paths.kind, echo_paths.until, levels
            )
            chosen = self._for_kernel(vector, numbers, heading, noise.stretch)
            likelihoods[row] = likelihood.log_likelihoods(
                readings, paths, by, chosen, noise, self._table, self._lateness
            )
        return likelihoods

    def _log_priors(self, values: FloatArray) -> FloatArray:
        """Return the log-prior of vectors (m, size), (m,)."""
        lower, upper = self.problem.bounds
        middle, spread = self._normal_priors
        priors = -0.5 * (((values - middle) / spread) ** 2).sum(axis=1)
        if self.problem.averages:
            priors += self.problem.tolerance_prior(values)
        return np.where(((values >= lower) & (values <= upper)).all(axis=1), priors, -math.inf)

    @cached_property
    def _normal_priors(self) -> tuple[FloatArray, FloatArray]:
        averaged = set(self.problem.tolerance_prior.rows.tolist()) if self.problem.averages else set()
        own = [
            (0.0, math.inf)
            if parameter.expected is None or row in averaged
            else (parameter.expected, parameter.deviation or math.inf)
            for row, parameter in enumerate(self.problem.parameters)
        ]
        middle, spread = np.array([*own, *((math.log(noise.median), noise.spread) for noise in self.problem.noises)]).T
        return middle, spread

    def _of_board(self, values: FloatArray) -> dict[str, float]:
        """Return the numbers of the board profile by key."""
        present = self._present
        changed = {
            quantity.key: quantity.number(present[quantity.key], float(values[row]))
            for row, quantity in self._board_rows
        }
        return present | changed

    def _axis_pose(self, values: FloatArray, scan: int, numbers: Mapping[str, float]) -> tuple[float, float, float]:
        """Return the position of the turning axis, m, and the actual heading of step 0, rad.

        `numbers` are those of the board for the same `values`.
        """
        present, rows = self._poses[scan]
        pose = present | {name: float(values[row]) for row, name in rows}
        heading = pose[quantities.HEADING.name] + math.radians(self.problem.board.home_angle_deg)
        x, y = axis_beside(
            (pose[quantities.X.name], pose[quantities.Y.name]),
            heading,
            numbers[quantities.AXIS_X.key],
            numbers[quantities.AXIS_Y.key],
        )
        return x, y, heading

    def _air_of(self, values: FloatArray) -> Air:
        """Return the air."""
        air = self.room.air
        for row, parameter in enumerate(self.problem.parameters):
            if isinstance(parameter.quantity, quantities.AirQuantity):
                air = parameter.quantity.put(air, float(values[row]))
        return air

    def _for_kernel(
        self, values: FloatArray, numbers: Mapping[str, float], heading: float, stretch: float
    ) -> likelihood.BoardValues:
        """Return the board as the kernel of the likelihood needs it, for step 0 at `heading` (rad).

        `stretch` is the ratio of measured to true ranges; a free speed of sound replaces it.
        """
        board, speed = self.problem.board, self.room.air.speed_of_sound
        if self.problem.reported_speed is not None:
            speed = self._air_of(values).speed_of_sound
            stretch = self.problem.reported_speed / speed
        stretch *= 1 + numbers[quantities.SLOPE.key]
        ahead, aside, half = numbers[quantities.AHEAD.key], numbers[quantities.ASIDE.key], board.mount.separation / 2
        offset = numbers[quantities.OFFSET.key]
        return likelihood.BoardValues(
            heading=heading,
            scale=numbers[quantities.SCALE.key],
            ka=math.tau * board.frequency / speed * numbers[quantities.APERTURE.key],
            threshold_db=numbers[quantities.THRESHOLD.key],
            opens=board.blanking_end * speed / 2 * stretch + offset,
            closes=board.max_range * stretch + offset,
            dead=board.rearm * speed / 2 * stretch,
            stretch=stretch,
            offset=offset,
            sender=(ahead, aside + half),
            listener=(ahead, aside - half),
        )

    @cached_property
    def _board_rows(self) -> list[tuple[int, quantities.BoardQuantity]]:
        """The rows of the parameters of the board, with their quantities."""
        rows = ((row, parameter.quantity) for row, parameter in enumerate(self.problem.parameters))
        return [(row, quantity) for row, quantity in rows if isinstance(quantity, quantities.BoardQuantity)]

    @cached_property
    def _present(self) -> dict[str, float]:
        return {quantity.key: quantity.read(self.problem.board) for quantity in _OF_BOARD}

    @cached_property
    def _poses(self) -> list[tuple[dict[str, float], list[tuple[int, str]]]]:
        """For each scan, the present pose by name of its quantities, and the rows that change it."""
        return [
            (
                {quantity.name: quantity.value(place) for quantity in (quantities.X, quantities.Y, quantities.HEADING)},
                [(row, self.problem.parameters[row].quantity.name) for row in self.problem.pose_rows(scan)],
            )
            for scan, place in enumerate(self.places)
        ]

    @cached_property
    def _axes(self) -> tuple[tuple[float, float], ...]:
        """Position of the turning axis of each scan at the values where paths were searched."""
        numbers = self._of_board(self.values)
        return tuple(self._axis_pose(self.values, scan, numbers)[:2] for scan in range(len(self.places)))

    @cached_property
    def _table(self) -> FloatArray:
        board = self.problem.board
        widest = [quantity.put(board, self.problem.parameters[row].upper) for row, quantity in self._board_rows]
        aperture = max(profile.aperture_radius for profile in (board, *widest))
        coldest = replace(self.room.air, temperature_c=-10.0)
        return beam_table(board.wavenumber(coldest) * aperture)

    @cached_property
    def _lateness(self) -> FloatArray:
        if self.problem.receiver is Receiver.FIRST_ECHO:
            return np.empty(0)
        return likelihood.lateness_by_level(self.problem.board, self.room.air.speed_of_sound)

    def _images(self, values: FloatArray, scan: int) -> Iterable[tuple[FloatArray, FloatArray]]:
        """Return `out` and `back` of paths after the walls have moved, for vectors (m, size)."""
        paths = self.paths[scan]
        if not self._wall_rows:
            return repeat((paths.out, paths.back), len(values))
        shifts = values[:, self._wall_rows] - self.values[self._wall_rows]
        moves = ((paths.out, paths.out_by_wall), (paths.back, paths.back_by_wall))
        # one product of matrices each, much faster than a stack of products
        moved = (
            positions + (shifts @ by.reshape(positions.size, shifts.shape[1]).T).reshape(len(values), *positions.shape)
            for positions, by in moves
        )
        return zip(*moved, strict=True)

    def _levels(self, values: FloatArray, scan: int) -> FloatArray:
        """Return the level of each path without the beam for vectors (m, size), dB, (m, k)."""
        paths = self.paths[scan]
        if self.problem.reported_speed is None:
            lost = self._lost[scan]
        else:
            airs = (self._air_of(vector) for vector in values)
            lost = np.array([uncompensated_db(self._lengths[scan], self.problem.board, air) for air in airs])
        ratios = values[:, self._reflectance_rows] / self._reflectances
        gained = 20 * np.log10(np.maximum(ratios, 1e-9)) @ paths.powers.T
        return np.asarray(paths.gain_db + self._gained[scan] - lost + gained)

    @cached_property
    def _lengths(self) -> tuple[FloatArray, ...]:
        return tuple(
            _length(paths.out, paths.rise[:, 0]) + _length(paths.back, paths.rise[:, 1]) for paths in self.paths
        )

    @cached_property
    def _lost(self) -> tuple[FloatArray, ...]:
        """Transmission loss of each path that the gain does not compensate, dB."""
        return tuple(uncompensated_db(lengths, self.problem.board, self.room.air) for lengths in self._lengths)

    @cached_property
    def _gained(self) -> tuple[FloatArray, ...]:
        """Gain of the board relative to the ideal gain, for each path, dB."""
        board, speed = self.problem.board, self.room.air.speed_of_sound
        if self.problem.receiver is Receiver.FIRST_ECHO:
            return tuple(np.zeros(len(lengths)) for lengths in self._lengths)
        return tuple(likelihood.level_offset_db(lengths, board, speed) for lengths in self._lengths)

    @cached_property
    def _reflectance_rows(self) -> list[int]:
        return self.problem.rows_of(quantities.REFLECTANCE)

    @cached_property
    def _reflectances(self) -> FloatArray:
        return np.array(
            [quantities.reflectance_of(self.room, self.problem.parameters[row].of) for row in self._reflectance_rows]
        )

    @cached_property
    def _wall_rows(self) -> list[int]:
        return self.problem.rows_of(quantities.WALL)


def _length(vectors: FloatArray, rise: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt((vectors**2).sum(axis=1) + rise**2))


def make_problem(
    scans: Sequence[PlacedScan],
    room: Room,
    board: Board,
    parameters: Sequence[Parameter],
    prediction: PredictionOptions,
    *,
    all_echoes: bool,
) -> Problem:
    """Return scans, room, board and parameters as a problem. Without `all_echoes`, only the first ones are used.

    Raises InputError if a scan is given twice.
    """
    check_given_once(scans)
    air_is_free = any(isinstance(parameter.quantity, quantities.AirQuantity) for parameter in parameters)
    speeds = [reading.speed_of_sound for scan in scans for reading in scan.readings]
    speed = float(np.median(speeds)) if air_is_free else None
    return Problem(
        tuple(
            scan_arrays(without_own_body(board.own_body, scan.readings), speed, all_echoes=all_echoes) for scan in scans
        ),
        room,
        tuple(scan.place for scan in scans),
        board,
        tuple(parameters),
        prediction,
        speed,
        board.rounding,
    )


def scan_arrays(readings: Sequence[Reading], speed: float | None, *, all_echoes: bool) -> likelihood.ScanArrays:
    """Return readings as arrays for the kernel. If none has a second echo, the board is assumed to report one only.

    `speed` (m/s) converts echo times to ranges; None: the speed of sound of each reading.
    """
    several = all_echoes and any(len(reading.echo_times) > 1 for reading in readings)
    most = MOST_ECHOES if several else 1
    ranges = np.full((len(readings), most), np.nan)
    counts = np.zeros(len(readings), dtype=np.int64)
    for row, reading in enumerate(readings):
        times = reading.echo_times[:most]
        counts[row] = len(times)
        ranges[row, : len(times)] = np.array(times) * (speed or reading.speed_of_sound) / 2
    angles = np.array([reading.angle for reading in readings])
    return likelihood.ScanArrays(angles, ranges, counts, counts == most)
