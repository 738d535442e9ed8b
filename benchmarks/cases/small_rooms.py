"""Random small rooms with legs, cables, door jambs, ducts and skirtings, for the product and for boundary elements."""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from sonarhw_sim.air import Air, EdgeStrength
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.board.signal import burst_spectrum
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, Room, parse_room

from tests.oracles.exact.room_waves import (
    Band,
    Complexes,
    Floats,
    Pulse,
    RigidRoom,
    beam_at,
    beam_harmonics,
    burst_pulse,
    envelope,
    first_echoes,
    received,
    responses,
    short_pulse,
)

Point = tuple[float, float]

CLEAR = 0.1  # m, from the place to everything


@dataclass
class _Side:
    """One side of the outline, and the things on it: from, to (m along it), depth (m, inwards)."""

    begin: complex
    end: complex
    things: list[tuple[float, float, float, str]] = field(default_factory=list)

    def at(self, along: float, depth: float = 0.0) -> complex:
        way = (self.end - self.begin) / abs(self.end - self.begin)
        return self.begin + along * way + 1j * depth * way


@dataclass(frozen=True)
class SmallRoom:
    """One room round a place at the origin."""

    seed: int
    rigid: RigidRoom
    text: str  # of the room file

    @property
    def room(self) -> Room:
        """The room of the product."""
        return parse_room(self.text, f"small room {self.seed}")


def small_room(seed: int) -> SmallRoom:
    """Return a random room, 50 to 70 wavelengths long at 49.4 kHz."""
    random = np.random.default_rng((seed, 44))
    while True:
        corners = _outline(random)
        place = complex(*random.uniform((0.1, 0.1), (max(c.real for c in corners), max(c.imag for c in corners))))
        turn = np.exp(1j * random.uniform(0, math.tau))
        sides = [_Side(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
        if not _is_inside(place, corners) or min(_gap(place, side.begin, side.end) for side in sides) < CLEAR + 0.03:
            continue
        plates = _furnish(sides, random)
        posts = _posts(place, corners, sides, plates, random)
        if posts is not None and all(_gap(place, *plate) > CLEAR for plate in plates):
            return _made(seed, sides, plates, posts, (place, complex(turn)))


def _outline(random: Generator) -> list[complex]:
    """Return the corners of a rectangle, an oblique room or an L, counter-clockwise."""
    width, depth = float(random.uniform(0.36, 0.46)), float(random.uniform(0.31, 0.38))
    a, b = (random.uniform(0.2, 0.4, 2) * (width, depth)).tolist()
    skew = (random.uniform(-0.03, 0.03, 4) + 1j * random.uniform(-0.03, 0.03, 4)).tolist()
    rectangle = [0j, complex(width, 0), complex(width, depth), complex(0, depth)]
    shapes = [
        rectangle,
        [corner + moved for corner, moved in zip(rectangle, skew, strict=True)],
        [
            *rectangle[:2],
            complex(width, depth - b),
            complex(width - a, depth - b),
            complex(width - a, depth),
            1j * depth,
        ],
    ]
    return shapes[int(random.integers(len(shapes)))]


def _furnish(sides: list[_Side], random: Generator) -> list[tuple[complex, complex]]:
    """Put ducts, skirtings and niches of doors on sides; return thin jambs."""
    plates = []
    kinds = ["duct"] * int(random.integers(1, 3)) + ["skirting"] * int(random.integers(1, 3)) + ["niche", "jamb"]
    for kind in kinds:
        side = sides[int(random.integers(len(sides)))]
        length = abs(side.end - side.begin)
        width = {"duct": random.uniform(0.005, 0.03), "skirting": random.uniform(0.05, 0.15)}.get(kind, 0.0)
        width = {"niche": random.uniform(0.06, 0.1)}.get(kind, width)
        depth = {"duct": random.uniform(0.005, 0.02), "skirting": random.uniform(0.0015, 0.006)}.get(kind, 0.0)
        depth = {"niche": -random.uniform(0.005, 0.02)}.get(kind, depth)
        if length < width + 0.04:
            continue
        begin = float(random.uniform(0.02, length - 0.02 - width))
        if any(begin - 0.004 < b and a < begin + width + 0.004 for a, b, _, _ in side.things):
            continue
        if kind == "jamb":
            reach, lean = float(random.uniform(0.02, 0.06)), float(random.uniform(-0.6, 0.6))
            plates.append((side.at(begin), side.at(begin + reach * math.sin(lean), reach * math.cos(lean))))
        side.things.append((begin, begin + float(width), float(depth), "jamb" if kind == "niche" else kind))
    return plates


def _posts(
    place: complex,
    corners: list[complex],
    sides: list[_Side],
    plates: list[tuple[complex, complex]],
    random: Generator,
) -> list[tuple[complex, float, str]] | None:
    """Return legs of a chair or table and cables; None if there is no room for them."""
    posts: list[tuple[complex, float, str]] = []
    solid = [*plates, *((side.begin, side.end) for side in sides)]
    solid += [(side.at(a, d), side.at(b, d)) for side in sides for a, b, d, _ in side.things if d > 0]
    radius, width = float(random.uniform(0.003, 0.01)), float(random.uniform(0.03, 0.1))
    legs = [random.uniform(0.2, 0.8) * width * 1j, width * (1 + 0j), 0j, width * (1 + 1j)][: random.integers(1, 5)]
    wanted = [(leg, radius, "leg") for leg in legs]
    for _ in range(400):
        shift = complex(*random.uniform((0, 0), (0.46, 0.36)))
        moved = [(shift + leg, r, kind) for leg, r, kind in wanted]
        if all(_is_free(at, r, place, corners, solid, posts) for at, r, _ in moved):
            posts += moved
            break
    else:
        return None
    for _ in range(int(random.integers(0, 3))):
        at, r = complex(*random.uniform((0, 0), (0.46, 0.36))), float(random.uniform(0.0005, 0.002))
        if _is_free(at, r, place, corners, solid, posts):
            posts.append((at, r, "cable"))
    return posts


def _is_free(
    at: complex,
    radius: float,
    place: complex,
    corners: list[complex],
    solid: list[tuple[complex, complex]],
    posts: list[tuple[complex, float, str]],
) -> bool:
    apart = all(abs(at - other) > radius + r + 0.004 for other, r, _ in posts)
    free = all(_gap(at, *ends) > radius + 0.004 for ends in solid)
    return apart and free and abs(at - place) > radius + CLEAR and _is_inside(at, corners)


def _gap(point: complex, begin: complex, end: complex) -> float:
    along = end - begin
    share = min(max(((point - begin) * along.conjugate()).real / abs(along) ** 2, 0.0), 1.0)
    return abs(point - begin - share * along)


def _is_inside(point: complex, corners: list[complex]) -> bool:
    turns = [np.angle((b - point) / (a - point)) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    return abs(sum(turns)) > 3.0


def _made(
    seed: int,
    sides: list[_Side],
    plates: list[tuple[complex, complex]],
    posts: list[tuple[complex, float, str]],
    view: tuple[complex, complex],
) -> SmallRoom:
    """Return the room as seen from the place, turned; `view` is both. For the product, things stand on whole walls."""
    place, turn = view

    def seen(point: complex) -> Point:
        moved = turn * (point - place)
        return float(moved.real), float(moved.imag)

    outline: list[Point] = []
    walls: list[Point] = []
    chains: list[list[Point]] = []
    for side in sides:
        outline.append(seen(side.begin))
        walls.append(seen(side.begin))
        for a, b, depth, _ in sorted(side.things):
            around = [seen(side.at(a)), seen(side.at(a, depth)), seen(side.at(b, depth)), seen(side.at(b))]
            # a jamb touches the wall at a point, where elements have to end
            outline += around if depth else [around[0]]
            if depth > 0:
                chains.append(around)
            elif depth < 0:
                walls += around
    jambs = [(seen(a), seen(b)) for a, b in plates]
    standing = [(*seen(at), radius, kind) for at, radius, kind in posts]
    rigid = RigidRoom(outline, jambs, [(x, y, radius) for x, y, radius, _ in standing])
    named = [("outline", walls), *((f"thing{k}", chain) for k, chain in enumerate(chains))]
    named += [(f"jamb{k}", [*jamb]) for k, jamb in enumerate(jambs)]
    return SmallRoom(seed, rigid, _text(seed, named, standing))


def _text(seed: int, named: list[tuple[str, list[Point]]], posts: list[tuple[float, float, float, str]]) -> str:
    lines = [f'name = "small room {seed}"', "[materials.hard]", "reflectance = 1.0"]
    for name, points in named:
        text = ", ".join(f"[{x!r}, {y!r}]" for x, y in points)
        closed = str(name == "outline").lower()
        lines += ["[[walls]]", f'name = "{name}"', f"points = [{text}]", f"closed = {closed}", 'material = "hard"']
    for number, (x, y, radius, kind) in enumerate(posts):
        lines += ["[[posts]]", f'name = "{kind}{number}"', f"center = [{x!r}, {y!r}]"]
        lines += [f"radius = {radius!r}", 'material = "hard"']
    return "\n".join([*lines, "[places.here]", "position = [0.0, 0.0]"])


# Readings by boundary elements and by the product.

WAVELENGTH = 343.99 / 49_400
SPEED = Air().speed_of_sound
BAND = Band(WAVELENGTH, 0.95, 21)
ORDERS = 21
HEADINGS = np.radians(np.arange(0.0, 360.0, 3.0))
LIMITS = 0.13, 0.45  # m, of the range
SAMPLES = 1280  # of a time window
_SMALL = {
    "frequency": SPEED / WAVELENGTH,
    "aperture_radius": 0.008,  # so that the field is the far field in such rooms
    "blanking": 2 * LIMITS[0] / SPEED,
    "max_range": LIMITS[1],
    "own_burst_db": -300.0,
}
BOARDS = {
    # its own strength of edges, and arrivals that do not add up, are no waves
    "paper": replace(load_board("paper").with_numbers(_SMALL), edge_strength=EdgeStrength.UNIFORM, sum_arrivals=True),
    "6500": replace(load_board("polaroid-6500").with_numbers(_SMALL), gain_steps=(), absorption=False),
}


@dataclass(frozen=True)
class RoomReadings:
    """Readings of one board in a room, (h,) m each, NaN: no echo."""

    board: str
    wave: Floats  # (3, h): with the threshold 1 dB lower, as it is, 1 dB higher
    paths: Floats  # by the paths of the product, by the same receiver
    predicted: Floats
    via: list[str]

    def wrong(self, tolerance: float, column: str = "predicted") -> NDArray[np.bool_]:
        """Return which readings differ by more than a tolerance, m, (h,)."""
        return ~_equal(self.wave[1], getattr(self, column), tolerance)

    def unsure(self, tolerance: float, column: str = "predicted") -> NDArray[np.bool_]:
        """Return which readings are right with a threshold 1 dB lower or higher, (h,)."""
        return np.asarray(np.any([_equal(row, getattr(self, column), tolerance) for row in self.wave], axis=0))


def _equal(one: Floats, other: Floats, tolerance: float) -> NDArray[np.bool_]:
    return np.asarray((np.abs(one - other) <= tolerance) | (np.isnan(one) & np.isnan(other)))


def signal_of(solved: Complexes, beams: Sequence[Floats], headings: Floats) -> Complexes:
    """Return the impulse response at headings, (SAMPLES, h), of the harmonics of a room."""
    rows = zip(solved, BAND.wavenumbers.tolist(), beams, strict=True)
    return envelope(np.array([received(row, k, beam, headings) for row, k, beam in rows]), BAND, SAMPLES)


def beams_of(name: str) -> list[Floats]:
    """Return the harmonics of the beam at each frequency; for the paper's receiver, it is that of the carrier."""
    radius = BOARDS[name].aperture_radius
    offsets = np.zeros_like(BAND.offsets) if name == "paper" else BAND.offsets
    return [beam_harmonics((math.tau / WAVELENGTH + offset) * radius, ORDERS) for offset in offsets.tolist()]


def pulse_of(name: str) -> Pulse:
    """Return the pulse of a board: a short one for the paper's receiver, else its burst and its integration."""
    if name == "paper":
        return short_pulse(BAND, SAMPLES)
    board = BOARDS[name]
    above = np.asarray(np.fft.fftfreq(SAMPLES, BAND.window / SAMPLES) * SPEED, np.float64)
    return burst_pulse(BAND, SAMPLES, burst_spectrum(above, board), board.integration_cycles * WAVELENGTH)


def signal_of_paths(scan: PredictedScan, name: str) -> Complexes:
    """Return the impulse response at the headings of a scan, (SAMPLES, h), of its paths."""
    paths, radius = scan.paths, scan.board.aperture_radius
    away = np.stack((np.cos(scan.headings), np.sin(scan.headings)))
    leaving, arriving = paths.leaving @ away, paths.arriving @ away
    amplitudes, spectra = scan.phasors_of(paths) / np.sqrt(paths.lengths), []
    for k, offset in zip(BAND.wavenumbers.tolist(), BAND.offsets.tolist(), strict=True):
        ka = (math.tau / WAVELENGTH + (0.0 if name == "paper" else offset)) * radius
        beam = beam_at(leaving, ka) * beam_at(arriving, ka)
        spectra.append((amplitudes * np.exp(-1j * k * paths.lengths)) @ beam)
    return envelope(np.array(spectra), BAND, SAMPLES)


def compare(small: SmallRoom, solved: Complexes, name: str, headings: Floats = HEADINGS) -> RoomReadings:
    """Return the readings of a board in a room, from its solved responses (f, 2 o + 1, 2 o + 1)."""
    board, pulse = BOARDS[name], pulse_of(name)
    wave, at = signal_of(solved, beams_of(name), headings), board.threshold_db
    by_wave = [first_echoes(wave, BAND, pulse, 10 ** ((at + more) / 20), LIMITS) for more in (-1.0, 0.0, 1.0)]
    scan = predict_scan(small.room, Place("here", (0.0, 0.0)), board, headings)
    by_paths = first_echoes(signal_of_paths(scan, name), BAND, pulse, 10 ** (at / 20), LIMITS)
    return RoomReadings(name, np.array(by_wave), by_paths, scan.ranges, list(scan.columns()["via"]))


def responses_of(small: SmallRoom, folder: Path) -> Complexes:
    """Return the responses of a room, (f, 2 o + 1, 2 o + 1), from a file of the folder if it was solved before."""
    key = hashlib.sha256(repr((small.rigid, BAND, ORDERS)).encode()).hexdigest()[:16]
    path = folder / f"{key}.npy"
    if path.exists():
        return np.asarray(np.load(path))
    solved = np.stack(list(responses(small.rigid, BAND, ORDERS)))
    folder.mkdir(parents=True, exist_ok=True)
    new = path.with_suffix(".new.npy")
    np.save(new, solved)
    new.rename(path)
    return solved
