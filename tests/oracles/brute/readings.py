"""Readings from all ways: sound bent by one edge, sums of arrivals, and the threshold."""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from scipy.special import j1, modfresnelm

from tests.oracles.brute.exhaustive import Floats, Scene, Way, all_ways

TIE_DB = 0.01  # to each side of the threshold, where a reading is unsure
_FAINT_DB = 20.0  # below the threshold: a fainter path begins no arrival
_SAME = 1e-9  # m


@dataclass(frozen=True)
class Sensor:
    """What decides whether sound is detected."""

    ka: float
    threshold_db: float
    nearest: float  # m of path, at the end of blanking
    longest: float  # m of path
    most: int  # reflections


@dataclass(frozen=True)
class Sound:
    """All paths, shortest first."""

    lengths: Floats  # (p,), m
    departures: Floats  # (p, 2): horizontal part of the unit vector
    arrivals: Floats  # (p, 2), from which sound comes
    phasors: np.ndarray  # (p,) complex


@dataclass(frozen=True)
class Wedge:
    """The air between two neighbouring walls at a vertex."""

    point: Floats
    start: float  # rad
    opening: float  # rad
    reflectances: tuple[float, float]  # of the first and the last face, counter-clockwise


def all_sound(scene: Scene, sensor: Sensor) -> Sound:
    """Return every path from the sensor back to it, also by one edge."""
    mirrored = [way for way in all_ways(scene, scene.position, sensor.most, sensor.longest) if way.touches]
    rows = [(way.length, _away(way.points), _away(way.points[::-1]), way.gain) for way in mirrored]
    for wedge in wedges(scene):
        ways = [way for way in all_ways(scene, wedge.point, sensor.most, sensor.longest) if _enters(way, wedge)]
        for out, back in itertools.product(ways, repeat=2):
            length = out.length + back.length
            if out.touches + back.touches <= sensor.most and length <= sensor.longest:
                bent = out.gain * back.gain * _bent(scene, wedge, out, back)
                rows.append((length, _away(out.points), _away(back.points), bent))
    lengths, out_of, into, strengths = (np.array(column) for column in zip(*rows, strict=True))
    return sound_of(lengths, out_of, into, strengths, sensor, scene.wavelength)


def sound_of(
    lengths: Floats, departures: Floats, arrivals: Floats, strengths: Floats, sensor: Sensor, wavelength: float
) -> Sound:
    """Return these paths in order, as far as they are in time."""
    rows = np.argsort(lengths, kind="stable")
    rows = rows[(lengths[rows] >= sensor.nearest) & (lengths[rows] <= sensor.longest)]
    phasors = strengths[rows] * np.exp(-1j * math.tau / wavelength * lengths[rows])
    return Sound(lengths[rows], departures[rows], arrivals[rows], phasors)


def _away(points: Floats) -> Floats:
    way = points[1] - points[0]
    return np.asarray(way / math.hypot(*way))


def wedges(scene: Scene) -> list[Wedge]:
    """Return the wedges at the ends of walls, which meet at ends only, apart from those that divide half a turn."""
    faces: dict[tuple[float, float], list[tuple[float, int]]] = {}
    for wall, (x, y, u, v) in enumerate(scene.walls.tolist()):
        faces.setdefault((x, y), []).append((math.atan2(v - y, u - x) % math.tau, wall))
        faces.setdefault((u, v), []).append((math.atan2(y - v, x - u) % math.tau, wall))
    found = []
    for point, meeting in faces.items():
        meeting.sort()
        for (start, wall), (end, next_wall) in zip(meeting, [*meeting[1:], meeting[0]], strict=True):
            opening = (end - start) % math.tau or math.tau
            if abs(math.pi / opening - round(math.pi / opening)) > 1e-6 or opening > math.pi * 1.1:
                both = float(scene.reflectances[wall]), float(scene.reflectances[next_wall])
                found.append(Wedge(np.array(point), start, opening, both))
    return found


def _angle(way: Way, wedge: Wedge) -> float:
    return (math.atan2(*(way.points[-2] - wedge.point)[::-1]) - wedge.start) % math.tau


def _enters(way: Way, wedge: Wedge) -> bool:
    return 1e-9 < _angle(way, wedge) < wedge.opening - 1e-9


def _bent(scene: Scene, wedge: Wedge, out: Way, back: Way) -> complex:
    """Return the strength of an edge relative to a mirror, by Kouyoumjian and Pathak and the rules of `model.md`.

    As printed: D = -e^{-jπ/4}/(2n√2πk) Σ cot((π ± β)/2n) F(kL a±(β)), and the step of each term at its boundary.
    """
    k, n = math.tau / scene.wavelength, wedge.opening / math.pi
    distance = out.length * back.length / (out.length + back.length)
    first, last = wedge.reflectances
    one, other = _angle(out, wedge), _angle(back, wedge)
    shadow = 1 - 0.5 * math.cos((one - other) / 2) ** 2 * (1 - (first + last) / 2)
    total = 0j
    # with the number of reflections by the face of a term itself, which its weight contains
    for apart, weights, own in ((one - other, (shadow, shadow), 0), (one + other, (last, first), 1)):
        for sign, weight in zip((1, -1), weights, strict=True):
            images = round((math.pi + sign * apart) / (math.tau * n))
            near = 2 * math.cos((math.tau * n * images * sign - apart) / 2) ** 2
            term = weight * _term((math.pi + sign * apart) / (2 * n), n, k * distance, near)
            # in an inner corner, the nearest image source may be that of several reflections
            several = max(images - own, 0) if sign == 1 else abs(images)
            total += term * (first * last) ** several if n < 1 else term
    return total * min(1.0, max(first, last) / max(abs(total), 1e-300))


def _term(angle: float, n: float, scale: float, near: float) -> complex:
    root = math.sqrt(scale * near)
    transition = 2j * root * np.exp(1j * root**2) * modfresnelm(root)[0]
    return complex(-np.exp(-0.25j * math.pi) / (2 * n * math.sqrt(math.tau * scale)) / math.tan(angle) * transition)


def _beam(cosines: Floats, ka: float) -> Floats:
    x = ka * np.sqrt(np.maximum(1 - cosines**2, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        disc = np.where(np.abs(x) < 1e-9, 1.0, 2 * j1(x) / x)
    return np.asarray(np.where(cosines > 0, disc * cosines, 0.0))


def readings(wavelength: float, sensor: Sensor, sound: Sound, headings: Floats) -> Floats:
    """Return the range (m, NaN: none) at each heading, (h, 3): threshold lower by a tie, as it is, higher by a tie."""
    begins = np.searchsorted(sound.lengths, sound.lengths - _SAME)
    ends = np.searchsorted(sound.lengths, sound.lengths + wavelength, side="right")
    found = np.full((len(headings), 3), np.nan)
    for row, heading in enumerate(headings.tolist()):
        along = np.array([math.cos(heading), math.sin(heading)])
        beams = _beam(sound.departures @ along, sensor.ka) * _beam(sound.arrivals @ along, sensor.ka)
        arriving = beams * sound.phasors
        sums = np.append(0j, np.cumsum(arriving))
        levels = np.abs(sums[ends] - sums[begins])
        for column, tie in enumerate((-TIE_DB, 0.0, TIE_DB)):
            threshold = 10 ** ((sensor.threshold_db + tie) / 20)
            begin = np.abs(arriving) >= threshold * 10 ** (-_FAINT_DB / 20)
            over = np.flatnonzero(begin & (levels >= threshold))
            if len(over):
                members = np.abs(arriving[begins[over[0]] : ends[over[0]]])
                loudest = int((members >= members.max() * (1 - 1e-9)).argmax())
                found[row, column] = sound.lengths[begins[over[0]] + loudest] / 2
    return found
