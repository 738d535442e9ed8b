"""The arena mapped from real scans: `python -m benchmarks.real.mapped_arena [FOLDER]`.

First come the walls of a map by regions of constant depth, from the poses and range offsets of `locate`. Then the room
is found without known range offsets, from several kinds of poses:

  poses by locate     known within 3 cm and 2°; of the possible ones, the nearest to the written position
  written positions   likewise, with the headings by locate
  stated headings     known within 5°; unknown for scans whose description states none, left out if it never does
  first pose          that by locate, exactly; nothing of other poses but the stated headings, if named

Printed are the walls of the arena that are found within 3 cm and 2°, and the number of the other walls.

If no other position is known, the first pose determines the direction of the whole room, and no scan determines this
direction. The walls are then also counted after two turns about the first place: the one that fits the written
positions of the other scans, and the one within the 95 % interval of the first heading that gives most walls.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from statistics import median

import numpy as np
from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.locate import UNKNOWN, Pose, PoseSpread
from sonarhw_compare.map import map_scans
from sonarhw_compare.rooms.search import FoundRoom, find_room_and_poses
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import Place

from benchmarks.real.judged_scans import ROOM, RealScan, load_scans, program_options
from benchmarks.real.real_places import locate_real
from sonarhw.readings import FloatArray, Reading

ON_WALL, ON_FOUND, TURNED = 0.05, 0.03, math.radians(2)  # m, m, rad
INTERVAL = 1.96  # standard deviations: 95 %
LEVER = 0.3  # m from the first place, nearer than which a position determines no turn about it
MARKS = PoseSpread(0.03, math.radians(2))  # of marks on the floor
STATED_HEADINGS = {**dict.fromkeys(("A00", "A01", "A02", "A03", "A04"), 0.0), "B01": 90.0, "B04": 135.0}  # degrees
STATED = math.radians(5)  # standard deviation of a stated heading, which is "near" these degrees


def main() -> None:
    """Print a line for each kind of poses."""
    scans = load_scans(program_options(__doc__).folder)
    poses = [nearest_pose(scan) for scan in scans]
    placed = [
        PlacedScan(scan.readings, Place(scan.name, pose.position, pose.heading), scan.name)
        for scan, pose in zip(scans, poses, strict=True)
    ]
    marked = [at_mark(scan, pose.heading) for scan, pose in zip(scans, poses, strict=True)]
    print_baseline(placed, [pose.offset for pose in poses])
    print_found_room("poses by locate", [(scan, MARKS) for scan in placed])
    print_found_room("written positions", [(scan, MARKS) for scan in marked])
    from_first = [("first pose only", [(scan, UNKNOWN) for scan in placed[1:]])]
    if any(scan.name in STATED_HEADINGS for scan in scans):
        print_found_room("written positions and stated headings", [stated(scan, MARKS.xy) for scan in marked])
        from_first.append(("first pose and stated headings", [stated(scan, math.inf) for scan in placed[1:]]))
    for title, others in from_first:
        answer = print_found_room(title, [(placed[0], PoseSpread()), *others])
        print_turned(answer, placed[0].place, INTERVAL * poses[0].deviations[2], marked)


def nearest_pose(scan: RealScan) -> Pose:
    """Return the possible pose of a scan in the arena that is nearest to the written position."""
    return min(locate_real(scan).poses, key=lambda pose: math.dist(pose.position, (scan.x, scan.y)))


def at_mark(scan: RealScan, heading: float) -> PlacedScan:
    """Return a scan at its written position and a heading (rad)."""
    return PlacedScan(scan.readings, Place(scan.name, (scan.x, scan.y), heading), scan.name)


def print_baseline(placed: Sequence[PlacedScan], offsets: Sequence[float]) -> None:
    """Print which walls a map by regions of constant depth contains; `offsets` (m) are added to the ranges of scans."""
    corrected = [
        replace(scan, readings=[farther(reading, offset) for reading in scan.readings])
        for scan, offset in zip(placed, offsets, strict=True)
    ]
    found = map_scans(corrected, load_board("lego-nxt"))
    for name, features in (("all readings", found.plain.features), ("direct readings", found.direct.features)):
        names = [_true_wall(np.array([wall.start, wall.end])) for wall in features.walls]
        true = sorted({name for name in names if name})
        print(
            f"{name}: {len(true)} of {len(ROOM.walls)} walls found ({', '.join(true)}), "
            f"{names.count(None)} false walls, {len(features.points)} corners and edges"
        )


def stated(scan: PlacedScan, xy: float) -> tuple[PlacedScan, PoseSpread]:
    """Return a scan at its stated heading, and the spread of its pose; `xy` (m) is that of the position."""
    if (degrees := STATED_HEADINGS.get(scan.title)) is None:
        return scan, PoseSpread(xy, math.inf)
    return replace(scan, place=replace(scan.place, heading=math.radians(degrees))), PoseSpread(xy, STATED)


def print_found_room(title: str, given: Sequence[tuple[PlacedScan, PoseSpread]]) -> FoundRoom:
    """Print which walls of the arena are found from scans and how well their places are known, and what is left out."""
    placed, spreads = [scan for scan, _ in given], [spread for _, spread in given]
    found = find_room_and_poses(placed, load_board("lego-nxt"), ROOM.air, spreads)
    print(
        f"found room, {title}: {_walls_text(found.draft.segments)}, {len(found.draft.posts)} posts; "
        f"{found.explained} of {found.echoes} echoes explained; "
        f"range offset {found.draft.offset * 1000:.0f} ± {(found.offset_deviation or 0.0) * 1000:.0f} mm"
        f"{'; left out: ' if found.left_out else ''}{', '.join(found.left_out)}",
        flush=True,
    )
    return found


def print_turned(answer: FoundRoom, first: Place, farthest: float, marked: Sequence[PlacedScan]) -> None:
    """Print which walls are found after turns of the found room about the first place.

    One turn fits the written positions `marked`, the other gives most walls of all up to `farthest` (rad).
    """
    written = _turn_to(answer, first, marked)
    print(
        f"  turned by {math.degrees(written):.1f}° about the first place, to the written positions: "
        f"{_walls_text(_turned(answer, first, written))}"
    )
    turns = np.radians(np.arange(-math.degrees(farthest), math.degrees(farthest), 0.1)).tolist()
    counts = [len(set(wall_names(_turned(answer, first, turn))) - {None}) for turn in turns]
    best = [turn for turn, count in zip(turns, counts, strict=True) if count == max(counts)]
    turn = best[len(best) // 2]  # the middle one of the best
    print(
        f"  turned by {math.degrees(turn):.1f}°, of all up to {math.degrees(farthest):.1f}° the one with most walls: "
        f"{_walls_text(_turned(answer, first, turn))}"
    )


def _turn_to(answer: FoundRoom, first: Place, marked: Sequence[PlacedScan]) -> float:
    """Return the turn about the first place towards the written positions, rad: the median of those of the scans."""
    written = {scan.title: scan.place.position for scan in marked}
    turns = []
    for scan in answer.scans:
        found, true = (np.subtract(at, first.position) for at in (scan.place.position, written[scan.title]))
        if np.hypot(*true) > LEVER:
            turned = math.atan2(true[1], true[0]) - math.atan2(found[1], found[0])
            turns.append(math.remainder(turned, math.tau))
    return median(turns)


def _turned(answer: FoundRoom, first: Place, turn: float) -> FloatArray:
    """Return the segments (n, 4) m of a found room turned about the first place by an angle (rad)."""
    ahead = np.array([math.cos(turn), math.sin(turn)])
    points = answer.draft.segments.reshape(-1, 2) - first.position
    turned = np.column_stack((points @ (ahead * (1, -1)), points @ ahead[::-1])) + first.position
    return turned.reshape(-1, 4)


def wall_names(segments: FloatArray) -> list[str | None]:
    """Return the wall of the arena within 3 cm and 2° of each found wall (n, 4) m."""
    return [_true_wall(ends, ON_FOUND, TURNED) for ends in segments.reshape(-1, 2, 2)]


def _walls_text(segments: FloatArray) -> str:
    names = wall_names(segments)
    true = sorted({name for name in names if name})
    return (
        f"{len(true)} of {len(ROOM.walls)} walls within 3 cm and 2° ({', '.join(true)}), "
        f"{names.count(None)} of {len(names)} found walls not"
    )


def farther(reading: Reading, offset: float) -> Reading:
    """Return a reading with an offset (m) added to its range, as `sonarhw map --offset` does."""
    later = 2 * offset / reading.speed_of_sound
    return replace(reading, echo_times=tuple(time + later for time in reading.echo_times))


def _true_wall(ends: FloatArray, near: float = ON_WALL, turned: float = math.pi / 2) -> str | None:
    """Return the wall of the arena on whose line both ends (2, 2) are, within `near` (m), and `turned` (rad).

    A part of it is beside the wall.
    """
    for name, wall in zip(ROOM.names, ROOM.walls.reshape(-1, 2, 2), strict=False):
        length = float(np.hypot(*(wall[1] - wall[0])))
        along = (wall[1] - wall[0]) / length
        normal = np.array([-along[1], along[0]])
        away, run = (ends - wall[0]) @ normal, ends[1] - ends[0]
        first, last = sorted(((ends - wall[0]) @ along).tolist())
        beside = last > 0 and first < length
        sine = abs(float(run @ normal)) / float(np.hypot(*run))
        if beside and (np.abs(away) < near).all() and sine <= math.sin(turned):
            return name
    return None


if __name__ == "__main__":
    main()
