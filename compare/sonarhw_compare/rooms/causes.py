"""Causes of misfits: the changes of a known room that make a scan more likely, one after another, and their texts."""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, ClassVar

import numpy as np
from scipy.optimize import OptimizeResult, minimize_scalar
from sonarhw_sim.board.profile import Board, of_own_body
from sonarhw_sim.room.room import Place, Room
from sonarhw_sim.room.room_writing import changed_room, section

from sonarhw.errors import InputError, in_degrees
from sonarhw.readings import FloatArray, Reading
from sonarhw_compare.arcs import POSSIBLE, arcs_of
from sonarhw_compare.edits import Point, add_post, add_wall, set_material
from sonarhw_compare.explain import LengthText, in_metres
from sonarhw_compare.fit.free_walls import can_shift, left_normals, with_shifted_walls, with_written_walls
from sonarhw_compare.fit.likelihood import ReadingNoise
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.match import Comparison, Kind, compare_readings
from sonarhw_compare.rooms.candidates import post_candidates
from sonarhw_compare.rooms.draft import REFLECTANCE, DraftEnd, DraftPost, DraftWall, RoomDraft
from sonarhw_compare.rooms.evidence import (
    CLEARLY,
    FINE,
    FOLLOWED_ALL,
    PRICE,
    PRICE_OF_NUMBER,
    Scored,
    SearchProgress,
    all_scored,
    evidence_of,
    scored,
)
from sonarhw_compare.rooms.refinement import refined
from sonarhw_compare.rooms.search import edited, unexplained_readings, with_post, with_wall

# Changes of a room that may explain misfits: a new post or wall, a moved wall, another reflectance. Each has a price,
# returns the changed room, of which the text is edited, so that it can be saved, and states what is changed.


OBJECT = "found object"  # material of new posts and walls
_DIGITS = 4  # of metres in a room file


@dataclass(frozen=True)
class NewPost:
    """A round object that the room does not contain."""

    center: Point  # m
    radius: float  # m
    price: ClassVar[float] = PRICE

    def applied(self, room: Room) -> Room:
        """Return the room with the post. Raises InputError if it overlaps another post."""
        x, y = (round(coordinate, _DIGITS) for coordinate in self.center)
        if (np.hypot(*(room.posts[:, :2] - (x, y)).T) < room.posts[:, 2] + self.radius).any():
            raise InputError(f"a post at {_point(self.center)} overlaps another one; choose another place")
        return add_post(_with_object(room), (x, y), round(self.radius, _DIGITS), OBJECT)

    def text(self, length: LengthText) -> str:
        """Return where it is."""
        return f"something near {_point(self.center)}: a post of radius {length(self.radius)}"


@dataclass(frozen=True)
class NewWall:
    """A straight object that the room does not contain."""

    start: Point  # m
    end: Point  # m
    price: ClassVar[float] = PRICE

    def applied(self, room: Room) -> Room:
        """Return the room with the wall."""
        ends = [(round(x, _DIGITS), round(y, _DIGITS)) for x, y in (self.start, self.end)]
        return add_wall(_with_object(room), ends[0], ends[1], OBJECT)

    def text(self, length: LengthText) -> str:
        """Return where it is."""
        return f"something from {_point(self.start)} to {_point(self.end)}: a wall"


@dataclass(frozen=True)
class MovedWall:
    """A wall at another distance from the sensor; corners move to where the walls then meet."""

    wall: str
    left: float  # m, to its left, seen from its start to its end
    farther: float  # m, from the sensor
    price: ClassVar[float] = PRICE_OF_NUMBER

    def applied(self, room: Room) -> Room:
        """Return the room with the moved wall."""
        return with_written_walls(room, {self.wall: self.left}, _DIGITS)

    def text(self, length: LengthText) -> str:
        """Return by how much it moves."""
        return f"wall {self.wall} is {length(abs(self.farther))} {'farther' if self.farther > 0 else 'nearer'}"


@dataclass(frozen=True)
class OtherReflectance:
    """A surface that reflects more or less sound than assumed."""

    surface: str
    before: float  # amplitude ratio
    reflectance: float
    edge: str | None = None  # where its sound is diffracted, if that is what changes
    price: ClassVar[float] = PRICE_OF_NUMBER

    def applied(self, room: Room) -> Room:
        """Return the room with a material of this reflectance for the surface."""
        number = room.names.index(self.surface)
        name = f"{room.materials[number]} {self.reflectance:g}"
        with_one = changed_room(
            room, lambda document: section(document, "materials", name).update(reflectance=self.reflectance)
        )
        return set_material(with_one, number, name)

    def in_arrays(self, room: Room) -> Room:
        """Return the room with the reflectance, faster, with the text of the old one."""
        values = room.reflectances.copy()
        values[room.names.index(self.surface)] = self.reflectance
        return replace(room, reflectances=values)

    def text(self, _: LengthText) -> str:
        """Return what reflects more or less."""
        weaker = self.reflectance < self.before
        change = f"reflectance {self.reflectance:.2f} instead of {self.before:.2f}"
        if self.edge is not None:
            return f"edge {self.edge} is {'weaker' if weaker else 'stronger'} than assumed: {self.surface} has {change}"
        return f"{self.surface} reflects {'less' if weaker else 'more'} than assumed: {change}"


Change = NewPost | NewWall | MovedWall | OtherReflectance


def _with_object(room: Room) -> Room:
    return changed_room(
        room, lambda document: section(document, "materials", OBJECT).setdefault("reflectance", REFLECTANCE)
    )


def _point(position: Point) -> str:
    x, y = (np.round(position, 2) + 0.0).tolist()
    return f"{x:.2f}, {y:.2f} m"


# Search for the causes of misfits: the changes of a room that make a scan more likely, one after another.
#
# The search is that of `sonarhw map --out` (`rooms.search`), but it begins at the given room, and walls of this room
# and reflectances may change, too. In each step, the change that increases the log-likelihood of all readings most is
# accepted, if it is worth its price.


_MOST = 6  # causes
_PREPARED, _LEFT = 0.05, 0.4  # shares of the progress: before the first search, and left after each
_EDGES = 4  # points at which a wall may end that are tried
_DIRECTIONS = tuple(np.radians(np.arange(0.0, 360.0, 11.25)).tolist())  # rad, of a wall from an edge
_LENGTHS = (0.15, 0.4)  # m, likewise
_STEPS = 6  # of the refinement of a new post or wall
_AWAY, _ASIDE = (-0.06, -0.05, -0.04, -0.03, -0.02, -0.01, 0.0, 0.01, 0.02), (-0.015, 0.0, 0.015)  # m, of a new post
_RADII = (0.01, 0.02, 0.04)  # m, likewise
_SHIFTS = (-0.08, -0.04, -0.02, -0.01, 0.01, 0.02, 0.04, 0.08)  # m, of a wall, tried first
_IMPOSSIBLE = 1e9  # negative log-likelihood of a shift by which a neighbouring wall loses its length
_LEAST_SHIFT = 0.01  # m; room files and overlapping echoes are not more accurate
_REFLECTANCES = (0.1, 0.3, 0.5, 0.7, 0.95)
_LEAST_CHANGE = 0.1  # of a reflectance
_FEWEST = 3  # readings whose first echo touches a wall, without which it is not moved
_AGREE = 4  # readings that a change must explain better
_MOST_OF_ONE = 3.0  # log-likelihood that one reading counts for or against a change
_RANGES, _LEVELS = (0.003, 0.006, 0.012, 0.025), (1.5, 3.0)  # m, dB, noise that is tried
_NEIGHBOURS = math.radians(11)  # largest step between readings of one sector
_MOST_SECTORS = 3  # named in a text
MISFITS = (Kind.SHORT, Kind.LONG, Kind.MISSED, Kind.EXTRA)


@dataclass(frozen=True)
class Cause:
    """A change of the room, and the readings that it explains."""

    change: Change
    gain: float  # of log-likelihood by this change beside all others; no reading counts for more than 3
    readings: tuple[int, ...]  # rows of the readings that are more likely with it
    kinds: tuple[tuple[Kind, int], ...]  # classes of these readings in the given room, the most frequent first
    misfits: tuple[int, ...]  # rows of the misfits among them; without one, all of them
    sectors: tuple[tuple[float, float], ...]  # rad: first and last heading of neighbouring readings among the misfits

    def text(self, length: LengthText = in_metres) -> str:
        """Return one sentence: the misfits, their headings, and the change that explains them."""
        misfits = [(kind, count) for kind, count in self.kinds if kind in MISFITS]
        counts = " and ".join(f"{count} {kind.label}" for kind, count in misfits or self.kinds)
        others = len(self.readings) - len(self.misfits)
        more = f", and {others} more that fit better" if others else ""
        return f"{counts} readings at {_headings_text(self.sectors)}{more}: {self.change.text(length)}"


@dataclass(frozen=True)
class FoundCauses:
    """The causes of the misfits of a scan, worst first, and the shares of echoes that are explained."""

    causes: tuple[Cause, ...]
    room: Room  # with all changes
    before: Comparison  # in the given room
    after: Comparison  # in the changed room
    left: tuple[int, ...]  # rows of misfits in the changed room

    @property
    def left_text(self) -> str:
        """How many misfits have no cause, by class."""
        if not self.left:
            return "no misfit is left"
        kinds = Counter(self.after.rows[row].kind.label for row in self.left)
        return f"without a cause: {', '.join(f'{count} {kind}' for kind, count in kinds.most_common())}"

    def lines(self) -> Iterator[str]:
        """Yield the changes and what they explain as lines of text."""
        if not self.causes:
            yield "no change of the room explains misfits"
        for number, cause in enumerate(self.causes, 1):
            yield f"{number}. {cause.text()} (log-likelihood +{cause.gain:.0f})"
        before, after = _share(self.before), _share(self.after)
        yield f"within 5 cm of the prediction: {before} of the echoes, with all changes {after}"
        yield self.left_text

    def figures(self) -> dict[str, Any]:
        """Return the changes under the keys of `compare --find-missing --json`; headings in degrees."""
        after = self.after.summary()
        return {
            "causes": [
                {
                    "text": cause.text(),
                    "kind": type(cause.change).__name__,
                    "change": vars(cause.change),
                    "log_likelihood": cause.gain,
                    "readings": list(cause.readings),
                    "classes": {kind.value: count for kind, count in cause.kinds},
                    "sectors_deg": [[in_degrees(first), in_degrees(last)] for first, last in cause.sectors],
                }
                for cause in self.causes
            ],
            "after": {"within_5cm": after.within_5cm, "explained": after.explained, "misfits": len(self.left)},
        }


def _headings_text(sectors: Sequence[tuple[float, float]]) -> str:
    degrees = [[round(math.degrees(heading)) % 360 for heading in sector] for sector in sectors]
    texts = [f"{first}–{last}°" if first != last else f"{first}°" for first, last in degrees]
    return ", ".join([*texts[:_MOST_SECTORS], *(["…"] if len(texts) > _MOST_SECTORS else [])])


def _share(comparison: Comparison) -> str:
    share = comparison.summary().within_5cm
    return "none" if share is None else f"{share:.1%}"


def find_causes(
    readings: Sequence[Reading],
    room: Room,
    place: Place,
    board: Board,
    tick: Callable[[float], None] = lambda _share: None,
) -> FoundCauses:
    """Return the changes of a room that explain the misfits of a scan.

    `tick` receives the completed share, 0..1; it can end the search by an exception. Raises InputError if the board is
    a ring, or no reading has an echo.
    """
    if board.ring is not None:
        raise InputError(f"board {board.name!r} is a ring of sensors; the search for causes needs a turntable")
    if all(reading.range is None for reading in readings):
        raise InputError("no reading has an echo; nothing shows what is missing in the room")
    progress = SearchProgress(tick)
    progress.begin(_PREPARED)
    search = _Search(tuple(readings), room, place, board, progress)

    def longer(changes: tuple[Change, ...]) -> tuple[Change, ...] | None:
        progress.begin(1 - _LEFT ** (len(changes) + 1))
        change = None if len(changes) == _MOST else search.best_change(_with_all(room, changes))
        return None if change is None else (*changes, change)

    none: tuple[Change, ...] = ()
    changes = edited(none, longer, lambda _accepted: None)
    causes = search.judged(changes)
    tick(1.0)
    return causes


class _Search:
    """Readings at one place of a room, and the noise that explains them best in the given room."""

    def __init__(
        self, readings: tuple[Reading, ...], room: Room, place: Place, board: Board, progress: SearchProgress
    ) -> None:
        self._readings, self._room, self._place, self._board = readings, room, place, board
        scan = PlacedScan(readings, place)
        self._evidence = evidence_of(
            [scan], [PoseSpread()], board, room.air, prediction=FOLLOWED_ALL, progress=progress
        )
        # an object before a wall changes the first echo, while later ones are still explained
        self._first_echoes = self._evidence.of_first_echoes() or self._evidence
        self._arcs = arcs_of(self._evidence.scans, board, POSSIBLE)
        # `Problem` leaves out readings of the own body
        self._rows = np.flatnonzero(~np.asarray(of_own_body(board.own_body, readings)))
        tried = (FINE._replace(range=spread, level=level) for spread, level in product(_RANGES, _LEVELS))
        self._noise: ReadingNoise = max(tried, key=lambda noise: self._scored(room, noise).score)

    def best_change(self, room: Room) -> Change | None:
        """Return the change that explains most; None if none is worth its price."""
        now = self._scored(room)
        proposals = [*self._objects(now), *self._moved_walls(room), *self._reflectances(room)]
        for change, score in sorted(proposals, key=lambda proposal: -proposal[1]):
            if score - now.score < change.price:
                continue
            try:
                changed = change.applied(room)
            except InputError:
                continue  # a post around the sensor or in another post, or a wall without a length
            if _agreed(self._gains(room, changed)) >= change.price:
                return change
        return None

    def judged(self, changes: Sequence[Change]) -> FoundCauses:
        """Return the changes that are still worth their price beside the others, worst first."""
        changes = list(changes)
        causes: list[Cause] = []
        for change in list(changes):
            others = [other for other in changes if other is not change]
            gains = self._gains(_with_all(self._room, others), _with_all(self._room, changes))
            if _agreed(gains) < change.price:
                changes = others
                continue
            causes.append(self._cause(change, gains))
        causes.sort(key=lambda cause: -cause.gain)
        changed = _with_all(self._room, changes)
        before, after = self._compared(self._room), self._compared(changed)
        left = tuple(row.index for row in after.rows if row.kind in MISFITS)
        return FoundCauses(tuple(causes), changed, before, after, left)

    def _cause(self, change: Change, gains: FloatArray) -> Cause:
        rows = self._compared(self._room).rows
        better = tuple(self._rows[np.flatnonzero(gains > CLEARLY)].tolist())
        kinds = tuple(Counter(rows[k].kind for k in better).most_common())
        misfits = tuple(k for k in better if rows[k].kind in MISFITS) or better
        return Cause(change, _agreed(gains), better, kinds, misfits, _sectors([rows[k].heading for k in misfits]))

    def _gains(self, before: Room, after: Room) -> FloatArray:
        return self._evidence.gains(self._draft(before), self._draft(after), self._noise)[0]

    def _objects(self, now: Scored) -> Iterator[tuple[Change, float]]:
        """Yield the post and the wall that explain most, refined."""
        unexplained = unexplained_readings(self._first_echoes, now.draft, self._noise)
        extended = (
            with_post(self._evidence, now, self._arcs, unexplained, self._noise),
            with_wall(self._evidence, now, self._arcs, unexplained, self._noise),
            self._with_wall_from_edge(now, unexplained),
        )
        for longer in extended:
            if longer.draft is now.draft:
                continue
            candidate = refined(self._evidence, longer.draft, self._noise, _STEPS)
            if candidate.draft.posts:
                candidate = self._with_post_moved(now, candidate)
                (post,) = candidate.draft.posts
                yield NewPost(post.center, post.radius), candidate.score
            else:
                x0, y0, x1, y1 = candidate.draft.segments[0].tolist()
                yield NewWall((x0, y0), (x1, y1)), candidate.score

    def _with_post_moved(self, now: Scored, best_so_far: Scored) -> Scored:
        """Return a draft with its post where the readings are most likely, within some centimetres.

        Echoes that overlap give the likelihood many maxima, and a refinement ends in the nearest one. The board detects
        a weak echo late, so the post is often nearer than its arc. `now` is the draft without the post.
        """
        (post,) = best_so_far.draft.posts
        drafts = [replace(best_so_far.draft, posts=(other,)) for other in _posts_near(post, self._place)]
        best = max(all_scored(self._evidence, drafts, self._noise), key=lambda draft: draft.score)
        moved = refined(self._evidence, best.draft, self._noise, _STEPS)
        return max(
            best_so_far, moved, key=lambda draft: _limited(self._evidence.gains(now.draft, draft.draft, self._noise)[0])
        )

    def _with_wall_from_edge(self, now: Scored, unexplained: list[FloatArray]) -> Scored:
        """Return the draft with the wall that explains most, of those with one end where an arc shows an edge.

        A wall that does not face the place returns no echo of its own but at its edges, so no arc shows its direction.
        """
        drafts = [
            now.draft.with_new_wall(_wall_from(post.center, turn, length))[0]
            for post in post_candidates(self._arcs, unexplained, _EDGES, (0.0,))
            for turn, length in product(_DIRECTIONS, _LENGTHS)
        ]
        return max(all_scored(self._evidence, drafts, self._noise), key=lambda draft: draft.score, default=now)

    def _moved_walls(self, room: Room) -> Iterator[tuple[Change, float]]:
        """Yield the best shift of each wall that a predicted echo touches."""
        touched = self._touched(room, only_misfits=False)
        for wall in range(len(room.walls)):
            if touched[room.names[wall]] < _FEWEST or room.materials[wall] == OBJECT:
                continue
            shift = self._best_shift(room, wall)
            if abs(shift.x) >= _LEAST_SHIFT:
                yield _moved_wall(room, wall, float(shift.x), self._place), -float(shift.fun)

    def _best_shift(self, room: Room, wall: int) -> OptimizeResult:
        """Return the best shift of a wall to its left (m) as `x`, and its negative log-likelihood as `fun`."""

        def unlikely(left: float) -> float:
            shifts = {room.names[wall]: left}
            return -self._scored(with_shifted_walls(room, shifts)).score if can_shift(room, shifts) else _IMPOSSIBLE

        left = min(_SHIFTS, key=unlikely)
        bounds = left - abs(left) / 2, left + abs(left) / 2
        return minimize_scalar(unlikely, bounds=bounds, method="bounded", options={"maxiter": 8, "xatol": 5e-4})

    def _reflectances(self, room: Room) -> Iterator[tuple[Change, float]]:
        """Yield the best reflectance of each surface on a path of a misfit."""
        edges = self._edges_of_misfits(room)
        for name in self._touched(room, only_misfits=True):
            number = room.names.index(name)
            if room.materials[number] in {*room.tables, OBJECT} or room.scattered[number] > 0:
                continue
            before = float(room.reflectances[number])
            tried = [
                OtherReflectance(name, before, value, edges.get(name))
                for value in _REFLECTANCES
                if abs(value - before) >= _LEAST_CHANGE
            ]
            scores = [self._scored(change.in_arrays(room)).score for change in tried]
            best = int(np.argmax(scores))
            yield tried[best], scores[best]

    def _touched(self, room: Room, only_misfits: bool) -> Counter[str]:
        """Return how many readings have a predicted first echo from each surface."""
        counts: Counter[str] = Counter()
        for names in self._paths_of(room, only_misfits):
            counts.update({name for part in names for name in part.split("/") if name})
        return counts

    def _edges_of_misfits(self, room: Room) -> dict[str, str]:
        """Return, for surfaces on paths of misfits that are mostly diffracted at one of their edges, this edge."""
        at_edge: dict[str, Counter[str]] = {}
        for names in self._paths_of(room, only_misfits=True):
            edges = [part for part in names if "/" in part]
            for name in {name for part in names for name in part.split("/") if name}:
                own = [edge for edge in edges if name in edge.split("/")]
                at_edge.setdefault(name, Counter()).update(own[:1] or [""])
        best = {name: counts.most_common(1)[0][0] for name, counts in at_edge.items()}
        return {name: edge for name, edge in best.items() if edge}

    def _paths_of(self, room: Room, only_misfits: bool) -> Iterator[Sequence[str]]:
        compared = self._compared(room)
        prediction = compared.prediction
        for row in compared.rows:
            winner = int(prediction.winners[row.index])
            if winner >= 0 and (not only_misfits or row.kind in MISFITS):
                yield prediction.paths.via(winner, prediction.room)

    def _compared(self, room: Room) -> Comparison:
        return compare_readings(self._readings, room, self._board.faced(self._place), self._board)

    def _draft(self, room: Room) -> RoomDraft:
        return RoomDraft((self._place,), base=room)

    def _scored(self, room: Room, noise: ReadingNoise | None = None) -> Scored:
        return scored(self._evidence, self._draft(room), noise or self._noise)


def _agreed(gains: FloatArray) -> float:
    """Return the gain of log-likelihood, to which no reading contributes much alone; 0 if few readings agree."""
    return _limited(gains) if (gains > CLEARLY).sum() >= _AGREE else 0.0


def _limited(gains: FloatArray) -> float:
    """Return the sum of the gains of readings, to which none contributes much alone."""
    return float(np.clip(gains, -_MOST_OF_ONE, _MOST_OF_ONE).sum())


def _posts_near(post: DraftPost, place: Place) -> list[DraftPost]:
    """Return posts of several sizes near a post, most of them nearer to the place."""
    (x, y), (from_x, from_y) = post.center, place.position
    angle = math.atan2(y - from_y, x - from_x)
    return [
        DraftPost(
            (
                x + away * math.cos(angle) - aside * math.sin(angle),
                y + away * math.sin(angle) + aside * math.cos(angle),
            ),
            radius,
        )
        for away, aside, radius in product(_AWAY, _ASIDE, (post.radius, *_RADII))
    ]


def _wall_from(start: tuple[float, float], angle: float, length: float) -> DraftWall:
    """Return the wall of this length (m) from a point in a direction (rad)."""
    x, y = start
    middle = x + length / 2 * math.cos(angle), y + length / 2 * math.sin(angle)
    return DraftWall(middle, angle, (DraftEnd(-length / 2), DraftEnd(length / 2)))


def _moved_wall(room: Room, wall: int, left: float, place: Place) -> MovedWall:
    from_wall = np.array(place.position) - room.walls[wall, :2]
    on_the_left = float(from_wall @ left_normals(room.walls[wall : wall + 1])[0]) > 0
    return MovedWall(room.names[wall], left, -left if on_the_left else left)


def _with_all(room: Room, changes: Sequence[Change]) -> Room:
    for change in changes:
        room = change.applied(room)
    return room


def _sectors(headings: Sequence[float]) -> tuple[tuple[float, float], ...]:
    """Return the first and last heading of each group of neighbouring headings (rad), counter-clockwise."""
    turned: FloatArray = np.unique(np.remainder(headings, math.tau))
    ends = np.flatnonzero(np.diff(np.append(turned, turned[0] + math.tau)) > _NEIGHBOURS)
    firsts = np.remainder(ends + 1, len(turned))
    pairs = zip(turned[firsts].tolist(), turned[np.roll(ends, -1)].tolist(), strict=True)
    return tuple(sorted(pairs)) or ((float(turned[0]), float(turned[-1])),)
