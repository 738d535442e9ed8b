"""Location of real scans without prior knowledge: `python -m benchmarks.real.real_places [FOLDER]`.

Locates each scan of the folder in the whole arena, with unknown heading, and prints the most probable of the arena's
places, its probability, and the most probable pose. `--elsewhere` also locates the scans in other rooms and with other
boards, and prints the share of echoes explained there (some minutes). `--map` also maps the arena from all scans, and
prints which walls are found without range offsets. The poses are those of `locate` or at the written positions, within
3 cm and 2°; the written positions within 3 cm, with stated headings within 5° where there are any; the first pose of
`locate` only; or this one, and stated headings without positions. If no other position is known, the first pose
determines the direction of the whole room, and no scan determines this direction. The walls are then also counted after
two turns about the first place: the one that fits the written positions of the other scans, and the one within the 95 %
interval of the first heading that gives most walls. `locate` states this interval.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from statistics import median

import numpy as np
from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.headings import heading_text
from sonarhw_compare.locate.pose_spread import UNKNOWN, PoseSpread
from sonarhw_compare.locate.poses import Located, locate_scan
from sonarhw_compare.map import map_scans
from sonarhw_compare.room_finding.unknown_poses import PlacedRoom, find_room_and_poses
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.model import Place, Room, load_room

from benchmarks.real.judged_scans import RealScan, load_scans, program_options
from sonarhw.readings import FloatArray, Reading

ON_WALL, ON_FOUND, TURNED = 0.05, 0.03, math.radians(2)  # m, m, rad
INTERVAL = 1.96  # standard deviations: 95 %
LEVER = 0.3  # m from the first place, nearer than which a position determines no turn about it
MARKS = PoseSpread(0.03, math.radians(2))  # of marks on the floor
STATED_HEADINGS = {**dict.fromkeys(("A00", "A01", "A02", "A03", "A04"), 0.0), "B01": 90.0, "B04": 135.0}  # degrees
STATED = math.radians(5)  # standard deviation of a stated heading, which is "near" these degrees
OTHER_ROOMS = ("corridor", "kuc_siegel", "laboratory", "table_top")
OTHER_BOARDS = ("hc-sr04", "polaroid-56", "polaroid-6500")


def locate_real(scan: RealScan, board_name: str = "lego-nxt", room_name: str = "arena") -> Located:
    """Return the possible poses of a scan in a room, by default in the arena."""
    return locate_scan(scan.readings, load_room(f"rooms/{room_name}.toml"), load_board(board_name))


def true_place(scan: RealScan) -> str:
    """Return the name of the true place."""
    places = load_room("rooms/arena.toml").places
    return min(places, key=lambda name: math.dist(places[name].position, (scan.x, scan.y)))


def main() -> None:
    """Print a row for each scan, and the number of correct places."""
    chosen = program_options(
        "Locate real scans in their room.",
        elsewhere="also print how well each scan fits other rooms and boards",
        map="also print which walls a map of all scans contains",
    )
    scans = load_scans(chosen.folder)
    print("scan  place  found   most probable pose           probability   from the place")
    correct = at_best = 0
    for scan in scans:
        located, place = locate_real(scan), true_place(scan)
        shares = located.places()
        found, best = max(shares, key=shares.__getitem__), located.poses[0]
        away = math.dist(best.position, (scan.x, scan.y))
        correct += found == place
        at_best += away < 0.1
        x, y = best.position
        print(
            f"{scan.name:5} {place:6} {found:4} {shares[found]:3.0%}  {x:.3f}, {y:.3f} m at "
            f"{heading_text(best.heading):>6} {best.probability:12.0%} {away * 100:12.0f} cm"
        )
    print(f"correct places: {correct} of {len(scans)}; best pose within 10 cm of the true position: {at_best}")
    if chosen.elsewhere:
        print_elsewhere(scans)
    if chosen.map:
        print_map(scans)


def print_elsewhere(scans: Sequence[RealScan]) -> None:
    """Print the share of echoes that the most probable pose explains, with the true room and board and with others."""
    print("\nroom        board          echoes within 5 cm at the best pose: least, median, most of the scans")
    others = [("arena", board) for board in OTHER_BOARDS] + [(room, "lego-nxt") for room in OTHER_ROOMS]
    for room, board in [("arena", "lego-nxt"), *others]:
        shares = [locate_real(scan, board, room).explained for scan in scans]
        print(f"{room:11} {board:14} {min(shares):5.0%} {median(shares):5.0%} {max(shares):5.0%}", flush=True)


def print_map(scans: Sequence[RealScan]) -> None:
    """Print which walls of the arena a map of all scans contains, and the number of false walls."""
    room = load_room("rooms/arena.toml")
    placed, spread = [], 0.0
    for scan in scans:
        poses = locate_real(scan).poses
        nearest = min(poses, key=lambda pose: math.dist(pose.position, (scan.x, scan.y)))
        place = Place(scan.name, nearest.position, nearest.heading)
        placed.append(PlacedScan([farther(reading, nearest.offset) for reading in scan.readings], place, scan.name))
        spread = spread or nearest.deviations[2]
    found = map_scans(placed, load_board("lego-nxt"))
    print()
    for name, features in (("all readings", found.plain.features), ("direct readings", found.direct.features)):
        names = [_true_wall(np.array([wall.start, wall.end]), room) for wall in features.walls]
        true = sorted({name for name in names if name})
        print(
            f"{name}: {len(true)} of {len(room.walls)} walls found ({', '.join(true)}), "
            f"{names.count(None)} false walls, {len(features.points)} corners and edges"
        )
    raw = [replace(one, readings=scan.readings) for scan, one in zip(scans, placed, strict=True)]
    marked = [
        replace(one, place=replace(one.place, position=(scan.x, scan.y))) for scan, one in zip(scans, raw, strict=True)
    ]
    for title, given in (("poses by locate", raw), ("written positions", marked)):
        print_found_room(title, [(scan, MARKS) for scan in given], room)
    print_found_room("written positions and stated headings", [stated(scan, MARKS.xy) for scan in marked], room)
    for title, others in (
        ("first pose only", [(scan, UNKNOWN) for scan in raw[1:]]),
        ("first pose and stated headings", [stated(scan, math.inf) for scan in raw[1:]]),
    ):
        answer = print_found_room(title, [(raw[0], PoseSpread()), *others], room)
        print_turned(answer, raw[0].place, INTERVAL * spread, marked, room)


def stated(scan: PlacedScan, xy: float) -> tuple[PlacedScan, PoseSpread]:
    """Return a scan at its stated heading, and the spread of its pose; `xy` (m) is that of the position."""
    if (degrees := STATED_HEADINGS.get(scan.title)) is None:
        return scan, PoseSpread(xy, math.inf)
    return replace(scan, place=replace(scan.place, heading=math.radians(degrees))), PoseSpread(xy, STATED)


def print_found_room(title: str, given: Sequence[tuple[PlacedScan, PoseSpread]], room: Room) -> PlacedRoom:
    """Print which walls of the arena are found from scans and how well their places are known, and what is left out."""
    placed, spreads = [scan for scan, _ in given], [spread for _, spread in given]
    answer = find_room_and_poses(placed, load_board("lego-nxt"), room.air, spreads)
    found = answer.found
    print(
        f"found room, {title}: {_walls_text(found.draft.segments, room)}, {len(found.draft.posts)} posts; "
        f"{found.explained} of {found.echoes} echoes explained; "
        f"range offset {found.draft.offset * 1000:.0f} ± {(found.offset_deviation or 0.0) * 1000:.0f} mm"
        f"{'; left out: ' if answer.left_out else ''}{', '.join(answer.left_out)}"
    )
    return answer


def print_turned(answer: PlacedRoom, first: Place, farthest: float, marked: Sequence[PlacedScan], room: Room) -> None:
    """Print which walls are found after turns of the found room about the first place.

    One turn fits the written positions `marked`, the other gives most walls of all up to `farthest` (rad).
    """
    written = _turn_to(answer, first, marked)
    print(
        f"  turned by {math.degrees(written):.1f}° about the first place, to the written positions: "
        f"{_walls_text(_turned(answer, first, written), room)}"
    )
    turns = np.radians(np.arange(-math.degrees(farthest), math.degrees(farthest), 0.1)).tolist()
    counts = [len(set(_names(_turned(answer, first, turn), room)) - {None}) for turn in turns]
    best = [turn for turn, count in zip(turns, counts, strict=True) if count == max(counts)]
    turn = best[len(best) // 2]  # the middle one of the best
    print(
        f"  turned by {math.degrees(turn):.1f}°, of all up to {math.degrees(farthest):.1f}° the one with most walls: "
        f"{_walls_text(_turned(answer, first, turn), room)}"
    )


def _turn_to(answer: PlacedRoom, first: Place, marked: Sequence[PlacedScan]) -> float:
    """Return the turn about the first place towards the written positions, rad: the median of those of the scans."""
    written = {scan.title: scan.place.position for scan in marked}
    turns = []
    for scan in answer.scans:
        found, true = (np.subtract(at, first.position) for at in (scan.place.position, written[scan.title]))
        if np.hypot(*true) > LEVER:
            turned = math.atan2(true[1], true[0]) - math.atan2(found[1], found[0])
            turns.append(math.remainder(turned, math.tau))
    return median(turns)


def _turned(answer: PlacedRoom, first: Place, turn: float) -> FloatArray:
    """Return the segments (n, 4) m of a found room turned about the first place by an angle (rad)."""
    ahead = np.array([math.cos(turn), math.sin(turn)])
    points = answer.found.draft.segments.reshape(-1, 2) - first.position
    turned = np.column_stack((points @ (ahead * (1, -1)), points @ ahead[::-1])) + first.position
    return turned.reshape(-1, 4)


def _names(segments: FloatArray, room: Room) -> list[str | None]:
    """Return the wall of the arena within 3 cm and 2° of each found wall (n, 4) m."""
    return [_true_wall(ends, room, ON_FOUND, TURNED) for ends in segments.reshape(-1, 2, 2)]


def _walls_text(segments: FloatArray, room: Room) -> str:
    names = _names(segments, room)
    true = sorted({name for name in names if name})
    return (
        f"{len(true)} of {len(room.walls)} walls within 3 cm and 2° ({', '.join(true)}), "
        f"{names.count(None)} of {len(names)} found walls not"
    )


def farther(reading: Reading, offset: float) -> Reading:
    """Return a reading with an offset (m) added to its range, as `sonarhw map --offset` does."""
    later = 2 * offset / reading.speed_of_sound
    return replace(reading, echo_times=tuple(time + later for time in reading.echo_times))


def _true_wall(ends: FloatArray, room: Room, near: float = ON_WALL, turned: float = math.pi / 2) -> str | None:
    """Return the wall of the room on whose line both ends (2, 2) are, within `near` (m), and `turned` (rad).

    A part of it is beside the wall.
    """
    for name, wall in zip(room.names, room.walls.reshape(-1, 2, 2), strict=False):
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
