"""The content of the window at one moment, as one frozen value for all views.

A view compares the parts with those that it drew last. It redraws a part only if it is a different object.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, TypeAlias
from weakref import ref

import numpy as np
from sonarhw_compare.explain import explain_heading, explain_reading
from sonarhw_compare.match import Matched
from sonarhw_compare.scans import places_at
from sonarhw_compare.sound import PlayedPing, caption_at
from sonarhw_compare.two_scans import HeadingSeries, heading_series
from sonarhw_sim.predict.predicted_scan import PredictedScan, standpoints
from sonarhw_sim.room.room import Place, Room

from sonarhw.errors import heading_text
from sonarhw.readings import FloatArray, Origin, Reading, points_at
from sonarhw_gui.jobs.forecast import ComparedScan
from sonarhw_gui.jobs.traces import BScans, ChosenTrace
from sonarhw_gui.model.look import Class, LengthUnit, Look, ViewLayer
from sonarhw_gui.model.rows import CLASSES, NO_ROWS, ReadingRows, longer_of, rows_of
from sonarhw_gui.model.scene import NO_NOTES, NoteTexts, Scene, bounce_losses, decibels_text

if TYPE_CHECKING:
    from sonarhw_compare.pictures import RangeShading
    from sonarhw_compare.rooms.outcome import NextPlace

# What a search for the room draws in the plan: walls and posts found so far, readings, and the next place to scan.


NO_POINTS = np.empty((0, 2))


@dataclass(frozen=True, eq=False)
class FoundDrawing:
    """Surfaces and points in the plan, m."""

    walls: FloatArray  # (n, 4)
    posts: FloatArray  # (m, 3)
    chosen_walls: FloatArray  # (0 or 1, 4), the selected one
    chosen_posts: FloatArray  # (0 or 1, 3)
    speaking_for: FloatArray  # (k, 2), echoes that speak for the selected wall or post
    against: FloatArray  # (l, 2)
    next_scan: "NextPlace | None" = None


_NO_WALLS, _NO_POSTS = np.empty((0, 4)), np.empty((0, 3))
NOT_FOUND = FoundDrawing(_NO_WALLS, _NO_POSTS, _NO_WALLS, _NO_POSTS, NO_POINTS, NO_POINTS)


@dataclass(frozen=True, eq=False)
class TrackDrawing:
    """Where the tracker has found the robot so far, and the particles of the last update, m."""

    path: FloatArray  # (n, 2)
    cloud: FloatArray  # (k, 2)


# A scan that is drawn over the one shown.


SHOWN = -1  # in a pair: the readings shown


ScanPair: TypeAlias = tuple[int, int]  # numbers in the list of two scans that are compared


@dataclass(frozen=True, eq=False)
class OverlaidScan:
    """The echoes of one scan, with its colour and whether it is visible."""

    name: str
    series: HeadingSeries
    points: FloatArray  # (n, 2), m, in the plan; NaN without an echo
    readings: tuple[Reading, ...]
    scene: Scene  # in which it was made; without room and place if they are unknown
    style: int = 0  # number of its colour and symbol
    visible: bool = True


def overlaid(name: str, readings: tuple[Reading, ...], scene: Scene, drawn_in: Scene | None = None) -> OverlaidScan:
    """Return readings that were made in a scene as a scan to draw over another one.

    `drawn_in`: the scene at whose place it is drawn if its own place is unknown.
    """
    drawn = replace(drawn_in, board=scene.board) if drawn_in is not None and scene.place is None else scene
    series = heading_series(readings, drawn.board, drawn.place.heading if drawn.place else 0.0)
    poses, headings, ranges = drawn.poses_of(readings), series.headings, series.ranges
    if poses is not None:
        headings = poses[:, 2] + drawn.board.turned(np.array([reading.angle for reading in readings]))
        ranges = np.array([reading.range for reading in readings], dtype=np.float64)  # None is NaN
    where = drawn.pose if poses is None else poses
    sensors = standpoints(drawn.board, where, headings) if len(readings) else np.empty((0, 2))
    return OverlaidScan(name, series, points_at(sensors, headings, ranges), readings, scene)


# A proposed change of the room, with the readings that it explains, drawn but not made yet.


@dataclass(frozen=True, eq=False)
class Proposal:
    """What is drawn of a proposal."""

    readings: tuple[int, ...]  # numbers of the readings
    walls: FloatArray  # (n, 4), m
    posts: FloatArray  # (m, 3), m


NO_PROPOSAL = Proposal((), _NO_WALLS, _NO_POSTS)


def proposal_of(room: Room, changed: Room, readings: tuple[int, ...], surface: str | None) -> Proposal:
    """Return the surfaces that `changed` has and `room` does not; `surface` is included if it only changes material."""
    walls = [wall for wall in changed.walls if not (room.walls == wall).all(axis=1).any()]
    posts = [post for post in changed.posts if not (room.posts == post).all(axis=1).any()]
    if surface is not None and surface in room.names and not walls and not posts:
        number = room.names.index(surface)
        walls = [room.walls[number]] if number < len(room.walls) else []
        posts = [] if walls or number in room.levels else [room.posts[number - len(room.walls)]]
    return Proposal(readings, np.array(walls).reshape(-1, 4), np.array(posts).reshape(-1, 3))


_SENSOR_SHARE = 0.03  # of the diagonal of the room


def proposed_pose(room: Room, proposed: Scene) -> Proposal:
    """Return the sensor of a proposed scene, a circle with a line ahead, and its surfaces that `room` has not."""
    changes = proposal_of(room, proposed.room or room, (), None)
    radius = _SENSOR_SHARE * math.hypot(*np.ptp(room.walls.reshape(-1, 2), axis=0))
    (x, y), heading = proposed.pose.position, proposed.pose.heading
    ahead = x, y, x + 4 * radius * math.cos(heading), y + 4 * radius * math.sin(heading)
    return replace(changes, walls=np.vstack((changes.walls, ahead)), posts=np.vstack((changes.posts, (x, y, radius))))


_SAME_PLACE = 1e-6  # m

_HINT = "No reading yet: open a log or a room, or scan (F5) with a connected scanner."
_HINT_IN_A_ROOM = "No reading yet. Click the predicted outline to see what the sonar would read there, and why."

# the parts of `Shown` on which something drawn depends; each is replaced, never changed
Parts: TypeAlias = Callable[["Shown"], tuple[object, ...]]
Question: TypeAlias = tuple[PredictedScan, int]  # a prediction, and the row of a heading in it


def is_same_question(question: Question | None, other: Question | None) -> bool:
    """Return whether both are on one heading of one prediction; not if there is none."""
    return question is not None and other is not None and question[0] is other[0] and question[1] == other[1]


@dataclass(frozen=True)
class ClassPoints:
    """The readings of one class, as points over heading."""

    readings: tuple[int, ...]  # numbers of the readings
    headings: FloatArray  # rad in the room
    ranges: FloatArray  # m; of a missed echo the predicted range


@dataclass(frozen=True)
class Cursor:
    """The position of the pointer, shown in plan, trace, range view and B-scan."""

    heading: float  # rad in the room
    range: float  # m


@dataclass(frozen=True)
class SoundState:
    """The playback of the sound of one ping."""

    ping: PlayedPing | None  # None: there is no heading to play yet; then nothing is drawn
    time: float = 0.0  # s of sound, since transmission began
    playing: bool = True
    loop: bool = True
    slowness: float = 1000.0  # s for each second of sound

    def caption(self, unit: LengthUnit) -> str:
        """Return what happens now."""
        if self.ping is None:
            return "select a reading, or click the predicted outline"
        return caption_at(self.ping, self.time, unit.text)


@dataclass(frozen=True)
class Shown:
    """Everything the views draw."""

    scene: Scene
    outline: PredictedScan | None = None
    compared: ComparedScan | None = None
    readings: tuple[Reading, ...] = ()
    poses: FloatArray | None = None  # (n, 3), m, m and rad, of a sensor that moves; None: it stands at the place
    origin: Origin = Origin.MEASURED  # of the readings
    chosen: int | None = None
    asked: float | None = None  # rad in the room: a heading that is explained without a reading
    answer: PredictedScan | None = None  # at one heading, `asked` or the one asked before; computed after the question
    pointed_path: int | None = None  # row of `question`'s paths that the mouse or a key points at
    trace: ChosenTrace | None = None  # of the asked heading or the selected reading; computed after the selection
    sound: SoundState | None = None  # while it is played; it has a ping
    # as last shown; weak, because a hidden view keeps what it drew of this scan, and a B-scan takes 30 MB
    bscan_ref: ref[BScans] | None = None
    overlays: tuple[OverlaidScan, ...] = ()  # other scans, drawn over the readings
    pair: ScanPair | None = None  # of these and the readings, whose differences are shown
    proposal: Proposal | None = None  # a change of the room that may be tried
    found_room: FoundDrawing | None = None  # of a search for the room
    track: TrackDrawing | None = None  # of a robot
    notes: NoteTexts = NO_NOTES  # on readings, also on those after the position of a replay
    cursor: Cursor | None = None
    hidden: frozenset[Class | ViewLayer] = frozenset()  # classes and layers that no view draws
    look: Look = field(default_factory=Look)
    outdated: bool = False  # whether the comparison has been of a previous scene for a noticeable time
    chances: "RangeShading | None" = None  # probabilities of ranges, if the board states spreads
    earlier: ReadingRows = field(default=NO_ROWS, repr=False, compare=False)  # rows that `rows` reuses

    @property
    def bscan(self) -> BScans | None:
        """The B-scan as last shown; None if there is none, or a newer one has replaced it."""
        return None if self.bscan_ref is None else self.bscan_ref()

    @property
    def title(self) -> str:
        """The text of the window's title: room and place, and the origin of readings that are not measured."""
        other = self.readings and self.origin is not Origin.MEASURED
        return f"{self.scene.title} · {self.origin} readings" if other else self.scene.title

    @property
    def chosen_reading(self) -> Reading | None:
        """The reading of trace, rays and sentence; None without readings."""
        return None if self.chosen is None else self.readings[self.chosen]

    @property
    def chosen_row(self) -> Matched | None:
        """The comparison of the selected reading; None if it was not compared."""
        return None if self.chosen is None else self.row(self.chosen)

    @property
    def prediction(self) -> PredictedScan | None:
        """The prediction that `chosen_row` belongs to; None if the selected reading was not compared."""
        stretch = self.compared.stretch_of(self.chosen) if self.compared and self.chosen is not None else None
        return stretch.comparison.prediction if stretch else None

    @property
    def question(self) -> Question | None:
        """The prediction, and the row of the heading in it, that sentence, trace and list of echoes explain."""
        if self.asked is not None:
            return None if self.answer is None else (self.answer, 0)
        row, prediction = self.chosen_row, self.prediction
        return None if row is None or prediction is None else (prediction, row.index)

    @property
    def due_heading(self) -> float | None:
        """The asked heading, or that of the selected reading, rad in the room; None without both."""
        if self.asked is not None:
            return self.asked
        return None if self.chosen is None else self.heading(self.chosen)

    @property
    def without_scan(self) -> "Shown":
        """The same room and look, without readings and without everything that was computed."""
        return Shown(self.scene, hidden=self.hidden, look=self.look)

    def row(self, reading: int) -> Matched | None:
        """Return the comparison of a reading; None if it was not compared."""
        return self.compared.row(reading) if self.compared else None

    def heading(self, reading: int) -> float:
        """Return the heading of a reading in the room, rad."""
        zero = self.scene.pose.heading if self.poses is None else float(self.poses[reading, 2])
        return zero + self.scene.board.turned(self.readings[reading].angle)

    @property
    def sensor(self) -> Place:
        """The place of the sensor: of one that moves, at the selected reading, or else the newest."""
        if self.poses is None:
            return self.scene.pose
        chosen = len(self.poses) - 1 if self.chosen is None else self.chosen
        return places_at(self.scene.pose, self.poses[chosen : chosen + 1])[0]

    def changed_since(self, before: "Shown | None", parts: Parts) -> bool:
        """Return whether any of these parts is another object than in `before`, which a view drew last, if anything."""
        return before is None or any(was is not now for was, now in zip(parts(before), parts(self), strict=True))

    def same_readings(self, before: "Shown | None") -> bool:
        """Return whether `before` has the same readings in the same classes at the same points."""
        return not self.changed_since(before, marked_parts)

    def draws(self, layer: ViewLayer) -> bool:
        """Return whether a layer is drawn."""
        return layer not in self.hidden

    @cached_property
    def sentence(self) -> str:
        """The explanation of the asked heading or of the selected reading; a hint if there are no readings."""
        if self.asked is not None:
            if self.answer is None:
                return f"{heading_text(self.asked)} is being computed"
            return explain_heading(self.answer, 0, self.look.unit.text)
        if self.chosen is None:
            return _HINT_IN_A_ROOM if self.scene.room else _HINT
        stretch = self.compared.stretch_of(self.chosen) if self.compared else None
        text = self.sentence_of(self.chosen)
        return f"draft, few bounces: {text}" if stretch is not None and stretch.draft else text

    def sentence_of(self, reading: int) -> str:
        """Return the explanation of a reading, or why there is none yet."""
        stretch = self.compared.stretch_of(reading) if self.compared else None
        if stretch is not None:
            return explain_reading(stretch.comparison, reading - stretch.first, self.look.unit.text)
        range_ = self.readings[reading].range
        heading = heading_text(self.heading(reading))
        measured = f"no echo at {heading}" if range_ is None else f"{self.look.unit.text(range_)} at {heading}"
        return f"{measured}: {'being compared' if self.scene.room else 'open a room file to see its path'}"

    @cached_property
    def rows(self) -> ReadingRows:
        """All readings as rows of a table."""
        return rows_of(self.readings, self.compared, self.scene, self.earlier, self.poses)

    @property
    def known_rows(self) -> ReadingRows:
        """All known rows of this scan, including those after the position of a replay."""
        return longer_of(self.rows, self.earlier)

    @cached_property
    def classes(self) -> dict[Class, ClassPoints]:
        """The readings of the visible classes with a measured or predicted range, by class."""
        rows = self.rows
        drawn_at = np.where(np.isnan(rows.measured), rows.predicted, rows.measured)
        points = {}
        for code, kind in enumerate(CLASSES):
            if kind in self.hidden:
                continue
            numbers = np.flatnonzero((rows.classes == code) & ~np.isnan(drawn_at))
            if len(numbers):
                points[kind] = ClassPoints(
                    tuple(numbers.tolist()), np.radians(rows.headings[numbers]), drawn_at[numbers]
                )
        return points


def marked_parts(shown: Shown) -> tuple[object, ...]:
    """Return the parts on which the marks of the readings depend."""
    return shown.readings, shown.compared, shown.scene, shown.hidden


# The path that explains the selected reading, or the predicted one, and its losses bounce by bounce.


@dataclass(frozen=True)
class ChosenPath:
    """The path of the selected reading."""

    corners: FloatArray  # (n, 2) m, begins and ends at the sensor
    names: tuple[str, ...]  # of the walls, posts and edges at its bounces, in order
    losses: tuple[float | None, ...]  # of each bounce, dB; None: contained in the loss of a later one
    explains: bool  # whether it explains the reading; otherwise it is predicted only

    @property
    def text(self) -> str:
        """The number, name and loss of each bounce."""
        parts = []
        for number, (name, loss) in enumerate(zip(self.names, self.losses, strict=True), start=1):
            parts.append(f"{number} {name}" if loss is None else f"{number} {name} {decibels_text(loss)}")
        return " · ".join(parts)


def chosen_path(shown: Shown) -> ChosenPath | None:
    """Return the path of the asked heading or the selected reading; None without one, or after the sensor was moved."""
    if shown.asked is not None:
        winner = -1 if shown.answer is None else int(shown.answer.winners[0])
        return None if shown.answer is None else _path(shown, shown.answer, winner, explains=False)
    row, prediction = shown.chosen_row, shown.prediction
    if row is None or prediction is None:
        return None
    path = row.path if row.path is not None else int(prediction.winners[row.index])
    return _path(shown, prediction, path, explains=row.path is not None)


def _path(shown: Shown, prediction: PredictedScan, path: int, explains: bool) -> ChosenPath | None:
    if path < 0 or not _is_at_sensor(shown, prediction):
        return None
    names, losses = prediction.paths.via(path, prediction.room), dict(bounce_losses(prediction, path))
    by_bounce = tuple(losses.get(number) for number in range(1, len(names) + 1))
    corners = np.asarray(prediction.paths.outline(path))
    return ChosenPath(corners, tuple(names), by_bounce, explains)


def _is_at_sensor(shown: Shown, prediction: PredictedScan) -> bool:
    """Return whether a prediction is from where the sensor is now."""
    if prediction.poses is None:
        return prediction.place.position == shown.sensor.position
    return bool((np.hypot(*(prediction.poses[:, :2] - shown.sensor.position).T) < _SAME_PLACE).any())


def bounces_text(shown: Shown) -> str:
    """Return the bounces of the selected reading's path on one line; empty without a path."""
    path = chosen_path(shown)
    return "" if path is None else path.text


# The range that traces show initially: beyond the farthest first echo, but not the whole recording.


_BEYOND = 1.5  # times the farthest first echo


def initial_range(shown: Shown) -> float | None:
    """Return the range up to which traces are shown initially, m; None while no echo is known."""
    measured = [reading.range for reading in shown.readings if reading.range is not None]
    predicted = [] if shown.outline is None else shown.outline.ranges[~np.isnan(shown.outline.ranges)].tolist()
    return _BEYOND * max((*measured, *predicted), default=0.0) or None
