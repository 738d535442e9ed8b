"""Echoes for a fake scanner, of a flat plate or in a room that deliberately differs a little from its file."""

import math
import threading
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from sonarhw.errors import InputError
from sonarhw.readings import FloatArray, Ping, PingResult, Trace
from sonarhw_sim.air import Air, Receiver, Unit
from sonarhw_sim.board.beam import BoolArray, beam_gain
from sonarhw_sim.board.profile import Board, uncompensated_db
from sonarhw_sim.board.receiver import Sound, counted_time, echo_times, first_echoes
from sonarhw_sim.board.signal import Arrivals, Signal, received
from sonarhw_sim.predict.predicted_scan import PredictedScan, whole_microdegrees
from sonarhw_sim.predict.prediction import (
    PredictionOptions,
    paths_for,
    paths_serve_all_headings,
    predict_scan,
    scan_of_paths,
)
from sonarhw_sim.rays.fan import first_hit
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.room import Place, Room, with_post

# echoes for a fake scanner: random values are functions of seed, angle, sweep and ping, not of the order of calls


MAX_ECHOES = 5  # per ping
_FIRST_LISTEN = 0.01  # s, of the ping in `prepare`
_FIRST_SIGNAL = 0.02  # s; twice as long, until it contains the echoes, because most arrivals are late
_HEADINGS_KEPT = 720  # headings whose paths are cached, if each has its own
_OPTIONS = PredictionOptions()


@dataclass(frozen=True)
class Disturbance:
    """Differences between the simulated room and its file; standard deviations.

    Those of level and timing come on top of `threshold_sd_db` and `range_sd` of the board.
    """

    position: float = 0.003  # m, each of x and y
    temperature: float = 1.0  # K
    thermometer: float = 0.2  # K, error of the reported temperature
    timing: float = 6e-6  # s on every echo time, about 1 mm
    level_db: float = 0.5  # on every echo, so that faint echoes are sometimes missing
    trace_noise: float = 0.0012  # of full scale; an 8-bit sample is 0.0039
    furniture: bool = True  # one post that is not in the file


EXACT = Disturbance(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False)  # the room as in its file


class RoomEchoes:
    """An echo source (`sonarhw.readings`) that predicts the echoes of a room by following sound."""

    def __init__(
        self, room: Room, place: Place, board: Board, seed: int = 0, disturbance: Disturbance | None = None
    ) -> None:
        self._seed = seed
        self._disturbance = disturbance or Disturbance()
        self._board = board
        self._nominal = room, board.faced(place)
        self._actual: tuple[Room, Place, Paths | None] | None = None
        self._turned = lru_cache(maxsize=_HEADINGS_KEPT)(self._predict)
        self._preparing = threading.Lock()
        self._refusal: InputError | None = None
        self.ready = False  # whether `prepare` is done, so that `receive` returns at once
        random = np.random.default_rng((seed, 1))
        warmer, error = random.normal(0, (self._disturbance.temperature, self._disturbance.thermometer))
        self._temperature_c = room.air.temperature_c + float(warmer)
        self.temperature_c: float | None = self._temperature_c + float(error)

    def prepare(self) -> None:
        """Find the paths and receive one ping, which compiles the kernels, unless this is done already.

        Takes seconds; may run in a thread. Raises InputError for a room with too many paths; `receive` raises it too.
        """
        with self._preparing:
            if self.ready:
                return
            try:
                _, place, _ = self._truth()
            except InputError as error:
                self._refusal = error
                raise
            ping, random = Ping(0.0, 0, 0, _FIRST_LISTEN, trace=True), np.random.default_rng(0)
            self._heard(self._scan(place.heading), ping, random)
            self.ready = True

    def receive(self, ping: Ping) -> PingResult:
        """Return the echoes of one ping; equal pings have equal results. Raises what `prepare` raises."""
        if self._refusal is not None:
            raise self._refusal
        _, place, _ = self._truth()
        heading = place.heading + self._board.turned(ping.angle)
        if self._board.ring is not None and self._board.ring.sensor_at(place, heading) is None:
            return PingResult(())
        random = np.random.default_rng((self._seed, 2, whole_microdegrees(ping.angle), ping.sweep, ping.index))
        return self._heard(self._scan(heading), ping, random)

    def _truth(self) -> tuple[Room, Place, Paths | None]:
        """Return the actual room and place, and the paths if they are the same at every heading."""
        if self._actual is None:
            room, place = self._disturbed()
            if paths_serve_all_headings(self._board, Unit.PASS):
                paths = paths_for(room, place, self._board, _OPTIONS)
                # without those that are too faint at every heading, so that they are left out once
                loud = scan_of_paths(room, place, self._board, np.array([place.heading]), paths, _OPTIONS)
                self._actual = room, place, loud.paths
            else:
                self._actual = room, place, None
                self._turned(place.heading)
        return self._actual

    def _scan(self, heading: float) -> PredictedScan:
        room, place, paths = self._truth()
        if paths is None:
            return self._turned(heading)
        scan = scan_of_paths(room, place, self._board, np.array([heading]), paths, _OPTIONS)
        return replace(scan, receiver=self._board.receiver)

    def _predict(self, heading: float) -> PredictedScan:
        room, place, _ = self._truth()
        return predict_scan(room, place, self._board, np.array([heading]))

    def _disturbed(self) -> tuple[Room, Place]:
        room, place = self._nominal
        room = replace(room, air=replace(room.air, temperature_c=self._temperature_c))
        random = np.random.default_rng((self._seed, 3))
        x, y = np.array(place.position) + random.normal(0, self._disturbance.position, 2)
        if self._disturbance.furniture:
            room = with_furniture(room, (float(x), float(y)), random)
        return room, replace(place, position=(float(x), float(y)))

    def _heard(self, scan: PredictedScan, ping: Ping, random: np.random.Generator) -> PingResult:
        if scan.receiver is Receiver.BOARD:
            arrivals, speed = self._arrivals(scan, random), scan.room.air.speed_of_sound
            if not ping.trace:
                return PingResult(self._echoes_without_trace(arrivals, speed, ping.listen))
            signal = received(arrivals, self._board, speed, ping.listen, Receiver.BOARD)
            return PingResult(self._detected(signal, speed, ping.listen), self._trace(signal, random))
        times = self._first_echo_times(scan, ping, random)
        return PingResult(times, self._trace(scan.ping(0).signal(ping.listen), random) if ping.trace else None)

    def _echoes_without_trace(self, arrivals: Arrivals, speed_of_sound: float, listen: float) -> tuple[float, ...]:
        """Return what `_detected` returns for the whole signal, from a shorter one if it has as many echoes."""
        duration = min(_FIRST_SIGNAL, listen)
        while True:
            signal = received(arrivals, self._board, speed_of_sound, duration, Receiver.BOARD)
            times = self._detected(signal, speed_of_sound, listen)
            if len(times) == MAX_ECHOES or duration == listen:
                return times
            duration = min(2 * duration, listen)

    def _detected(self, signal: Signal, speed_of_sound: float, listen: float) -> tuple[float, ...]:
        times = counted_time(echo_times(signal.samples, self._board, speed_of_sound), self._board)
        return tuple((times[times <= listen] + 2 * self._board.range_offset / speed_of_sound)[:MAX_ECHOES].tolist())

    def _arrivals(self, scan: PredictedScan, random: np.random.Generator) -> Arrivals:
        """Return the arrivals at the board's own receiver, each with its disturbance."""
        arrivals = scan.ping(0).sound
        count = len(arrivals)
        level_db, timing = self._spreads(scan.room.air.speed_of_sound)
        levels = 10 ** (random.normal(0, level_db, count) / 20)
        later = random.normal(0, timing, count)
        # the phase of the carrier stays, so that arrivals add up as without the disturbance
        phasors = np.exp(1j * math.tau * self._board.frequency * later)
        return replace(arrivals, times=arrivals.times + later, amplitudes=arrivals.amplitudes * levels * phasors)

    def _spreads(self, speed_of_sound: float) -> tuple[float, float]:
        """Return the standard deviations of the level, dB, and of the time, s, of every echo."""
        of_board = 2 * self._board.range_sd / speed_of_sound
        level_db = math.hypot(self._disturbance.level_db, self._board.threshold_sd_db)
        return level_db, math.hypot(self._disturbance.timing, of_board)

    def _first_echo_times(self, scan: PredictedScan, ping: Ping, random: np.random.Generator) -> tuple[float, ...]:
        count, speed, predicted = len(scan.paths), scan.room.air.speed_of_sound, scan.ping(0)
        level_db, timing = self._spreads(speed)
        levels = predicted.levels + random.normal(0, level_db, count)
        counted = counted_time(predicted.arrival_lengths / speed, self._board)
        times = counted + 2 * self._board.range_offset / speed + random.normal(0, timing, count)
        detected = times[(levels >= self._board.threshold_db) & ~scan.blanked & (times <= ping.listen)]
        echoes: list[float] = []
        for time in np.sort(detected):
            if not echoes or time - echoes[-1] >= self._board.rearm:
                echoes.append(float(time))
        return tuple(echoes[:MAX_ECHOES])

    def _trace(self, signal: Signal, random: np.random.Generator) -> Trace:
        clean = signal.envelope()
        noise = np.abs(random.normal(0, self._disturbance.trace_noise, len(clean.samples)))
        return Trace(np.minimum(np.hypot(clean.samples, noise), 1.0), clean.rate, clean.start, clean.carrier)


def with_furniture(room: Room, position: tuple[float, float], random: np.random.Generator) -> Room:
    """Return the room with one additional thin post, visible from `position`, between it and a wall.

    Its radius is 3 % of the distance to that wall. Without a visible wall, the room is returned unchanged.
    """
    x, y = position
    for direction in random.uniform(0, math.tau, 32):
        dx, dy = math.cos(direction), math.sin(direction)
        distance, surface = first_hit(x, y, dx, dy, -1, room.surfaces)
        if surface >= 0 and distance > 0.1:
            post = distance * random.uniform(0.6, 0.8)
            return with_post(room, (x + post * dx, y + post * dy, 0.03 * distance), "furniture", 0.9)
    return room


# the echo of a flat plate straight ahead


_ANGLES = np.linspace(0.0, math.pi / 2, 1801)  # rad from the axis, 0.05° apart
ARC_MIDDLE = 0.5  # share of the arc in which a calibration measures the range
RIM = 0.004  # m; a calibration takes ranges that exceed those of the middle by more for those of a rim


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
    delay = float(np.median(delays[: max(1, round(ARC_MIDDLE * arc))]))
    early = _before_first(~(delays <= delay + RIM))
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
