"""The content of the window at one moment, as one frozen value for all views.

A view compares the parts with those that it drew last. It redraws a part only if it is a different object.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeAlias
from weakref import ref

import numpy as np
from sonarhw_compare.explain import explain_heading, explain_reading
from sonarhw_compare.match import Matched
from sonarhw_compare.scans import heading_text
from sonarhw_compare.sound import PlayedPing
from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw.readings import FloatArray, Origin, Reading
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import Class, ViewLayer
from sonarhw_gui.scene.note_texts import NO_NOTES, NoteTexts
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.shown.found_drawing import FoundDrawing
from sonarhw_gui.shown.overlaid_scan import OverlaidScan, ScanPair
from sonarhw_gui.shown.proposal import Proposal
from sonarhw_gui.shown.reading_rows import CLASSES, NO_ROWS, ReadingRows, longer_of, rows_of
from sonarhw_gui.work.bscan_picture import BScans
from sonarhw_gui.work.chosen_trace import ChosenTrace
from sonarhw_gui.work.comparing import ComparedScan
from sonarhw_gui.work.outline_chances import OutlineChances

_HINT = "No reading yet: open a log or a room, or scan (F5) with a connected scanner."
_HINT_IN_A_ROOM = "No reading yet. Click the predicted outline to see what the sonar would read there, and why."

Question: TypeAlias = tuple[PredictedScan, int]  # a prediction, and the row of a heading in it


def is_same_question(one: Question | None, other: Question | None) -> bool:
    """Return whether both are on one heading of one prediction; not if there is none."""
    return one is not None and other is not None and one[0] is other[0] and one[1] == other[1]


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
class SoundMoment:
    """The sound of one ping at one time."""

    ping: PlayedPing
    time: float  # s since transmission began


@dataclass(frozen=True)
class Shown:
    """Everything the views draw."""

    scene: Scene
    outline: PredictedScan | None = None
    compared: ComparedScan | None = None
    readings: tuple[Reading, ...] = ()
    origin: Origin = Origin.MEASURED  # of the readings
    chosen: int | None = None
    asked: float | None = None  # rad in the room: a heading that is explained without a reading
    answer: PredictedScan | None = None  # at one heading, `asked` or the one asked before; computed after the question
    pointed_path: int | None = None  # row of `question`'s paths that the mouse or a key points at
    trace: ChosenTrace | None = None  # of the asked heading or the selected reading; computed after the selection
    sound: SoundMoment | None = None  # while it is played
    # as last shown; weak, because each hidden view keeps what it drew last, and a B-scan takes 30 MB
    bscan_ref: ref[BScans] | None = None
    overlays: tuple[OverlaidScan, ...] = ()  # other scans, drawn over the readings
    pair: ScanPair | None = None  # of these and the readings, whose differences are shown
    proposal: Proposal | None = None  # a change of the room that may be tried
    found: FoundDrawing | None = None  # of a search for the room
    notes: NoteTexts = NO_NOTES  # on readings, also on those after the position of a replay
    cursor: Cursor | None = None
    hidden: frozenset[Class | ViewLayer] = frozenset()  # classes and layers that no view draws
    look: Look = field(default_factory=Look)
    outdated: bool = False  # whether the comparison has been of a previous scene for a noticeable time
    chances: OutlineChances | None = None  # probabilities of ranges, if the board states spreads
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

    def row(self, reading: int) -> Matched | None:
        """Return the comparison of a reading; None if it was not compared."""
        return self.compared.row(reading) if self.compared else None

    def heading(self, reading: int) -> float:
        """Return the heading of a reading in the room, rad."""
        return self.scene.pose.heading + self.scene.board.turned(self.readings[reading].angle)

    def changed_since(self, before: "Shown | None", *parts: str) -> bool:
        """Return whether any of these parts is another object than in `before`, which a view drew last, if anything."""
        return before is None or any(getattr(before, part) is not getattr(self, part) for part in parts)

    def same_readings(self, before: "Shown | None") -> bool:
        """Return whether `before` has the same readings in the same classes at the same points."""
        return not self.changed_since(before, "readings", "compared", "scene", "hidden")

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
        at = heading_text(self.heading(reading))
        measured = f"no echo at {at}" if range_ is None else f"{self.look.unit.text(range_)} at {at}"
        return f"{measured}: {'being compared' if self.scene.room else 'open a room file to see its path'}"

    @cached_property
    def rows(self) -> ReadingRows:
        """All readings as rows of a table."""
        return rows_of(self.readings, self.compared, self.scene, self.earlier)

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
            found = np.flatnonzero((rows.classes == code) & ~np.isnan(drawn_at))
            if len(found):
                points[kind] = ClassPoints(tuple(found.tolist()), np.radians(rows.headings[found]), drawn_at[found])
        return points
