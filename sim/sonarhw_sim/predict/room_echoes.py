"""The world in front of a fake scanner: the room as it really is, which is never quite as its file says.

Takes a room, a place, a board and a seed; hands on an echo source for a fake board. Everything random is a function of
seed, angle, sweep and ping, never of the order of calls.
"""

import math
import threading
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from sonarhw.echo_source import Ping, PingResult
from sonarhw.readings import Trace
from sonarhw_sim.board.profile import Board
from sonarhw_sim.choices import Unit
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import (
    PredictionOptions,
    paths_serve_all_headings,
    predict_scan,
    search_for,
    weigh_paths,
)
from sonarhw_sim.rays.kernel import first_hit
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.model import Place, Room, with_post
from sonarhw_sim.vertical.sections import paths_from

MAX_ECHOES = 5  # a ping
_FIRST_LISTEN = 0.01  # s, of the ping that compiles
_HEADINGS_KEPT = 720  # whose paths are not sought again, where each has its own


@dataclass(frozen=True)
class Disturbance:
    """How far the truth is from the room file; standard deviations."""

    position: float = 0.003  # m, each of x and y
    temperature: float = 1.0  # K
    thermometer: float = 0.2  # K, error of what the board reports
    timing: float = 6e-6  # s on every echo time, about 1 mm
    level_db: float = 0.5  # on every echo, so that faint ones come and go
    trace_noise: float = 0.0012  # of full scale; an 8-bit sample is 0.0039
    furniture: bool = True  # one post that the file does not know


EXACT = Disturbance(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False)  # the truth is the room file


class RoomEchoes:
    """An echo source (sonarhw.echo_source) that hears a room by following its sound."""

    def __init__(
        self, room: Room, place: Place, board: Board, seed: int = 0, disturbance: Disturbance | None = None
    ) -> None:
        self._seed = seed
        self._disturbance = disturbance or Disturbance()
        self._board = board
        self._asked = room, place
        self._known: tuple[Room, Place, Paths | None] | None = None
        self._turned = lru_cache(maxsize=_HEADINGS_KEPT)(self._predict)
        self._ready = threading.Event()
        random = np.random.default_rng((seed, 1))
        warmer, error = random.normal(0, (self._disturbance.temperature, self._disturbance.thermometer))
        self._temperature_c = room.air.temperature_c + float(warmer)
        self.temperature_c: float | None = self._temperature_c + float(error)

    @property
    def ready(self) -> bool:
        """Whether `prepare` is done, so that `hear` answers at once."""
        return self._ready.is_set()

    def prepare(self) -> None:
        """Find the paths and hear one ping, compiling what is still to compile; seconds, so a thread may do it."""
        _, place, _ = self._truth()
        ping, random = Ping(0.0, 0, 0, _FIRST_LISTEN, trace=True), np.random.default_rng(0)
        scan = self._scan(place.heading)
        self._echo_times(scan, ping, random)
        self._trace(scan, ping, random)
        self._ready.set()

    def receive(self, ping: Ping) -> PingResult:
        """What the board hears of one ping; the same for the same ping, whatever was asked before."""
        _, place, _ = self._truth()
        heading = self._board.heading_at(ping.angle, place.heading)
        if self._board.ring is not None and self._board.ring.sensor_at(place, heading) is None:
            return PingResult(())
        microdegrees = round(math.degrees(ping.angle) * 1e6) % 360_000_000
        random = np.random.default_rng((self._seed, 2, microdegrees, ping.sweep, ping.index))
        scan = self._scan(heading)
        times = self._echo_times(scan, ping, random)
        return PingResult(times, self._trace(scan, ping, random) if ping.trace else None)

    def _truth(self) -> tuple[Room, Place, Paths | None]:
        """Room and place as they are, and the paths, where they are those of every heading."""
        if self._known is None:
            room, place = self._disturbed()
            if paths_serve_all_headings(self._board, Unit.PASS):
                search = search_for(room, self._board, PredictionOptions())
                self._known = room, place, paths_from(room, place, search)
            else:
                self._known = room, place, None
                self._turned(place.heading)
        return self._known

    def _scan(self, heading: float) -> PredictedScan:
        room, place, paths = self._truth()
        if paths is None:
            return self._turned(heading)
        return weigh_paths(room, place, self._board, np.array([heading]), paths)

    def _predict(self, heading: float) -> PredictedScan:
        room, place, _ = self._truth()
        return predict_scan(room, place, self._board, np.array([heading]))

    def _disturbed(self) -> tuple[Room, Place]:
        room, place = self._asked
        room = replace(room, air=replace(room.air, temperature_c=self._temperature_c))
        random = np.random.default_rng((self._seed, 3))
        x, y = np.array(place.position) + random.normal(0, self._disturbance.position, 2)
        if self._disturbance.furniture:
            room = with_furniture(room, (float(x), float(y)), random)
        return room, replace(place, position=(float(x), float(y)))

    def _echo_times(self, scan: PredictedScan, ping: Ping, random: np.random.Generator) -> tuple[float, ...]:
        count = len(scan.paths)
        levels = scan.levels_at(0) + random.normal(0, self._disturbance.level_db, count)
        told = scan.apparent_lengths + 2 * self._board.range_offset
        times = told / scan.room.air.speed_of_sound + random.normal(0, self._disturbance.timing, count)
        heard = times[(levels >= self._board.threshold_db) & ~scan.blanked & (times <= ping.listen)]
        echoes: list[float] = []
        for time in np.sort(heard):
            if not echoes or time - echoes[-1] >= self._board.rearm:
                echoes.append(float(time))
        return tuple(echoes[:MAX_ECHOES])

    def _trace(self, scan: PredictedScan, ping: Ping, random: np.random.Generator) -> Trace:
        clean = scan.signal_at(0, ping.listen).envelope()
        noise = np.abs(random.normal(0, self._disturbance.trace_noise, len(clean.samples)))
        return Trace(np.minimum(np.hypot(clean.samples, noise), 1.0), clean.rate, clean.start, clean.carrier)


def with_furniture(room: Room, position: tuple[float, float], random: np.random.Generator) -> Room:
    """The room with one slim post more, in sight of `position` and between it and some wall.

    Its radius is 3 % of the way to that wall; the room stays as it is where no wall is in sight.
    """
    x, y = position
    for direction in random.uniform(0, math.tau, 32):
        dx, dy = math.cos(direction), math.sin(direction)
        distance, surface = first_hit(x, y, dx, dy, -1, room.surfaces)
        if surface >= 0 and distance > 0.1:
            at = distance * random.uniform(0.6, 0.8)
            return with_post(room, (x + at * dx, y + at * dy, 0.03 * distance), "furniture", 0.9)
    return room
