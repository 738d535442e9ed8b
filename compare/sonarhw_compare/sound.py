"""One ping at one heading over time: the paths of its sound, blanking, and the moment of detection."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw.errors import heading_text
from sonarhw.readings import FloatArray
from sonarhw_compare.explain import LengthText, RankedEcho, describe_path, in_metres, ranked_echoes

# Where sound is on a path at a given time: pure functions on points and lengths.
#
# A path is (k, 2) float, m: source, reflections, receiver. `travelled` is a length along it, m.


_ARC_POINTS = 25


def position_at(points: FloatArray, travelled: float) -> FloatArray:
    """Return the point of a path after a length, (2,) float, m; before its begin and after its end, that end."""
    reached = _reached(points)
    return np.array([np.interp(travelled, reached, points[:, axis]) for axis in (0, 1)])


def stretch_between(points: FloatArray, begin: float, end: float) -> FloatArray:
    """Return the part of a path between two lengths with its corners, (m, 2) float, m; empty if there is none."""
    reached = _reached(points)
    begin, end = max(begin, 0.0), min(end, float(reached[-1]))
    if begin >= end:
        return np.empty((0, 2))
    corners = points[(reached > begin) & (reached < end)]
    return np.vstack((position_at(points, begin), corners, position_at(points, end)))


def front_at(points: FloatArray, travelled: float, half_angle: float, bend: int | None = None) -> FloatArray:
    """Return the wavefront about a path after a length, (m, 2) float, m: an arc, empty before begin and after end.

    Its centre is the image of the source in the walls so far, or from the corner `bend` on, which is a diffracting
    edge, that of the edge. `half_angle`, rad, is that of the part shown; curved surfaces are treated as flat.
    """
    reached = _reached(points)
    if not 0 < travelled <= reached[-1]:
        return np.empty((0, 2))
    leg = min(int(np.searchsorted(reached, travelled)), len(points) - 1)  # the leg that ends at this corner
    start, stop = points[leg - 1], points[leg]
    direction = math.atan2(stop[1] - start[1], stop[0] - start[0])
    radius = travelled - (float(reached[bend]) if bend is not None and leg > bend else 0.0)
    head = position_at(points, travelled)
    centre = head - radius * np.array([math.cos(direction), math.sin(direction)])
    angles = direction + np.linspace(-half_angle, half_angle, _ARC_POINTS)
    return np.asarray(centre + radius * np.column_stack((np.cos(angles), np.sin(angles))))


def _reached(points: FloatArray) -> NDArray[np.float64]:
    """Return the length from the begin of a path to each of its points, (k,) float, m."""
    legs = np.hypot(*np.diff(points, axis=0).T)
    return np.concatenate(([0.0], np.cumsum(legs)))


# One ping at one heading over time: the paths of its sound, blanking, and the moment of detection.
#
# Sound travels along the paths of the echoes that matter: the winner and what lies within blanking, or every echo
# over the threshold. `moment_at` says where all of it is at one time.


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
        echoes = ranked_echoes(self.prediction, self.index)
        shown = [echo for echo in echoes if echo.wins or (not echo.too_weak and (echo.blanked or self.every))]
        shown, paths = shown[:_MOST_PATHS], self.prediction.paths
        bends = [int(paths.bends[echo.path]) + 1 if paths.edges[echo.path] >= 0 else None for echo in shown]
        return tuple(SoundWay(echo, paths.outline(echo.path), bend) for echo, bend in zip(shown, bends, strict=True))

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
        range_ = float(self.prediction.ranges[self.index])
        return f"{heading_text(self.heading)}: " + ("no echo" if np.isnan(range_) else f"reads {range_:.3f} m")


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


# One line on what happens at a moment of a ping.


_SHOWN = 6e-4  # s for which an echo within blanking is mentioned; a film shows it for half a second


def caption_at(ping: PlayedPing, time: float, text: LengthText = in_metres) -> str:
    """Return what happens `time` s after transmission began, with the time in milliseconds."""
    return f"{time * 1e3:.2f} ms: {_event(ping, time, text)}"


def _event(ping: PlayedPing, time: float, text: LengthText) -> str:
    board = ping.prediction.board
    blanked = [way for way in ping.ways if way.echo.blanked and way.echo.time <= time < way.echo.time + _SHOWN]
    if ping.detected is not None and time >= ping.detected:
        range_ = float(ping.prediction.ranges[ping.index])
        return f"{_via(ping, ping.ways[0])} returns; the board would report {text(range_)}"
    if blanked:
        return f"the echo of {_via(ping, blanked[-1])} arrives within blanking and is not detected"
    if time < board.transmit_cycles / board.frequency:
        return "the board transmits"
    if time < ping.blanking:
        return "the board does not listen yet (blanking)"
    return "the board listens"


def _via(ping: PlayedPing, way: SoundWay) -> str:
    paths, room = ping.prediction.paths, ping.prediction.room
    if ping.prediction.winners[ping.index] < 0:
        return "noise"
    names = paths.via(way.echo.path, room)
    return ", ".join(names) if len(names) < 5 else describe_path(ping.prediction, way.echo.path).split(",")[0]
