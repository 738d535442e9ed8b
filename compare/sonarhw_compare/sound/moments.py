"""One ping at one heading over time: the paths of its sound, blanking, and the moment of detection.

Sound travels along the paths of the echoes that matter: the winner and what lies within blanking, or every echo
over the threshold. `moment_at` says where all of it is at one time.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw.readings import FloatArray
from sonarhw_compare.explain.ranked_echoes import RankedEcho, ranked_echoes
from sonarhw_compare.headings import heading_text
from sonarhw_compare.sound.travel import front_at, position_at, stretch_between

_MOST_PATHS = 24  # more would hide each other
_AFTER = 0.12  # share of the time of the detection that follows it
_WIDEST_FRONT, _FRONT = 0.5, 0.07  # rad and m: half the width of the wavefront that is drawn


@dataclass(frozen=True)
class SoundWay:
    """One path of sound in the plan."""

    echo: RankedEcho
    points: FloatArray  # (k, 2), m
    bend: int | None  # corner that is a diffracting edge


@dataclass(frozen=True)
class Pulse:
    """The sound of one path at one moment."""

    way: SoundWay
    trail: FloatArray  # (m, 2), m: the part of the path that the burst covers; empty after its arrival
    front: FloatArray  # (m, 2), m: the wavefront at its begin
    share: float  # of the path travelled, 0..1


@dataclass(frozen=True)
class PlayedPing:
    """One transmission and all that happens until its first echo."""

    prediction: PredictedScan
    index: int
    every: bool = False  # whether all echoes over the threshold are shown, not only the winner and blanked ones

    @cached_property
    def ways(self) -> tuple[SoundWay, ...]:
        """The paths that are shown, that of the winner first."""
        found = ranked_echoes(self.prediction, self.index)
        shown = [echo for echo in found if echo.wins or (not echo.too_weak and (echo.blanked or self.every))]
        return tuple(self._ways(shown[:_MOST_PATHS]))

    def _ways(self, echoes: Iterable[RankedEcho]) -> Iterable[SoundWay]:
        paths = self.prediction.paths
        for echo in echoes:
            edge = int(paths.edges[echo.path]) >= 0
            yield SoundWay(echo, paths.outline(echo.path), int(paths.bends[echo.path]) + 1 if edge else None)

    @property
    def speed(self) -> float:
        """Speed of sound, m/s."""
        return self.prediction.room.air.speed_of_sound

    @property
    def heading(self) -> float:
        """Heading of the transducer, rad in the room."""
        return float(self.prediction.headings[self.index])

    @property
    def blanking(self) -> float:
        """End of blanking, s."""
        return self.prediction.board.blanking_end

    @property
    def detected(self) -> float | None:
        """The time at which the echo crosses the threshold, s; None without an echo."""
        distance = float(self.prediction.distances[self.index])
        return None if np.isnan(distance) else 2 * distance / self.speed

    @property
    def duration(self) -> float:
        """The time until shortly after the detection, s; without an echo, until the board stops listening."""
        last = max((way.echo.time for way in self.ways), default=0.0) if self.every else 0.0
        end = 2 * self.prediction.board.max_range / self.speed
        return min((1 + _AFTER) * max(self.detected or end, last), end)

    @property
    def title(self) -> str:
        """The heading, and the reported range if there is one."""
        found = float(self.prediction.ranges[self.index])
        return f"{heading_text(self.heading)}: " + ("no echo" if np.isnan(found) else f"reads {found:.3f} m")


def moment_at(ping: PlayedPing, time: float) -> tuple[Pulse, ...]:
    """Return the sound on each path `time` s after transmission began."""
    burst = ping.prediction.board.transmit_cycles / ping.prediction.board.frequency
    pulses = []
    for way in ping.ways:
        # in the plan, sound with a slope travels a shorter way in the same time
        length = float(np.hypot(*np.diff(way.points, axis=0).T).sum())
        per_second = length / way.echo.time
        head = time * per_second
        trail = stretch_between(way.points, head - burst * per_second, head)
        front = front_at(way.points, head, min(_WIDEST_FRONT, _FRONT / max(head, 1e-9)), way.bend)
        pulses.append(Pulse(way, trail, front, min(1.0, time / way.echo.time)))
    return tuple(pulses)


def counted_position(ping: PlayedPing, time: float) -> FloatArray:
    """Return the point whose range the board would report for an echo at `time`, (2,) float, m.

    It moves along the heading with half the speed of sound, and stops when an echo is detected.
    """
    until = time if ping.detected is None else min(time, ping.detected)
    away = ping.speed * until / 2
    ends = np.array([ping.prediction.standpoints[ping.index], ping.prediction.standpoints[ping.index]])
    ends[1] += away * np.array([np.cos(ping.heading), np.sin(ping.heading)])
    return position_at(ends, away)
