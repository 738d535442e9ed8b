"""What the window shows at one moment, as one frozen value for all views.

A view compares its parts with those that it drew last and redraws only parts that are another object.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from sonarhw_compare.explain.sentences import explain_reading
from sonarhw_compare.headings import heading_text
from sonarhw_compare.matching.match import Kind, Matched
from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw.readings import FloatArray, Reading
from sonarhw_gui.look.appearance import Look
from sonarhw_gui.look.palette import Unclassed
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.shown.reading_rows import CLASSES, NO_ROWS, ReadingRows, longer_of, rows_of
from sonarhw_gui.work.bscan_picture import BScans
from sonarhw_gui.work.chosen_trace import ChosenTrace
from sonarhw_gui.work.prediction_requests import Compared


@dataclass(frozen=True)
class ClassPoints:
    """The readings of one class, as points over heading."""

    readings: tuple[int, ...]  # which readings
    headings: FloatArray  # rad in the room
    ranges: FloatArray  # m; of a missed echo the predicted one


@dataclass(frozen=True)
class Cursor:
    """Where a hand points: linked in plan, trace, range view and B-scan."""

    heading: float  # rad in the room
    range: float  # m


@dataclass(frozen=True)
class Shown:
    """Everything the views draw."""

    scene: Scene
    outline: PredictedScan | None = None
    compared: Compared | None = None
    readings: tuple[Reading, ...] = ()
    chosen: int | None = None
    trace: ChosenTrace | None = None  # of the chosen reading, a moment after it is chosen
    bscan: BScans | None = None  # as it was when somebody looked at it last
    cursor: Cursor | None = None
    look: Look = field(default_factory=Look)
    outdated: bool = False  # whether what is compared belongs to a scene before, for longer than one would notice
    earlier: ReadingRows = field(default=NO_ROWS, repr=False, compare=False)  # from which `rows` are made sooner

    @property
    def chosen_reading(self) -> Reading | None:
        """The reading that trace, rays and sentence are about."""
        return None if self.chosen is None else self.readings[self.chosen]

    @property
    def chosen_row(self) -> Matched | None:
        """The chosen reading beside its prediction; None where it has not been compared."""
        return None if self.chosen is None else self.row(self.chosen)

    @property
    def prediction(self) -> PredictedScan | None:
        """The prediction whose headings the rows index; None where nothing has been compared."""
        return self.compared.comparison.prediction if self.compared else None

    def row(self, reading: int) -> Matched | None:
        """A reading beside its prediction; None where it has not been compared."""
        return self.compared.row(reading) if self.compared else None

    def heading(self, reading: int) -> float:
        """Where a reading looks in the room, rad."""
        return self.scene.pose.heading + self.readings[reading].angle

    def same_readings(self, other: "Shown") -> bool:
        """Whether `other` has the same readings in the same classes at the same points."""
        return self.readings is other.readings and self.compared is other.compared and self.scene is other.scene

    @cached_property
    def sentence(self) -> str:
        """What the chosen reading says; an invitation where there is none."""
        if self.chosen is None:
            return "No reading yet: press Scan or open a log."
        return self.sentence_of(self.chosen)

    def sentence_of(self, reading: int) -> str:
        """What a reading says, or what it waits for."""
        if self.compared is not None and self.row(reading) is not None:
            return explain_reading(self.compared.comparison, reading - self.compared.first, self.look.unit.text)
        heard = self.readings[reading].range
        at = heading_text(self.heading(reading))
        told = f"no echo at {at}" if heard is None else f"{self.look.unit.text(heard)} at {at}"
        return f"{told}: {'being compared' if self.scene.room else 'open a room file to see which path it took'}"

    @cached_property
    def rows(self) -> ReadingRows:
        """All readings as columns."""
        return rows_of(self.readings, self.compared, self.scene.pose.heading, self.earlier)

    @property
    def known_rows(self) -> ReadingRows:
        """What is known of the rows of this scan, also of those that a replay has gone back over."""
        return longer_of(self.rows, self.earlier)

    @cached_property
    def classes(self) -> dict[Kind | Unclassed, ClassPoints]:
        """All readings that can be drawn, by class."""
        rows = self.rows
        drawn_at = np.where(np.isnan(rows.measured), rows.predicted, rows.measured)
        points = {}
        for code, kind in enumerate(CLASSES):
            found = np.flatnonzero((rows.classes == code) & ~np.isnan(drawn_at))
            if len(found):
                points[kind] = ClassPoints(tuple(found.tolist()), np.radians(rows.headings[found]), drawn_at[found])
        return points
