"""Paths heading by heading, for bodies and faces that move when the head turns.

Every path exists at one heading only, so each heading needs its own search. If nothing but the beam turns, one search
serves all headings (`sonarhw_sim.predict.prediction`).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sonarhw.readings import FloatArray
from sonarhw_sim.board.mount import FACE, Mount, TransducerPose, with_body, with_faces
from sonarhw_sim.board.profile import Board
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.model import Place, Room

_ON_OWN_FACE = 1e-9  # m: longest leg between a transducer and its own face


@dataclass(frozen=True)
class HeadingPaths:
    """The paths of several headings, shortest first."""

    room: Room  # with the body, and the faces as they are at the first heading
    paths: Paths  # (p,)
    only_at: NDArray[np.intp]  # (p,): row of the heading at which each path exists
    sender_headings: FloatArray  # (p,), rad: heading of its sender
    lateness: FloatArray  # (p,), m: apparent extra length, because its ping was sent later than the receiver's


@dataclass(frozen=True)
class SensorPair:
    """One sender and one receiver, and the greatest length of paths between them."""

    sender: TransducerPose
    listener: TransducerPose
    lateness: float  # m
    max_length: float  # m


Find = Callable[[Room, SensorPair], Paths]  # returns the paths of a pair in the room that are worth keeping


def find_by_heading(
    room: Room, place: Place, board: Board, headings: FloatArray, find: Find, face_reflectance: float | None
) -> HeadingPaths:
    """Return the paths received at `headings` (n,) rad, at least one, within range by the receiver's own time.

    The place is at the turning axis.

    Paths longer than twice that range are omitted too. `face_reflectance` is the reflectance of the faces; with None
    sound passes them.
    """
    mounting, speed = board.mounting, room.air.speed_of_sound
    room = with_body(room, place, mounting.body_radius)
    shown, found = room, []
    for k, heading in enumerate(headings):
        listener, senders = mounting.pose(place, float(heading)), mounting.senders(place, float(heading))
        room_with_faces = room
        if face_reflectance is not None:
            room_with_faces = with_faces(room, senders, board.aperture_radius, face_reflectance, place.height)
        shown = shown if k else room_with_faces
        pairs = _pairs(listener, senders, 2 * board.max_range, speed)
        found += [(_without_own_face(find(room_with_faces, pair), room_with_faces), k, pair) for pair in pairs]
    return _joined(shown, found)


def standpoints(board: Board, place: Place, headings: FloatArray) -> FloatArray:
    """Return the position of the receiving transducer at `headings` (n,) rad in the room, (n, 2) float, m.

    For a ring, this is the position of a sensor with that heading.
    """
    ahead, left = arm(board)
    cosines, sines = np.cos(headings), np.sin(headings)
    aside = np.column_stack((ahead * cosines - left * sines, ahead * sines + left * cosines))
    return np.asarray(aside + board.at_axis(place).position)


def arm(board: Board) -> tuple[float, float]:
    """Return how far the receiving transducer is ahead of the turning axis, and to its left, m."""
    mount = board.mount if board.ring is None else Mount(ahead=board.ring.radius)
    return mount.ahead, mount.aside - mount.separation / 2


def _pairs(
    listener: TransducerPose, senders: tuple[TransducerPose, ...], max_length: float, speed: float
) -> Iterator[SensorPair]:
    for sender in senders:
        lateness = (sender.ping_time - listener.ping_time) * speed
        longest = min(max_length, max_length - lateness)
        # otherwise all sound arrives before the receiver's own ping or after its range
        if longest > max(0.0, -lateness):
            yield SensorPair(sender, listener, lateness, longest)


def _without_own_face(paths: Paths, room: Room) -> Paths:
    """Return the paths without reflections at a face where they start or end, because that sound is counted already."""
    is_face = np.append(np.array(room.names) == FACE, False)[paths.surfaces].any(axis=1)
    at_own_face = (_first_legs(paths) <= _ON_OWN_FACE) | (_last_legs(paths) <= _ON_OWN_FACE)
    return paths.select(np.flatnonzero(~(at_own_face & is_face)))


def _first_legs(paths: Paths) -> FloatArray:
    return np.asarray(np.hypot(*(paths.points[:, 1] - paths.points[:, 0]).T))


def _last_legs(paths: Paths) -> FloatArray:
    rows, last = np.arange(len(paths)), (~np.isnan(paths.points[:, :, 0])).sum(axis=1) - 1
    return np.asarray(np.hypot(*(paths.points[rows, last] - paths.points[rows, last - 1]).T))


def _joined(room: Room, found: list[tuple[Paths, int, SensorPair]]) -> HeadingPaths:
    counts = [len(paths) for paths, _, _ in found]
    paths = Paths.join([paths for paths, _, _ in found])
    lateness = np.repeat(np.array([pair.lateness for _, _, pair in found], dtype=np.float64), counts)
    order = np.argsort(paths.lengths + lateness, kind="stable")
    return HeadingPaths(
        room,
        paths.select(order),
        np.repeat(np.array([k for _, k, _ in found], dtype=np.intp), counts)[order],
        np.repeat(np.array([pair.sender.heading for _, _, pair in found], dtype=np.float64), counts)[order],
        lateness[order],
    )
