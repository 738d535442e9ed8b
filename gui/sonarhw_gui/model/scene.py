"""The scene of a prediction (room, place and board), its history for undo, and its geometry in the plan."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict
from sonarhw_compare.scans import board_of_log
from sonarhw_sim.board.beam import beam_gain
from sonarhw_sim.board.profile import Board, parse_board
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Place, Room, parse_room
from sonarhw_sim.room.room_writing import with_place

from sonarhw.errors import InputError
from sonarhw.log import LogMetadata
from sonarhw.readings import FloatArray, Reading, RobotPose, points_at, poses_from

# The scene of a prediction: a room, a place in it and a board; or a board alone if the room is unknown.


NOWHERE = Place("", (0.0, 0.0))


@dataclass(frozen=True)
class Scene:
    """Room, place and board; room and place are both given or both missing. `options`: how sound is followed."""

    room: Room | None
    place: Place | None
    board: Board
    room_file: str = ""  # file name, for the log
    options: PredictionOptions = field(default_factory=PredictionOptions)

    @cached_property
    def pose(self) -> Place:
        """The place, with the actual heading of the turntable's zero; without a room the origin, facing +x."""
        place = self.place or NOWHERE
        return replace(place, heading=self.board.heading_at(0.0, place.heading))

    def poses_of(self, readings: Sequence[Reading], first: RobotPose | None = None) -> FloatArray | None:
        """Return x, y (m) and heading (rad) of step 0 at each reading of a sensor that moves, (n, 3).

        The sensor was at the place when its own pose was `first`, by default that of the first reading. None if the
        sensor stands still, or a pose is unknown.
        """
        place = self.place or NOWHERE
        poses = poses_from((*place.position, place.heading), readings, first)
        return None if poses is None else poses + np.array([0.0, 0.0, self.board.heading_at(0.0, 0.0)])

    @cached_property
    def written_room(self) -> Room | None:
        """The room as it is saved: with the place of the sensor, and without places that it was dragged to before."""
        if self.room is None or self.place is None or self.room.places.get(self.place.name) == self.place:
            return self.room
        return with_place(self.room, self.place, dragged_places(self.room))

    @property
    def title(self) -> str:
        """The text of the window's title."""
        return f"{self.room.name} · place {self.pose.name}" if self.room else "no room"


def scene_with(board: Board, room: Room | None = None, place: Place | None = None, room_file: str = "") -> Scene:
    """Return a scene with default options."""
    return Scene(room, place, board, room_file)


def position_name(position: tuple[float, float]) -> str:
    """Return the name of a place that has none, as in `--place X,Y`; position in m."""
    return f"{position[0]:g},{position[1]:g}"


def dragged_places(room: Room) -> list[str]:
    """Return the places named only by their position: the sensor was dragged there before the room was saved."""
    return [name for name, place in room.places.items() if name == position_name(place.position)]


def room_name(scene: Scene) -> str:
    """Return the name of the scene's room; empty without a room."""
    return scene.room.name if scene.room else ""


def first_place(room: Room) -> Place:
    """Return the first place of the room file. Raises InputError if the room has no places."""
    if not room.places:
        raise InputError(f"room {room.name!r}: it has no places; add [places.NAME] with a position to the file")
    return next(iter(room.places.values()))


def place_warning(metadata: LogMetadata, scene: Scene) -> str:
    """Return a warning if a log without a place is shown at the first of several places of the room; else empty."""
    room = scene.room
    if metadata.place or room is None or len(room.places) < 2 or scene.place != first_place(room):
        return ""
    return (
        f"the log contains no place; its readings are shown at {first_place(room).name}, the first place of the room: "
        "choose another place, or find the pose (F9)"
    )


def begin_of(readings: Sequence[Reading]) -> Place | None:
    """Return the place of the first reading of a robot that moves; None without poses."""
    if not readings or readings[0].pose is None:
        return None
    x, y, heading = readings[0].pose
    return Place(position_name((round(x, 3), round(y, 3))), (x, y), heading)


def scene_of_log(metadata: LogMetadata, readings: Sequence[Reading] = ()) -> Scene:
    """Return the scene stored in a log. Without a place, it is at the pose of the first of the readings, if known.

    Raises InputError if its room or place is invalid.
    """
    board = board_of_log(metadata)
    if not metadata.room_text:
        return scene_with(board)
    room = parse_room(metadata.room_text, f"the room in the log ({metadata.room_file or 'no name'})")
    place = room.place(metadata.place) if metadata.place else begin_of(readings) or first_place(room)
    return scene_with(board, room, place, metadata.room_file)


# A scene that can be written to a file, with the texts of its room and its board.


class SceneMemory(BaseModel):
    """The stored form of a scene."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    room_text: str
    room_file: str
    place: Place | None
    board_text: str
    options: PredictionOptions

    @staticmethod
    def of(scene: Scene) -> "SceneMemory":
        """Return the stored form of a scene."""
        return SceneMemory(
            room_text=scene.room.text if scene.room else "",
            room_file=scene.room_file,
            place=scene.place,
            board_text=scene.board.text,
            options=scene.options,
        )

    def scene(self) -> Scene:
        """Return the scene. Raises InputError if room or board is invalid."""
        board = parse_board(self.board_text, "the board of the last session")
        room = parse_room(self.room_text, "the room of the last session") if self.room_text else None
        return Scene(room, self.place if room else None, board, self.room_file, self.options)


# Lines of the plan as (n, 2) arrays of points in metres: walls, outline and beam. NaN marks a gap.


_JUMP = 0.1  # m between neighbouring headings; beyond it another path is received, and a line would look like a wall
_BEAM_POINTS = 17
_SAME_BOUNCE = 0.005  # m
_NEAR = 2.0  # times the size of the room
_CIRCLE = np.linspace(0.0, 2 * np.pi, 49)


def wall_lines(room: Room) -> FloatArray:
    """Return both ends of every wall, (2n, 2) float, m; each pair of rows is one line."""
    return room.walls.reshape(-1, 2)


def surface_outlines(walls: FloatArray, posts: FloatArray) -> FloatArray:
    """Return walls (n, 4) and posts (m, 3), m, as one line, (k, 2) float; NaN separates the surfaces."""
    circle = np.column_stack((np.cos(_CIRCLE), np.sin(_CIRCLE)))
    lines = [*(wall.reshape(2, 2) for wall in walls), *(post[:2] + post[2] * circle for post in posts)]
    gap = np.full((1, 2), np.nan)
    return np.vstack([part for line in lines for part in (line, gap)]) if lines else np.empty((0, 2))


def plan_bounds(room: Room, others: FloatArray) -> FloatArray:
    """Return the lower and upper corner of the plan, (2, 2) float, m.

    It contains walls, posts, and those of the points `others` (n, 2) that are less than two room sizes away.
    """
    posts, radii = room.posts[:, :2], room.posts[:, 2:]
    points = np.vstack((wall_lines(room), posts - radii, posts + radii))
    low, high = points.min(axis=0), points.max(axis=0)
    reach = _NEAR * (high - low).max()
    near = ((others > low - reach) & (others < high + reach)).all(axis=1)
    points = np.vstack((points, others[near]))
    return np.array([points.min(axis=0), points.max(axis=0)])


def outline_ranges(outline: PredictedScan) -> FloatArray:
    """Return headings and ranges of the outline, (n, 2) float, rad and m; NaN also separates the lines."""
    both = np.column_stack((outline.headings, outline.ranges))
    return np.insert(both, _breaks(outline), np.nan, axis=0)


def outline_points(outline: PredictedScan) -> FloatArray:
    """Return the outline in the plan, (n, 2) float, m; NaN at headings without echo and where the path changes."""
    points = points_at(outline.standpoints, outline.headings, outline.ranges)
    return np.insert(points, _breaks(outline), np.nan, axis=0)


def _breaks(outline: PredictedScan) -> NDArray[np.intp]:
    return np.flatnonzero(np.abs(np.diff(outline.ranges)) > _JUMP) + 1


def half_power_angle(board: Board, room: Room) -> float:
    """Return the angle off the axis at which the transducer emits half the power, rad."""
    return _half_power_angle(board.wavenumber(room.air) * board.aperture_radius)


@lru_cache(maxsize=4)
def _half_power_angle(ka: float) -> float:
    angles = np.linspace(0, math.pi / 2, 3601)
    return float(angles[np.argmax(beam_gain(angles, ka) < math.sqrt(0.5))])


def beam_wedge(place: Place, heading: float, half_angle: float, length: float) -> FloatArray:
    """Return the corners of the beam in the plan, (n, 2) float, m; the first and the last are the place."""
    headings = np.linspace(heading - half_angle, heading + half_angle, _BEAM_POINTS)
    rim = points_at(place.position, headings, np.full(_BEAM_POINTS, length))
    return np.vstack((place.position, rim, place.position))


def bounce_losses(prediction: PredictedScan, path: int) -> list[tuple[int, float]]:
    """Return the losses along a path: number of the corner, and loss in dB.

    The loss at a wall follows from its reflectance. Of posts, edges and materials with a table, only the sum of the
    losses is known. It is returned for the last of them; what bending past obstacles changes, for the last wall.
    """
    paths, room = prediction.paths, prediction.room
    surfaces = [int(surface) for surface in paths.surfaces[path] if surface >= 0]
    bend = int(paths.bends[path]) if paths.edges[path] >= 0 else None
    flat = len(room.walls)
    events: list[int | None] = [*surfaces]
    if bend is not None:
        events.insert(bend, None)
    losses, bent, rest = [], 0, _decibels(float(paths.gains[path]))
    if len(events) == 1:
        return [(1, rest)]  # the path's own loss: a rough wall scatters less sound straight back than it reflects
    for corner, surface in enumerate(events, start=1):
        if surface is None or flat <= surface < room.levels.start or room.materials[surface] in room.tables:
            bent = corner
        else:
            losses.append((corner, _decibels(float(room.reflectances[surface]))))
            rest -= losses[-1][1]
    if bent:
        return sorted([*losses, (bent, rest)])
    # sound that bends past an obstacle belongs to the path by walls
    return [*losses[:-1], (losses[-1][0], losses[-1][1] + rest)] if losses else []


def _decibels(amplitude: float) -> float:
    return 20 * math.log10(amplitude) if amplitude > 0 else -math.inf


def decibels_text(level: float) -> str:
    """Format a level with a minus sign (U+2212). A level of 0.0 has no sign."""
    return f"{level:.1f} dB".replace("-0.0 ", "0.0 ").replace("-", "−")


def bounce_labels(corners: FloatArray) -> list[tuple[str, FloatArray]]:
    """Return the numbers of a path's bounces with their positions, (2,) m; `corners` (n, 2) m are the whole path.

    A path that returns on itself has several bounces at one point; their numbers are joined.
    """
    labels: list[tuple[list[str], FloatArray]] = []
    for number, corner in enumerate(corners[1:-1], start=1):
        same = next((texts for texts, place in labels if math.dist(corner, place) < _SAME_BOUNCE), None)
        if same is None:
            labels.append(([str(number)], corner))
        else:
            same.append(str(number))
    return [(", ".join(texts), corner) for texts, corner in labels]


# The notes on the readings shown, as one frozen value.


@dataclass(frozen=True)
class NoteTexts:
    """The note of each reading that has one."""

    by_reading: Mapping[int, str] = field(default_factory=dict)  # by the place of the reading in the scan, from 0

    def __len__(self) -> int:
        return len(self.by_reading)

    def of(self, reading: int | None) -> str:
        """Return the note of a reading; empty without one."""
        return "" if reading is None else self.by_reading.get(reading, "")

    def with_note(self, reading: int, text: str) -> "NoteTexts":
        """Return the notes with another note on a reading; an empty text removes it."""
        others = {place: note for place, note in self.by_reading.items() if place != reading}
        return NoteTexts(dict(sorted({**others, reading: text}.items())) if text else others)

    def changed_since(self, before: "NoteTexts") -> tuple[int, ...]:
        """Return the readings whose notes differ."""
        either = {**before.by_reading, **self.by_reading}
        return tuple(place for place in either if before.of(place) != self.of(place))


NO_NOTES = NoteTexts()


# The undo history: labelled scenes and notes, one step for each gesture.


Edited = Scene | NoteTexts
_MOST_STEPS = 200


@dataclass(frozen=True)
class EditStep:
    """Scene or notes before an edit, or after an edit that was undone, with the label of the edit."""

    state: Edited
    label: str
    gesture: object = None  # edits of one gesture are one step


class History:
    """The scenes and notes before the current ones, and those that were undone."""

    def __init__(self) -> None:
        self._done: list[EditStep] = []
        self._undone: list[EditStep] = []
        self._discarded: list[EditStep] = []  # steps that could be redone before the last edit

    @property
    def undo_label(self) -> str:
        """The label of the edit that undo reverts; empty if there is none."""
        return self._done[-1].label if self._done else ""

    @property
    def steps(self) -> tuple[str, ...]:
        """The labels of all edits that can be undone, newest first."""
        return tuple(step.label for step in reversed(self._done))

    @property
    def redo_label(self) -> str:
        """The label of the edit that redo repeats; empty if there is none."""
        return self._undone[-1].label if self._undone else ""

    def remember(self, before: Edited, label: str, gesture: object = None) -> None:
        """Store `before`, which is about to be changed."""
        if self._is_last(gesture):
            return
        self._discarded, self._undone = self._undone, []
        self._done.append(EditStep(before, label, gesture))
        del self._done[:-_MOST_STEPS]

    def cancel(self, gesture: object) -> Edited | None:
        """Remove an unfinished gesture from the history and return the state before it; None if it changed nothing."""
        if not self._is_last(gesture):
            return None
        self._discarded, self._undone = [], self._discarded
        return self._done.pop().state

    def undo(self, *now: Edited) -> Edited | None:
        """Return the state before the last step; None if there is none. `now`: the scene, and the notes."""
        return _moved(self._done, self._undone, now)

    def redo(self, *now: Edited) -> Edited | None:
        """Return the state after the step that was undone last; None if there is none."""
        return _moved(self._undone, self._done, now)

    def forget_notes(self) -> None:
        """Remove the steps of notes: their readings are no longer shown."""
        for steps in (self._done, self._undone, self._discarded):
            steps[:] = [step for step in steps if not isinstance(step.state, NoteTexts)]

    def clear(self) -> None:
        """Remove all steps."""
        for steps in (self._done, self._undone, self._discarded):
            steps.clear()

    def _is_last(self, gesture: object) -> bool:
        return gesture is not None and bool(self._done) and self._done[-1].gesture is gesture


def _moved(source: list[EditStep], target: list[EditStep], now: tuple[Edited, ...]) -> Edited | None:
    if not source:
        return None
    step = source.pop()
    same_kind = next(current for current in now if isinstance(current, type(step.state)))
    target.append(EditStep(same_kind, step.label))
    return step.state
