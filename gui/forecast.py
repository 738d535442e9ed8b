"""The prediction behind the window: paths, outline and comparison, worked out while the window goes on.

Takes a scene and readings; hands on the newest outline and comparison. Paths come twice, a draft of few bounces at
once and all of them when they are found. An answer for a scene or scan that is no longer shown is dropped.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from compare.match import Comparison, Matched, compare_readings
from gui.scene import Scene
from gui.worker import Failure, Worker
from sim.board import Board
from sim.paths import MAX_BOUNCES, Paths
from sim.predicted_scan import PredictedScan
from sim.prediction import PredictionOptions, predict_scan
from sim.room import Place, Room
from sonarhw.readings import Reading

DRAFT_BOUNCES = 4
OUTLINE_HEADINGS = 360
_FIRST_LISTEN = 0.01  # s
MOST_COMPARED = 1440  # readings: the newest are compared, lest an hour of scanning fill the memory


@dataclass(frozen=True)
class PathsFound:
    """The paths of a scene and the outline they give."""

    generation: int
    paths: Paths
    outline: PredictedScan
    draft: bool


@dataclass(frozen=True)
class PathsRequest:
    """Which paths lead from the scene's place back to it?"""

    generation: int
    room: Room
    place: Place
    board: Board
    max_bounces: int

    def answer(self) -> PathsFound:
        """Find them; what takes seconds in a room of many echoes."""
        headings = np.linspace(0, 2 * np.pi, OUTLINE_HEADINGS, endpoint=False)
        if self.board.ring is not None:
            headings = self.board.ring.headings(self.place)
        options = PredictionOptions(max_bounces=self.max_bounces)
        outline = predict_scan(self.room, self.place, self.board, headings, options)
        # what a trace needs is compiled here, so that the window's thread never waits for it
        outline.signal_at(0, _FIRST_LISTEN).envelope()
        return PathsFound(self.generation, outline.paths, outline, self.max_bounces < MAX_BOUNCES)


class DraftRequest(PathsRequest):
    """Which of them have few bounces? Asked beside the full request, so a type of its own."""


@dataclass(frozen=True)
class Compared:
    """A stretch of readings beside its prediction."""

    generation: int
    comparison: Comparison
    first: int  # which reading of the scan row 0 is
    draft: bool

    @property
    def end(self) -> int:
        """The first reading behind the stretch."""
        return self.first + len(self.comparison.rows)

    def row(self, reading: int) -> Matched | None:
        """The row of a reading; None outside the stretch."""
        row = reading - self.first
        return self.comparison.rows[row] if 0 <= row < len(self.comparison.rows) else None


@dataclass(frozen=True)
class CompareRequest:
    """How do these readings compare with what those paths give?"""

    generation: int
    room: Room
    place: Place
    board: Board
    found: PathsFound
    readings: tuple[Reading, ...]
    first: int

    def answer(self) -> Compared:
        """Compare them."""
        comparison = compare_readings(self.readings, self.room, self.place, self.board, paths=self.found.paths)
        return Compared(self.generation, comparison, self.first, self.found.draft)


class Forecast:
    """Keeps outline and comparison up with the scene and the readings."""

    def __init__(self) -> None:
        self.outline: PredictedScan | None = None
        self.compared: Compared | None = None
        self.failures: list[str] = []
        self._scene: Scene | None = None
        self._readings: Sequence[Reading] = ()
        self._found: PathsFound | None = None
        self._place_generation = 0
        self._scan_generation = 0
        # two, so that a growing scan is compared with the draft while the rest of the paths are still sought
        self._finder = Worker("find paths")
        self._comparer = Worker("compare readings")

    @property
    def searching(self) -> bool:
        """Whether paths are still sought; until then there is a draft, or nothing."""
        return self._finder.busy

    def set_scene(self, scene: Scene) -> None:
        """Predict for `scene` from now on."""
        self._scene, self._found, self.outline = scene, None, None
        self._place_generation += 1
        self.begin_scan()
        if scene.room is not None:
            subject = scene.room, scene.standing, scene.board
            self._finder.ask(DraftRequest(self._place_generation, *subject, DRAFT_BOUNCES))
            self._finder.ask(PathsRequest(self._place_generation, *subject, MAX_BOUNCES))

    def begin_scan(self) -> None:
        """Forget the readings; what is compared from now on belongs to another scan."""
        self.compared, self._readings = None, ()
        self._scan_generation += 1

    def follow(self, readings: Sequence[Reading]) -> None:
        """Compare `readings`: those of the scan up to now, which only grows until `begin_scan`."""
        self._readings = readings
        self._ask()

    def take(self) -> bool:
        """Take in what has been worked out since the last call; whether anything has changed."""
        changed = False
        for answer in (*self._finder.take(), *self._comparer.take()):
            match answer:
                case Failure():
                    self.failures.append(answer.message)
                    changed = True
                case PathsFound(generation=self._place_generation):
                    self._found, self.outline = answer, answer.outline
                    self._ask()
                    changed = True
                case Compared(generation=self._scan_generation):
                    self.compared = answer
                    changed = True
        return changed

    def close(self) -> None:
        """End the threads."""
        self._finder.close()
        self._comparer.close()

    def _ask(self) -> None:
        scene = self._scene
        if scene is None or scene.room is None or self._found is None or not self._readings:
            return
        first = max(0, len(self._readings) - MOST_COMPARED)
        newest = tuple(self._readings[first:])
        self._comparer.ask(
            CompareRequest(self._scan_generation, scene.room, scene.standing, scene.board, self._found, newest, first)
        )
