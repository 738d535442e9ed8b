"""Figures 3 and 4: three scans of a laboratory from a table top, drawn in one plan."""

import math
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure
from sonarhw_sim.air import Receiver
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.room import Room

from sonarhw.readings import FloatArray
from sonarhw_compare.paper.drawing import GREEN, MEASURED, PREDICTED, finish_plan, note, points, sheet
from sonarhw_compare.paper.exhibit import Claim, Exhibit
from sonarhw_compare.paper.setting import PaperScene, PredictedReading, ranges, span
from sonarhw_compare.pictures.overlay_picture import draw_room, mark_sensors

SCANS = tuple(
    PaperScene("figure3_4", "table", (start, start + 360, 5.0), "polaroid-6500", receiver=Receiver.FIRST_ECHO)
    for start in (0.0, 1.5, 3.0)
)
BESIDE_THE_BLACKBOARD = replace(SCANS[0], place="beside")
BESIDE_THE_CLOSET = tuple(replace(scene, place="corner") for scene in SCANS)
_CORNER = "closet-front/closet-side"
_TO_THE_WALL = 270.0  # degrees
_PROTRUSION = 0.020  # m


def near_wall_over_a_short_span(scenes: tuple[PaperScene, ...] = SCANS) -> Claim:
    """Check the readings of the blackboard and beside it."""
    readings = _together(scenes)
    middle = next(k for k, reading in enumerate(readings) if reading.degrees == _TO_THE_WALL)
    first = last = middle
    while readings[first - 1].via == readings[middle].via:
        first -= 1
    while readings[last + 1].via == readings[middle].via:
        last += 1
    wall, beyond = readings[first : last + 1], ranges([readings[first - 1], readings[last + 1]])
    near = ranges(wall)[0]
    return Claim(
        "the nearer wall is found over a short span, and beside it readings are very long",
        f"{near:.3f} m over {span(wall)}, then {' and '.join(f'{far:.2f} m' for far in beyond)}",
        wall[-1].degrees - wall[0].degrees < 40 and len(beyond) == 2 and min(beyond) > 2 * near,
    )


def blackboard_moves_the_wall(before: PaperScene = SCANS[0], beside: PaperScene = BESIDE_THE_BLACKBOARD) -> Claim:
    """Compare the readings in front of the blackboard and in front of the bare wall."""
    blackboard, bare = before.at(_TO_THE_WALL).range, beside.at(_TO_THE_WALL).range
    moved = math.nan if blackboard is None or bare is None else bare - blackboard
    return Claim(
        "a blackboard that protrudes 20 mm from its wall moves the wall",
        f"{bare:.3f} m in front of the wall, {blackboard:.3f} m in front of the blackboard: {moved * 1000:.1f} mm",
        abs(moved - _PROTRUSION) < 1e-3,
    )


def protruding_corner_is_strong(
    scenes: tuple[PaperScene, ...] = SCANS, beside: tuple[PaperScene, ...] = BESIDE_THE_CLOSET
) -> Claim:
    """Check the level of the outer corner, a sharp edge."""
    readings, level = _readings_off(scenes, _CORNER), _loudest(scenes, _CORNER)
    threshold = scenes[0].scan.board.threshold_db
    return Claim(
        "a protruding corner returns a strong echo",
        f"a sharp edge, far from the normals of both its faces: {level:.1f} dB, {len(readings)} readings, threshold "
        f"{threshold:g} dB; 8° beside the normal of one face, where an edge is loud: "
        f"{_loudest(beside, _CORNER):.1f} dB, {len(_readings_off(beside, _CORNER))} readings",
        len(readings) >= 5 and level > threshold + 12,
    )


def person_is_strong(scenes: tuple[PaperScene, ...] = SCANS, person: str = "person") -> Claim:
    """Check that the person is loud, and appears wider than its true angle."""
    readings, level, wide = _readings_off(scenes, person), _loudest(scenes, person), _width(scenes[0], person)
    seen = 5.0 / len(scenes) * len(readings)
    return Claim(
        "people return strong echoes",
        f"{len(readings)} readings over {seen:.0f}°, up to {level:.1f} dB; the person is {wide:.0f}° wide",
        seen > 1.2 * wide and level > scenes[0].scan.board.threshold_db + 12,
    )


def pillar_is_half_lost(scenes: tuple[PaperScene, ...] = SCANS, pillar: str = "pillar") -> Claim:
    """Check which headings towards the pillar read it, and that at the others the sound goes on to other walls."""
    towards = [reading for reading in _together(scenes) if _points_at(scenes[0], reading.degrees, pillar)]
    read = [reading for reading in towards if reading.via == (pillar,)]
    lost = [reading for reading in towards if reading.via != (pillar,)]
    away = sum(pillar in reading.via for reading in lost)
    near, others = min(ranges(read), default=math.nan), min(ranges(lost), default=math.inf)
    return Claim(
        "only half of a pillar is detected, because part of the signal is reflected away",
        f"{len(read)} of the {len(towards)} headings towards it read it, at {near:.2f} m; the others read at least "
        f"{others:.2f} m, {away} of them by the pillar and another wall",
        bool(towards) and 0.35 <= len(read) / len(towards) <= 0.65 and others > 2 * near and away > 0,
    )


def _together(scenes: tuple[PaperScene, ...]) -> list[PredictedReading]:
    """Return all readings sorted by heading, from 0 to 360°."""
    readings = [replace(reading, degrees=reading.degrees % 360) for scene in scenes for reading in scene.readings]
    return sorted(readings, key=lambda reading: reading.degrees)


def _readings_off(scenes: tuple[PaperScene, ...], name: str) -> list[PredictedReading]:
    """Return the readings by one reflection off an object, sorted by heading from -180 to 180°."""
    readings = [reading for scene in scenes for reading in scene.readings_via(name)]
    turned = [replace(reading, degrees=(reading.degrees + 180) % 360 - 180) for reading in readings]
    return sorted(turned, key=lambda reading: reading.degrees)


def _loudest(scenes: tuple[PaperScene, ...], name: str) -> float:
    """Return the highest level of the echo by one reflection off an object, dB."""
    return max(float(level) for scene in scenes for level in _levels(scene, name))


def _levels(scene: PaperScene, name: str) -> list[float]:
    """Return the level at each heading of the echo by one reflection off an object, dB."""
    scan = scene.scan
    path = _straight_from(scan.paths, scan.room, name)
    pings = (scan.ping(k) for k in range(len(scan.headings)))
    return [float(ping.levels[path]) if path is not None else -math.inf for ping in pings]


def _straight_from(paths: Paths, room: Room, name: str) -> int | None:
    rows = (k for k in range(len(paths)) if paths.via(k, room) == (name,))
    return next(rows, None)


def _width(scene: PaperScene, post: str) -> float:
    """Return the angular width of a post as seen from the sensor, degrees."""
    away, radius = _towards(scene, post)
    return 2 * math.degrees(math.asin(radius / np.hypot(*away)))


def _points_at(scene: PaperScene, degrees: float, post: str) -> bool:
    """Return whether the axis at this heading meets a post."""
    (x, y), _ = _towards(scene, post)
    aside = (degrees - math.degrees(math.atan2(y, x)) + 180) % 360 - 180
    return abs(aside) <= _width(scene, post) / 2


def _towards(scene: PaperScene, post: str) -> tuple[FloatArray, float]:
    """Return the vector from the sensor to the centre of a post, and its radius, m."""
    room = scene.scan.room
    x, y, radius = room.posts[room.names.index(post) - len(room.walls)]
    return np.array([x, y]) - scene.scan.place.position, float(radius)


def _draw() -> Figure:
    figure = sheet(9, 8)
    axes = figure.add_subplot()
    draw_room(axes, SCANS[0].scan.room)
    looks = ((PREDICTED, "o"), (MEASURED, "s"), (GREEN, "D"))
    for scene, (colour, marker) in zip(SCANS, looks, strict=True):
        points(axes, scene, f"every 5° from {scene.degrees[0]:g}°", colour, marker, 4)
    mark_sensors(axes, SCANS[0].scan.place.position)
    note(axes, "blackboard", (1.8, 0.02), (1.8, 0.55))
    note(axes, "outer corner", (3.6, 3.0), (2.9, 2.6))
    note(axes, "person", (3.7, 1.5), (3.2, 1.0))
    note(axes, "pillar, half lost", (1.121, 1.95), (1.2, 2.75))
    finish_plan(axes, "Laboratory: three scans in one plan", (-5.2, 8.8, -5.2, 6.8), "upper left")
    return figure


EXHIBITS = (
    Exhibit(
        "figure3_4",
        "Figures 3 and 4: a laboratory from a table top",
        "Three scans in one plan, one reading every 5°. The room resembles the paper's; its dimensions are ours. The "
        "outer corner is sharp; the paper does not say how it was seen. The pillar is round and 0.6 m thick, with "
        "nothing in front of it.",
        SCANS,
        _draw,
        (
            near_wall_over_a_short_span,
            blackboard_moves_the_wall,
            protruding_corner_is_strong,
            person_is_strong,
            pillar_is_half_lost,
        ),
    ),
)
