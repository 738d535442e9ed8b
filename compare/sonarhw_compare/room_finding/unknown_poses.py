"""The room and the poses of scans of which only some poses are known: simultaneous localisation and mapping.

The scans with known poses give a first room. The others are located in it, and those that it explains well extend it,
until all scans are placed or the rest cannot be located.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.model import Place

from sonarhw.errors import InputError
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.locate.poses import Pose, locate_scan
from sonarhw_compare.room_finding.evidence import FOLLOWED, REFLECTANCE, Course, PoseSpread
from sonarhw_compare.room_finding.room_search import FoundRoom, find_room

_LOCATED = PoseSpread(0.05, 0.06)  # m, rad: of a located scan; wide, because the scan itself gives its pose
_AS_GOOD = 0.5  # of the share that the room explains of its own scans, at which a scan is placed at once
_POOR = 0.25  # of that share; a scan that is explained less is not placed at all
_PROBABLE = 0.5  # least probability of a pose at which its scan is placed at once


@dataclass(frozen=True)
class PlacedRoom:
    """A room found from scans, and the poses found with it."""

    found: FoundRoom
    scans: tuple[PlacedScan, ...]  # those of the room, at their refined places
    # possible poses of each located scan, by its title, in the room of the scans before it
    poses: dict[str, tuple[Pose, ...]]
    left_out: tuple[str, ...]  # titles of the scans that could not be located


def find_room_and_poses(
    scans: Sequence[PlacedScan],
    board: Board,
    air: Air,
    spreads: Sequence[PoseSpread | None] = (),
    tick: Callable[[float], None] = lambda _share: None,
    course: Course | None = None,
) -> PlacedRoom:
    """Return the room and the poses that explain scans; a spread of None is an unknown pose, by default all are exact.

    `tick` receives the completed share, 0..1; `course` continues a search. Raises InputError as `find_room` does, and
    if no pose is known.
    """
    spreads = spreads or [PoseSpread()] * len(scans)
    known = {k: spread for k, spread in enumerate(spreads) if spread is not None}
    if not known:
        raise InputError("no pose is known; give that of the first log")
    placed = {k: scans[k] for k in known}
    steps = len(scans) - len(placed) + 1  # of which each ends with a room, at most

    def found_with(step: int) -> FoundRoom:
        own = [known.get(k, _LOCATED) for k in sorted(placed)]
        given = [placed[k] for k in sorted(placed)]
        return find_room(given, board, air, own, lambda share: tick((step + share) / steps), course)

    found, step = found_with(0), 0
    poses: dict[int, tuple[Pose, ...]] = {}
    while waiting := [k for k in range(len(scans)) if k not in placed]:
        located = _located(scans, waiting, found, board, air, (course or Course()).check)
        chosen = _chosen(located, found.explained / found.echoes)
        if not chosen:
            break
        poses |= {k: located[k][1] for k in chosen}
        refined = zip(sorted(placed), found.draft.places, strict=True)
        placed = {k: scans[k] if k in known else replace(placed[k], place=at) for k, at in refined}
        placed |= {k: replace(scans[k], place=_place(scans[k], poses[k][0])) for k in chosen}
        step += 1
        found = found_with(step)
    tick(1.0)
    used = zip(sorted(placed), found.draft.places, strict=True)
    return PlacedRoom(
        found,
        tuple(replace(placed[k], place=at) for k, at in used),
        {scans[k].title: found_here for k, found_here in sorted(poses.items())},
        tuple(scan.title for k, scan in enumerate(scans) if k not in placed),
    )


def _located(
    scans: Sequence[PlacedScan],
    waiting: Sequence[int],
    found: FoundRoom,
    board: Board,
    air: Air,
    check: Callable[[], None],
) -> dict[int, tuple[float, tuple[Pose, ...]]]:
    """Return the share of echoes that the room explains, and the possible poses, of each waiting scan."""
    room = found.draft.room(REFLECTANCE, air)
    located = {
        k: locate_scan(scans[k].readings, room, board, prediction=FOLLOWED, tick=lambda _share: check())
        for k in waiting
    }
    return {k: (one.explained, one.poses) for k, one in located.items()}


def _chosen(poses: dict[int, tuple[float, tuple[Pose, ...]]], own: float) -> list[int]:
    """Return the scans to place now: those explained well, or else the best one; `own` is the room's own share."""
    well = [k for k, (share, found) in poses.items() if share >= _AS_GOOD * own and found[0].probability >= _PROBABLE]
    best = max(poses, key=lambda k: poses[k][0])
    return well or ([best] if poses[best][0] >= _POOR * own else [])


def _place(scan: PlacedScan, pose: Pose) -> Place:
    return replace(scan.place, position=pose.position, heading=pose.heading)
