"""The result of a search for a room: its file with uncertainties as comments, and where to scan next."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import tomlkit
from numpy.typing import NDArray
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, Room, parse_room
from tomlkit.items import AoT, Table

from sonarhw.errors import counted, estimate_degrees, harmless, in_degrees, pose_heading_text
from sonarhw.readings import FloatArray
from sonarhw_compare.free_space import find_free_space
from sonarhw_compare.locate import Pose, learned
from sonarhw_compare.map import RoomMap, rounded_point
from sonarhw_compare.rooms.candidates import fitting
from sonarhw_compare.rooms.draft import MATERIAL, REFLECTANCE, SHARE, SPREAD, at_right_angles, post_name, wall_name
from sonarhw_compare.rooms.evidence import FINE, FOLLOWED
from sonarhw_compare.rooms.refinement import Move, Shifts, shifts_of
from sonarhw_compare.rooms.search import FoundRoom

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# The room file of a found room: walls, posts and places, with uncertainties and what is not known as comments.


_DIGITS = 5  # of metres


def found_room_text(result: FoundRoom, board: Board) -> str:
    """Return the text of a room file with the found walls, posts and places."""
    file = tomlkit.document()
    for line in _header(result, board):
        file.add(tomlkit.comment(line))
    file["name"] = "Found room"
    material = tomlkit.table()
    material["reflectance"] = REFLECTANCE
    material["reflectance"].comment("assumed; `sonarhw fit --free reflectance` finds it")
    file["materials"] = tomlkit.table(is_super_table=True).append(MATERIAL, material)
    file["walls"] = _array([_wall(result, number, key) for number, key in enumerate(result.draft.walls)])
    if result.draft.posts:
        file["posts"] = _array([_post(result, row) for row in range(len(result.draft.posts))])
    places = tomlkit.table(is_super_table=True)
    for number, name in enumerate(_place_names(result)):
        places[name] = _place(result, number)
    file["places"] = places
    return tomlkit.dumps(file)


def found_room(result: FoundRoom, board: Board) -> Room:
    """Return the room of `found_room_text`."""
    return parse_room(found_room_text(result, board), "the found room")


def found_room_figures(result: FoundRoom) -> dict[str, Any]:
    """Return walls, posts and open ends for JSON, in metres and degrees."""
    return {
        "echoes": result.echoes,
        "explained": result.explained,
        "offset_m": round(result.draft.offset, _DIGITS),
        "offset_sd_m": result.offset_deviation,
        "threshold_higher_db": result.draft.threshold_db,
        "threshold_sd_db": result.threshold_deviation,
        "right_angled": at_right_angles(result.draft),
        "walls": [
            {
                "points_m": [[x, y], [x2, y2]],
                "across_sd_m": result.deviations[Move("wall", key, 0)],
                "angle_sd_deg": math.degrees(result.deviations[Move("wall", key, 1)]),
                "touches": len(result.touches.walls[key]),
            }
            for key in result.draft.walls
            for x, y, x2, y2 in [_rounded(result.draft.segment(key))]
        ],
        "posts": [
            {
                "center_m": _rounded(post.center),
                "radius_m": round(post.radius, _DIGITS),
                "center_sd_m": [result.deviations[Move("post", row, part)] for part in (0, 1)],
                "radius_sd_m": result.deviations[Move("post", row, 2)],
                "touches": result.touches.posts[row],
            }
            for row, post in enumerate(result.draft.posts)
        ],
        "open_ends_m": [_rounded(end) for end in open_ends(result)],
        "unconfirmed": {
            "walls_m": [[_rounded(end) for end in ends] for ends in result.unconfirmed.segments.reshape(-1, 2, 2)],
            "posts_m": [_rounded(post.center) for post in result.unconfirmed.posts],
        },
    }


def pose_text(pose: Pose) -> str:
    """Return one possible pose of a located scan with its probability."""
    x, y = pose.position
    return f"{pose.probability:.1%} at {x:.3f}, {y:.3f} m, turntable step 0 at {pose_heading_text(pose.heading)}"


def assumptions(result: FoundRoom, board: Board) -> list[str]:
    """Return a line for each value that was expected to be near a known one, and what was found."""
    of, walls = at_right_angles(result.draft), len(result.draft.walls)
    lines = [
        f"assumed that {SHARE:.0%} of the walls are parallel or at right angles within {math.degrees(SPREAD):.0f}°; "
        f"{of} of {walls} are"
    ]
    if result.offset_deviation is not None:
        lines.append(
            f"range offset of the sensor: {result.draft.offset * 1000:.0f} ± {result.offset_deviation * 1000:.0f} mm "
            f"beside that of board {board.name!r}; 0 ± {board.range_sd * 1000:.0f} mm was expected (its range_sd)"
        )
    if result.threshold_deviation is not None:
        lines.append(
            f"threshold of the sensor: {result.draft.threshold_db:+.1f} ± {result.threshold_deviation:.1f} dB beside "
            f"that of board {board.name!r}; 0 ± {board.threshold_sd_db:.1f} dB was expected (its threshold_sd_db)"
        )
    return lines


def unconfirmed_text(result: FoundRoom) -> list[str]:
    """Return a line with the walls and posts that were removed, because no two places confirm them; none without."""
    removed = result.unconfirmed
    parts = [f"({x:.2f}, {y:.2f}) to ({x2:.2f}, {y2:.2f})" for x, y, x2, y2 in removed.segments.tolist()]
    parts += [f"a post at ({x:.2f}, {y:.2f})" for x, y, _ in removed.round_surfaces.tolist()]
    return [f"left out, because no two places confirm them (m): {'; '.join(parts)}"] if parts else []


def open_ends(result: FoundRoom) -> list[tuple[float, float]]:
    """Return the ends of walls (m) beyond which the scans show nothing."""
    ends = []
    for key in result.draft.walls:
        x, y, x2, y2 = result.draft.segment(key).tolist()
        ends += [end for which, end in enumerate(((x, y), (x2, y2))) if result.draft.is_free(key, which)]
    return ends


def _header(result: FoundRoom, board: Board) -> list[str]:
    lines = [
        f"Found by `sonarhw map` in {counted(len(result.scans), 'scan')} with board {board.name!r}: "
        + ", ".join(harmless(scan.title) for scan in result.scans),
        f"{result.explained} of {result.echoes} echoes are within 5 cm of one that this room predicts.",
        "± is one standard deviation. Surfaces that returned no echo to any scan are missing.",
    ]
    lines += [f"{line[0].upper()}{line[1:]}." for line in (*assumptions(result, board), *unconfirmed_text(result))]
    ends = ", ".join(f"({x:.2f}, {y:.2f})" for x, y in open_ends(result))
    if ends:
        lines.append(f"The walls may continue beyond these points (m): {ends}")
    for title, poses in result.poses.items():
        lines.append(f"Possible poses of {harmless(title)}: {'; '.join(map(pose_text, poses))}")
    lines += [f"Left out, because its pose was not found: {harmless(title)}" for title in result.left_out]
    return lines


def _place_names(result: FoundRoom) -> list[str]:
    """Return a name for the place of each scan, with a number behind a name that another one has already."""
    names: list[str] = []
    for scan, place in zip(result.scans, result.draft.places, strict=True):
        name, number = scan.name or place.name, 2
        while name in names:
            name, number = f"{scan.name or place.name}-{number}", number + 1
        names.append(name)
    return names


def _place(result: FoundRoom, number: int) -> Table:
    table, place = tomlkit.table(), result.draft.places[number]
    table["position"] = _point(place.position)
    table["heading_deg"] = round(math.degrees(place.heading), 4) + 0.0
    deviations = {move.part: by for move, by in result.deviations.items() if move.is_of("place", number)}
    if 0 in deviations:  # else it is exact
        x, y = (deviations[part] * 1000 for part in (0, 1))
        table["position"].comment(f"± {x:.1f} mm in x, ± {y:.1f} mm in y")
    if 2 in deviations:
        table["heading_deg"].comment(f"± {math.degrees(deviations[2]):.2f}°")
    return table


def _wall(result: FoundRoom, number: int, key: int) -> Table:
    across, turned = (result.deviations[Move("wall", key, part)] for part in (0, 1))
    table = tomlkit.table()
    table["name"] = wall_name(number)
    table["edges"] = [wall_name(number)]  # not "wall 1[0]" in `via`
    x, y, x2, y2 = result.draft.segment(key).tolist()
    points = tomlkit.array()
    points.extend([_point((x, y)), _point((x2, y2))])
    table["points"] = points
    touched = len(result.touches.walls[key])
    table["points"].comment(f"± {across * 1000:.1f} mm across, ± {math.degrees(turned):.2f}°; {touched} touches")
    table["material"] = MATERIAL
    return table


def _post(result: FoundRoom, row: int) -> Table:
    post = result.draft.posts[row]
    x, y, radius = (result.deviations[Move("post", row, part)] * 1000 for part in range(3))
    table = tomlkit.table()
    table["name"] = post_name(row)
    table["center"] = _point(post.center)
    table["center"].comment(f"± {x:.1f} mm, ± {y:.1f} mm; {result.touches.posts[row]} touches")
    table["radius"] = round(post.radius, _DIGITS)
    table["radius"].comment(f"± {radius:.1f} mm")
    table["material"] = MATERIAL
    return table


def _point(point: Sequence[float]) -> tomlkit.items.Array:
    array = tomlkit.array()
    array.extend(_rounded(point))
    return array


def _rounded(values: Sequence[float] | FloatArray) -> list[float]:
    return [round(float(value), _DIGITS) + 0.0 for value in values]


def _array(tables: Sequence[Table]) -> AoT:
    return AoT(list(tables))


# The places and headings from which another scan makes a found room most certain.
#
# The gain of a place is the expected decrease of the entropy of walls and posts, ½ ln det(I + D J Jᵀ D / σ²) in nats:
# D has their present standard deviations, J the derivative of each predicted range by them (Cover and Thomas,
# Elements of Information Theory, 2006, section 8.4, for normal distributions). Correlations of the present errors,
# echoes that appear or disappear, and surfaces that no scan has touched are left out.


_PLACES = 60  # that are tried, about
_CLEARANCE = 0.15  # m, of a place from walls and posts
_HEADINGS, _SECTORS = 72, 12  # of a scan
_LARGEST = 0.1  # m or rad, standard deviation of a wall or end; a larger one is not linear, and counts as this one
_MOST_OF_GAIN = 0.6  # share of the sum over headings that the reported sectors have


@dataclass(frozen=True)
class NextPlace:
    """A place for the next scan."""

    position: tuple[float, float]  # m
    gain: float  # nats
    sectors: tuple[tuple[float, float], ...]  # rad, first and last heading of each run of 30° sectors


def next_places(
    result: FoundRoom,
    room: Room,
    board: Board,
    count: int = 3,
    tick: Callable[[float], None] = lambda _share: None,
    best: Callable[[tuple[NextPlace, ...]], None] = lambda _places: None,
) -> tuple[NextPlace, ...]:
    """Return the `count` best places, best first, each farther than 0.3 m from the better ones.

    `room` is the found room with its places. `tick` receives the completed share, 0..1, and `best` the best places so
    far whenever they change; places all over the room come first.
    """
    moves = [move for move in result.deviations if move.what in ("wall", "post") and result.deviations[move] > 0]
    draft_room, by_move = result.draft.room(room.air), shifts_of(result.draft, moves)
    spreads = np.minimum([result.deviations[move] for move in moves], _LARGEST)
    tried: list[NextPlace] = []
    best_places: tuple[NextPlace, ...] = ()
    places = _spread_first(_candidates(room))
    for row, place in enumerate(places):
        tick(row / len(places))
        tried.append(_weighed(place, _slopes(place, draft_room, by_move, board) * spreads[:, None]))
        best_places, before = _apart(sorted(tried, key=lambda place_tried: -place_tried.gain), count), best_places
        if best_places != before:
            best(best_places)
    return best_places


def _candidates(room: Room) -> FloatArray:
    """Return free positions on a lattice, (n, 2) m."""
    free = find_free_space(room)
    area = len(free.middles) * free.spacing**2
    middles = find_free_space(room, math.sqrt(area / _PLACES)).middles
    return np.array([point for point in middles if free.holds(point, _CLEARANCE)]).reshape(-1, 2)


def _spread_first(positions: FloatArray) -> list[tuple[float, float]]:
    """Return positions (n, 2) in another order: each is as far as possible from those before it."""
    order: list[tuple[float, float]] = []
    away = np.full(len(positions), np.inf)
    for _ in range(len(positions)):
        x, y = positions[int(np.argmax(away))].tolist()
        order.append((x, y))
        away = np.minimum(away, np.hypot(positions[:, 0] - x, positions[:, 1] - y))
    return order


def _slopes(position: tuple[float, float], room: Room, by_move: Shifts, board: Board) -> FloatArray:
    """Return the derivative of each predicted range by each move, in standard deviations of a range, (m, n)."""
    headings = np.arange(_HEADINGS, dtype=np.float64) * (math.tau / _HEADINGS)
    scan = predict_scan(room, Place("", position), board, headings, FOLLOWED)
    slopes = np.zeros((len(by_move.turns), _HEADINGS))  # 0 where there is no echo
    for path in np.unique(scan.winners[scan.winners >= 0]).tolist():
        slopes[:, scan.winners == path] = by_move.of_length(scan.paths.outline(path))[:, None] / (2 * FINE.range)
    return slopes


def _weighed(position: tuple[float, float], scaled: FloatArray) -> NextPlace:
    """Return a place with the gain of its scan; `scaled` (m, n): slopes times standard deviations of the moves."""
    gain = float(np.linalg.slogdet(np.eye(len(scaled)) + scaled @ scaled.T)[1]) / 2
    by_sector = np.log1p((scaled**2).sum(axis=0)).reshape(_SECTORS, -1).sum(axis=1)
    order = np.argsort(-by_sector, kind="stable")
    enough = int(np.searchsorted(np.cumsum(by_sector[order]), _MOST_OF_GAIN * by_sector.sum())) + 1
    return NextPlace(position, gain, _runs(np.sort(order[:enough])) if gain > 0 else ())


def _runs(sectors: NDArray[np.intp]) -> tuple[tuple[float, float], ...]:
    """Return begin and end, rad, of each run of neighbouring sectors; a run may pass 0."""
    runs = np.split(sectors, np.flatnonzero(np.diff(sectors) > 1) + 1)
    ends = [(int(run[0]), int(run[-1]) + 1) for run in runs]
    if len(ends) > 1 and ends[0][0] == 0 and ends[-1][1] == _SECTORS:
        ends = [*ends[1:-1], (ends[-1][0], ends[0][1] + _SECTORS)]
    return tuple((first * math.tau / _SECTORS, last * math.tau / _SECTORS) for first, last in ends)


def _apart(places: Sequence[NextPlace], count: int) -> tuple[NextPlace, ...]:
    kept: list[NextPlace] = []
    for place in places:
        if len(kept) < count and all(math.dist(place.position, other.position) > 0.3 for other in kept):
            kept.append(place)
    return tuple(kept)


# Whether scans show a room: the share of the echoes that it explains, beside that of rooms of real sensors.


_LEAST_WALLS = 2
_MOST_SINGLE = 2 / 3  # of the walls: in the true arena, five of eight returned echoes to one of five scans only
_MOST_MISFITS, _MOST_MISSING = 1 / 8, 1 / 3  # of the scans of a room, and of all scans with those left out


@dataclass(frozen=True)
class Verdict:
    """Whether what was found is a room."""

    explained: float  # share of the echoes within 5 cm of one that the room predicts
    usual: float  # mean share at the right pose in known rooms, of real sensors
    misfits: tuple[str, ...]  # titles of the scans that do not fit, those left out included
    reasons: tuple[str, ...]  # why this is no room; empty if it is one

    @property
    def is_room(self) -> bool:
        """Whether nothing contradicts it."""
        return not self.reasons

    def lines(self) -> Iterator[str]:
        """Yield the verdict as lines of text."""
        fits = f"; scans that do not fit: {', '.join(map(harmless, self.misfits))}" if self.misfits else ""
        yield (
            f"{'a room' if self.is_room else 'not a room'}: {self.explained:.0%} of the echoes are explained, in known "
            f"rooms {self.usual:.0%} are usual{fits}"
        )

    def figures(self) -> dict[str, Any]:
        """Return the verdict for JSON."""
        return {
            "is_room": self.is_room,
            "explained_share": round(self.explained, 4),
            "usual_share": self.usual,
            "misfits": list(self.misfits),
            "reasons": list(self.reasons),
        }


def verdict_of(result: FoundRoom) -> Verdict:
    """Return whether the found walls and posts are a room of the scans."""
    by_sensors, touches = learned(), result.touches
    explained = result.explained / max(1, result.echoes)
    misfits = [result.scans[row].title for row in range(len(touches.echoes)) if not fitting(touches, row)]
    is_misfit = len(misfits) > _MOST_MISFITS * len(result.scans)
    misfits += result.left_out
    reasons = [
        f"{harmless(title)} is {away:.2f} m from its stated position, ± {deviation:.2f} m"
        for title, (away, deviation) in result.displaced.items()
    ]
    if explained < by_sensors.usual_explained - by_sensors.usual_explained_sd:
        reasons.append(
            f"only {explained:.0%} of {result.echoes} echoes are explained; at the right pose in known rooms, "
            f"{by_sensors.usual_explained:.0%} ± {by_sensors.usual_explained_sd:.0%} are usual"
        )
    scans = len(result.scans) + len(result.left_out)
    if scans > 1 and (is_misfit or len(misfits) > _MOST_MISSING * scans):
        reasons.append(f"{len(misfits)} of {scans} scans {'does' if len(misfits) == 1 else 'do'} not fit")
    single = sum(len(scans_with) < 2 for scans_with in touches.seen.values())
    if scans > 1 and single > _MOST_SINGLE * len(touches.seen):
        reasons.append(f"{single} of {counted(len(touches.seen), 'wall')} returned echoes to one scan only")
    if len(result.draft.walls) < _LEAST_WALLS:
        reasons.append(f"{counted(len(result.draft.walls), 'wall')} found")
    return Verdict(explained, by_sensors.usual_explained, tuple(misfits), tuple(reasons))


# The results of `sonarhw map`: the map of scans, and the room found from them.


@dataclass(frozen=True)
class RoomOfScans:
    """A found room, the poses of the scans in it, and where to scan next."""

    found: FoundRoom
    room: Room  # of its file
    board: Board  # with range offset and threshold as found
    given_board: Board
    next_places: tuple[NextPlace, ...] | None  # best first; None: not wanted

    @property
    def verdict(self) -> Verdict:
        """Whether it is a room."""
        return verdict_of(self.found)

    def lines(self) -> list[str]:
        """Return what was found as lines of text."""
        result = self.found
        return [
            *(f"{title}: {'; '.join(map(pose_text, poses))}" for title, poses in result.poses.items()),
            f"found room: {counted(len(result.draft.walls), 'wall')}, {counted(len(result.draft.posts), 'post')}, "
            f"{counted(len(open_ends(result)), 'open end')}; "
            f"{result.explained} of {result.echoes} echoes are within 5 cm of one that it predicts",
            *assumptions(result, self.given_board),
            *unconfirmed_text(result),
            *self.verdict.lines(),
            *map(_next_line, self.next_places or ()),
        ]

    def figures(self) -> dict[str, Any]:
        """Return what was found for JSON."""
        poses = {title: list(map(_pose_figures, several)) for title, several in self.found.poses.items()}
        figures = found_room_figures(self.found) | {"poses": poses, "left_out": list(self.found.left_out)}
        figures["verdict"] = self.verdict.figures()
        if self.next_places is not None:
            figures["next"] = list(map(_next_figures, self.next_places))
        return figures


def _next_line(place: NextPlace) -> str:
    x, y = place.position
    sectors = ", ".join(f"{in_degrees(first, 0):.0f}° to {in_degrees(last, 0):.0f}°" for first, last in place.sectors)
    return f"scan next at {x:.2f}, {y:.2f} m: {place.gain:.1f} nats; most from headings {sectors or 'none'}"


def _next_figures(place: NextPlace) -> dict[str, object]:
    return {
        "position_m": rounded_point(place.position),
        "gain_nats": round(place.gain, 3),
        "headings_deg": [[in_degrees(end, 3) for end in ends] for ends in place.sectors],
    }


def _pose_figures(pose: Pose) -> dict[str, float]:
    x, y = rounded_point(pose.position)
    heading = estimate_degrees(pose.heading, decimals=3)
    return {"x_m": x, "y_m": y, "heading_deg": heading, "probability": round(pose.probability, 6)}


@dataclass(frozen=True)
class MappedScans:
    """The map of scans, and the room found from them if it was wanted."""

    baseline: RoomMap
    room: Room | None  # given, or found
    found: RoomOfScans | None
    known: Room | None  # the room that the logs contain, for comparison
    doubts: tuple[str, ...] = ()

    def lines(self) -> Iterator[str]:
        """Yield the result as lines of text."""
        if self.found is not None:
            yield from self.found.lines()
            yield "baseline, from regions of constant depth:"
        where = "the found room" if self.found else "this room" if self.room else "a room of the walls found"
        yield from self.baseline.lines(where)

    def figures(self) -> dict[str, Any]:
        """Return the result under the keys of `map --json`."""
        return self.baseline.figures() | ({} if self.found is None else {"found": self.found.figures()})

    def draw(self) -> "Figure":
        """Return a picture of the maps, or of the found room."""
        from sonarhw_compare.drawings import draw_found_room, draw_map

        if self.found is None:
            return draw_map(self.baseline, self.room)
        result, room, board = self.found.found, self.found.room, self.found.board
        return draw_found_room(result.scans, room, board, open_ends(result), self.known)
