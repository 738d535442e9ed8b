"""Paths heading by heading: for carriers and faces that stand somewhere else, or stand in the way, as the head turns.

Takes a room, a place, a board and headings; hands on the `HeadingPaths` of all of them together. Every path is
there at one heading only, so each heading costs a search of its own; where nothing turns but the beam, one search
serves them all (`sonarhw_sim.predict.prediction`).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.mount import FACE, Mount, TransducerPose, with_body, with_faces
from sonarhw_sim.board.profile import Board
from sonarhw_sim.rays.paths import Paths, join_paths
from sonarhw_sim.room.model import Place, Room

_AT_ONCE = 1e-9  # m: a leg between transducer and its own face that is no longer leads nowhere


@dataclass(frozen=True)
class HeadingPaths:
    """The paths of several headings, shortest first."""

    room: Room  # with the carrier's body in it, and the faces as they stand at the first heading
    paths: Paths  # (p,)
    only_at: NDArray[np.intp]  # (p,): row of the heading at which each is heard
    sender_headings: FloatArray  # (p,), rad: where its sender points
    lateness: FloatArray  # (p,), m: how much longer each seems, its ping having been sent later than the listener's


@dataclass(frozen=True)
class SensorPair:
    """One sender and one listener, and how long paths between them may be."""

    sender: TransducerPose
    listener: TransducerPose
    lateness: float  # m
    max_length: float  # m


Find = Callable[[Room, SensorPair], Paths]  # the paths of a leg in the room, those worth keeping


def find_by_heading(
    room: Room, place: Place, board: Board, headings: FloatArray, find: Find, face_reflectance: float | None
) -> HeadingPaths:
    """The paths heard at `headings` (n,) rad, one at least, within the board's range by the listener's own time.

    No longer than twice that range either: what has gone farther is taken for lost. `face_reflectance` is what faces
    leave of sound that meets them; None: it passes.
    """
    carrier, speed = board.carrier, room.air.speed_of_sound
    room = with_body(room, place, carrier.body_radius)
    shown, found = room, []
    for k, heading in enumerate(headings):
        listener, senders = carrier.pose(place, float(heading)), carrier.senders(place, float(heading))
        room_with_faces = room
        if face_reflectance is not None:
            room_with_faces = with_faces(room, senders, board.aperture_radius, face_reflectance, place.height)
        shown = shown if k else room_with_faces
        pairs = _pairs(listener, senders, 2 * board.max_range, speed)
        found += [(_without_idle(find(room_with_faces, pair), room_with_faces), k, pair) for pair in pairs]
    return _joined(shown, found)


def standpoints(board: Board, place: Place, headings: FloatArray) -> FloatArray:
    """Where the listening transducer stands at `headings` (n,) rad in the room, (n, 2) float, m.

    For a ring, where a sensor would that points there.
    """
    ahead, left = arm(board)
    cosines, sines = np.cos(headings), np.sin(headings)
    aside = np.column_stack((ahead * cosines - left * sines, ahead * sines + left * cosines))
    return np.asarray(aside + place.position)


def arm(board: Board) -> tuple[float, float]:
    """How far ahead of the turning axis the listening transducer stands, and how far to the left, m."""
    mount = board.mount if board.ring is None else Mount(ahead=board.ring.radius)
    return mount.ahead, mount.aside - mount.separation / 2


def _pairs(
    listener: TransducerPose, senders: tuple[TransducerPose, ...], max_length: float, speed: float
) -> Iterator[SensorPair]:
    for sender in senders:
        lateness = (sender.ping_time - listener.ping_time) * speed
        longest = min(max_length, max_length - lateness)
        # else it is over before the listener's own ping, or comes after its time
        if longest > max(0.0, -lateness):
            yield SensorPair(sender, listener, lateness, longest)


def _without_idle(paths: Paths, room: Room) -> Paths:
    """The paths but for those that go off a face right where they start or end: that sound is counted without."""
    is_face = np.append(np.array(room.names) == FACE, False)[paths.surfaces].any(axis=1)
    idle = (_first_legs(paths) <= _AT_ONCE) | (_last_legs(paths) <= _AT_ONCE)
    return paths.select(np.flatnonzero(~(idle & is_face)))


def _first_legs(paths: Paths) -> FloatArray:
    return np.asarray(np.hypot(*(paths.points[:, 1] - paths.points[:, 0]).T))


def _last_legs(paths: Paths) -> FloatArray:
    rows, last = np.arange(len(paths)), (~np.isnan(paths.points[:, :, 0])).sum(axis=1) - 1
    return np.asarray(np.hypot(*(paths.points[rows, last] - paths.points[rows, last - 1]).T))


def _joined(room: Room, found: list[tuple[Paths, int, SensorPair]]) -> HeadingPaths:
    counts = [len(paths) for paths, _, _ in found]
    paths = join_paths([paths for paths, _, _ in found])
    lateness = np.repeat(np.array([pair.lateness for _, _, pair in found], dtype=np.float64), counts)
    order = np.argsort(paths.lengths + lateness, kind="stable")
    return HeadingPaths(
        room,
        paths.select(order),
        np.repeat(np.array([k for _, k, _ in found], dtype=np.intp), counts)[order],
        np.repeat(np.array([pair.sender.heading for _, _, pair in found], dtype=np.float64), counts)[order],
        lateness[order],
    )
