"""The prediction that the window shows: paths, outline and comparison, computed in background jobs.

Paths are computed twice: first a quick draft, then all paths. During a drag there are only drafts.
"""

import math
import time
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from sonarhw_compare.match import KINDS, Comparison, Kind, Matched, headings_of, match_readings, predicted_for
from sonarhw_compare.scans import places_at
from sonarhw_sim.air import Receiver
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, paths_serve_all_headings, predict_scan
from sonarhw_sim.rays.paths import Paths

from sonarhw.readings import FloatArray, Reading, RobotPose
from sonarhw_gui.jobs.jobs import Jobs
from sonarhw_gui.model.edits import room_and_place
from sonarhw_gui.model.scene import Scene

if TYPE_CHECKING:
    from sonarhw_compare.pictures import RangeShading

IntArray = NDArray[np.int64]
OUTLINE_HEADINGS = 360
STRETCH = 360  # readings that are compared together
_SHORT_SCAN = 30  # readings; a shorter stretch is compared again together with those that follow
_AT_ONCE = 4  # stretches of one request; about 0.1 s
NO_PATH = -1
LATE = 0.15  # s before values of the previous scene are marked as outdated; a shorter time makes them flicker
# s without a movement, after which a drag is considered to pause: at least the first, at most the second
SHORT_REST, REST = 0.05, 0.1
# each has a thread of its own: drafts and comparisons never wait for the search for all paths, nor for probabilities
_DRAFT, _FIND, _WEIGH, _COMPARE = "draft paths", "find paths", "probabilities", "compare readings"
_TOO_LONG, _SHORT = 0.020, 0.005  # s, duration of a draft


@dataclass(frozen=True)
class DraftEffort:
    """Limits of a draft prediction, which also leaves out sound that bends past obstacles."""

    max_bounces: int
    rays: int
    headings: int  # number of headings, used if every heading needs its own search
    ideal: bool = True  # whether to use the ideal receiver, which takes half of the time of that of the board

    def limit(self, options: PredictionOptions) -> PredictionOptions:
        """Return the options limited to this effort."""
        return replace(
            options,
            max_bounces=min(options.max_bounces, self.max_bounces),
            rays=min(options.rays, self.rays),
            receiver=Receiver.FIRST_ECHO if self.ideal else options.receiver,
            shadows=False,  # sound past obstacles is faint, and takes a third of the time of a draft
        )


EFFORTS = (
    DraftEffort(1, 720, 24),
    DraftEffort(2, 720, 36),
    DraftEffort(3, 1440, 72),
    DraftEffort(4, 1440, 120),
    DraftEffort(6, 2880, 180),
    DraftEffort(8, 2880, 360, ideal=False),
)
FIRST_LEVEL = 3  # in EFFORTS


def next_level(level: int, seconds: float) -> int:
    """Return the level of effort after a draft: less after a slow one, so that drafts keep up with a drag."""
    if seconds > _TOO_LONG:
        return max(0, level - 1)
    return min(len(EFFORTS) - 1, level + 1) if seconds < _SHORT else level


@dataclass(frozen=True)
class PathsFound:
    """The paths of a scene and the predicted outline: the result of `find_paths`."""

    generation: int
    scene: Scene
    options: PredictionOptions
    outline: PredictedScan
    draft: bool
    took: float  # s

    @property
    def paths(self) -> Paths:
        """The paths that are received at any heading."""
        return self.outline.paths


def find_paths(
    generation: int, scene: Scene, options: PredictionOptions, headings: int = OUTLINE_HEADINGS
) -> PathsFound:
    """Find the paths from the place of a scene with a room back to it; with many echoes this takes seconds."""
    began = time.perf_counter()
    room, _ = room_and_place(scene)
    outline = predict_scan(room, scene.pose, scene.board, _outline_headings(scene, options, headings), options)
    draft = options != scene.options or headings < OUTLINE_HEADINGS
    return PathsFound(generation, scene, options, outline, draft, time.perf_counter() - began)


def _outline_headings(scene: Scene, options: PredictionOptions, count: int) -> FloatArray:
    if scene.board.ring is not None:
        return scene.board.ring.headings(scene.pose)
    one_search = paths_serve_all_headings(scene.board, options.unit)
    return np.linspace(0, 2 * np.pi, OUTLINE_HEADINGS if one_search else count, endpoint=False)


def outline_chances(result: PathsFound) -> "RangeShading":
    """Return the probabilities of ranges at every heading of the outline; it searches the fainter paths too."""
    # slow to load, and few boards state a spread
    from sonarhw_compare.pictures import shading_of
    from sonarhw_sim.predict.probability import possible_readings, scan_with_fainter_paths

    scene, headings = result.scene, result.outline.headings
    room, _ = room_and_place(scene)
    scan = scan_with_fainter_paths(room, scene.pose, scene.board, headings, result.options)
    possible = [possible_readings(scan, index) for index in range(len(headings))]
    return shading_of(possible, headings)


@dataclass(frozen=True)
class Stretch:
    """Consecutive readings, compared with the prediction."""

    first: int  # number of the reading in row 0
    comparison: Comparison
    draft: bool = False
    scene_generation: int = 0

    @property
    def end(self) -> int:
        """The number after the last reading."""
        return self.first + len(self.comparison.readings)

    @cached_property
    def paths(self) -> tuple[IntArray, tuple[str, ...]]:
        """Index of each reading's path name or NO_PATH, (n,), and the names.

        The path of a missed echo is the predicted one.
        """
        prediction = self.comparison.prediction
        missed = self.comparison.kinds == KINDS.index(Kind.MISSED)
        numbers = np.where(missed, prediction.winners, self.comparison.paths)
        different, places = np.unique(numbers, return_inverse=True)
        names = {
            path: ">".join(prediction.paths.via(path, prediction.room)) for path in different.tolist() if path >= 0
        }
        in_order = sorted(set(names.values()))
        place = {path: in_order.index(name) for path, name in names.items()}
        return np.array([place.get(path, NO_PATH) for path in different.tolist()], np.int64)[places], tuple(in_order)


@dataclass(frozen=True)
class ComparedScan:
    """The compared stretches of one scan, in order; readings between them are not compared yet."""

    stretches: tuple[Stretch, ...]

    @property
    def end(self) -> int:
        """The number after the last compared reading."""
        return self.stretches[-1].end

    @property
    def scene_generation(self) -> int:
        """The generation of the newest prediction in it."""
        return max(stretch.scene_generation for stretch in self.stretches)

    @property
    def draft(self) -> bool:
        """Whether a stretch was compared with a draft."""
        return any(stretch.draft for stretch in self.stretches)

    def stretch_of(self, reading: int) -> Stretch | None:
        """Return the stretch of a reading; None if it was not compared."""
        place = bisect_right(self.stretches, reading, key=lambda stretch: stretch.first) - 1
        return self.stretches[place] if place >= 0 and reading < self.stretches[place].end else None

    def row(self, reading: int) -> Matched | None:
        """Return the comparison of a reading; None if it was not compared."""
        stretch = self.stretch_of(reading)
        return None if stretch is None else stretch.comparison.row(reading - stretch.first)

    def with_newer(self, newer: Iterable[Stretch]) -> "ComparedScan":
        """Return the scan with these stretches, without those that they replace and those of an earlier scene."""
        by_first = {stretch.first: stretch for stretch in self.stretches}
        for stretch in newer:
            for first in [first for first in by_first if stretch.first <= first < stretch.end]:
                del by_first[first]
            by_first[stretch.first] = stretch
        generation = max(stretch.scene_generation for stretch in by_first.values())
        kept = (by_first[first] for first in sorted(by_first))
        return ComparedScan(tuple(stretch for stretch in kept if stretch.scene_generation == generation))


NumberedReadings = tuple[tuple[int, tuple[Reading, ...]], ...]  # stretches, each with the number of its first reading


def compare_stretches(
    result: PathsFound, stretches: NumberedReadings, begin: RobotPose | None = None
) -> tuple[Stretch, ...]:
    """Compare stretches with the prediction from these paths.

    `begin`: the pose of the first reading of the scan, which was made at the place of the scene.
    """
    return tuple(_compared(result, first, readings, begin) for first, readings in stretches)


def _compared(result: PathsFound, first: int, readings: tuple[Reading, ...], begin: RobotPose | None) -> Stretch:
    scene = result.scene
    room, _ = room_and_place(scene)
    poses = scene.poses_of(readings, begin)
    if poses is None:
        headings = headings_of(readings, scene.pose, scene.board)
        prediction = predict_scan(room, scene.pose, scene.board, headings, result.options, result.paths)
    else:
        prediction = predicted_for(readings, room, places_at(scene.pose, poses), scene.board, result.options)
    if prediction.only_at is None and len(prediction.paths) == len(result.paths):
        # all stretches share one table of paths; their copies would fill the memory
        prediction = replace(prediction, paths=result.paths)
    stretch = Stretch(first, match_readings(readings, prediction), result.draft, result.generation)
    _ = stretch.comparison.predicted, stretch.paths  # computed here, not in the thread that draws
    return stretch


def find_and_compare(
    generation: int,
    scene: Scene,
    options: PredictionOptions,
    headings: int,
    stretches: NumberedReadings,
    begin: RobotPose | None,
) -> tuple[PathsFound, tuple[Stretch, ...]]:
    """Find paths and compare stretches with them, in one job: the window draws both at once."""
    result = find_paths(generation, scene, options, headings)
    return result, compare_stretches(result, stretches, begin)


class Comparer:
    """Keeps the comparison of one growing scan up to date with the newest paths, in stretches.

    The stretch of the selected reading is compared first, then its neighbours, then the rest. The readings of a running
    scan are compared in short stretches, so that each is compared a few times only, and again together when there are
    STRETCH of them.
    """

    def __init__(self, jobs: Jobs, changed: Callable[[], None]) -> None:
        """`changed` is called when readings were compared."""
        self.compared: ComparedScan | None = None
        self.around: int | None = None  # reading whose stretch is compared first; None: the newest
        self._readings: Sequence[Reading] = ()
        self._result: PathsFound | None = None
        self.scan = 0  # number of the scan of the readings
        self._jobs, self._changed = jobs, changed

    def begin_scan(self) -> None:
        """Drop the readings; later readings belong to another scan."""
        self.compared, self._readings, self.around = None, (), None
        self.scan += 1

    def follow(self, readings: Sequence[Reading]) -> None:
        """Compare all these readings; until `begin_scan` they only grow."""
        self._readings = readings
        self._submit()

    def use(self, result: PathsFound | None, compared: tuple[Stretch, ...] = (), scan: int = 0) -> None:
        """Compare with the prediction from these paths; `compared` are stretches of a `scan` already compared."""
        self._result = result
        if compared:
            self._take(scan, compared)
        else:
            self._submit()

    def first(self, scene: Scene, options: PredictionOptions) -> tuple[NumberedReadings, RobotPose | None]:
        """Return the stretches to compare first with a new prediction, and the pose of the first reading."""
        count = len(self._readings)
        bounds = ((begin, min(begin + STRETCH, count)) for begin in range(0, count, STRETCH))
        return self._chosen(bounds, scene, options)

    @property
    def uncompared(self) -> int:
        """The number of readings that are not compared with the newest paths yet; 0 without paths."""
        if self._result is None:
            return 0
        return len(self._readings) - sum(stretch.end - stretch.first for stretch in self._current)

    def _take(self, scan: int, stretches: tuple[Stretch, ...]) -> None:
        if scan == self.scan:
            self.compared = (self.compared or ComparedScan(())).with_newer(stretches)
            self._changed()
        self._submit()  # not after a failure: the same request would fail again

    def _submit(self) -> None:
        result = self._result
        if result is None or self._jobs.busy(_COMPARE):
            return
        stretches, begin = self._chosen(self._stale(), result.scene, result.options)
        if stretches:
            self._jobs.run(_COMPARE, compare_stretches, result, stretches, begin, then=partial(self._take, self.scan))

    def _chosen(
        self, bounds: Iterable[tuple[int, int]], scene: Scene, options: PredictionOptions
    ) -> tuple[NumberedReadings, RobotPose | None]:
        """Return the stretches within these bounds that are compared next, and the pose of the first reading."""
        alike = paths_serve_all_headings(scene.board, options.unit)
        around = len(self._readings) - 1 if self.around is None else self.around
        nearest = sorted(bounds, key=lambda stretch: _distance(stretch, around))
        chosen = nearest[: _AT_ONCE if alike else 1]  # otherwise each heading needs its own search
        stretches = tuple((begin, tuple(self._readings[begin:end])) for begin, end in chosen)
        return stretches, self._readings[0].pose if self._readings else None

    @property
    def _current(self) -> list[Stretch]:
        """The stretches that are compared with the newest paths."""
        result, compared = self._result, self.compared
        if result is None or compared is None:
            return []
        newest = (result.generation, result.draft)
        return [stretch for stretch in compared.stretches if (stretch.scene_generation, stretch.draft) == newest]

    def _stale(self) -> Iterator[tuple[int, int]]:
        """Yield begin and end of the stretches that are to be compared with the newest paths."""
        if self._result is None:
            return
        last = {stretch.first // STRETCH: stretch for stretch in self._current}  # of each STRETCH readings
        for begin in range(0, len(self._readings), STRETCH):
            end, compared = min(begin + STRETCH, len(self._readings)), last.get(begin // STRETCH)
            if compared is None or (end == begin + STRETCH and compared.first > begin):
                yield begin, end
            elif compared.end < end:
                yield (compared.first if compared.end - compared.first < _SHORT_SCAN else compared.end), end


def _distance(stretch: tuple[int, int], reading: int) -> int:
    """Return how far a reading is from a stretch; 0 inside."""
    begin, end = stretch
    return max(begin - reading, reading - end + 1, 0)


class Forecast:
    """Keeps outline and comparison up to date with the scene and the readings."""

    def __init__(self, jobs: Jobs, clock: Callable[[], float] = time.monotonic) -> None:
        self.outline: PredictedScan | None = None
        self.chances: RangeShading | None = None  # of the outline, after the search for all paths
        self.outdated = False  # whether the comparison is of a previous scene for longer than LATE
        self._jobs, self._clock = jobs, clock
        self._changed = False  # since the last call of `take`
        self._level = FIRST_LEVEL  # of the effort of the next draft
        self._scene: Scene | None = None
        self._result: PathsFound | None = None
        self._generation = 0  # number of the scene; every change increments it
        self._changed_at: dict[int, float] = {}  # generation: time of its change; only those after the compared scene
        self._moved_at = -math.inf  # of the last change of the scene
        self._oldest = 0  # older generations belong to another room
        self._search_at: float | None = None  # time of the next search for all paths
        self._comparer = Comparer(jobs, self._note_compared)

    @property
    def compared(self) -> ComparedScan | None:
        """The readings that are compared so far; None before the first."""
        return self._comparer.compared

    @property
    def uncompared(self) -> int:
        """The number of readings that are not compared with the newest paths yet."""
        return self._comparer.uncompared

    @property
    def dragging(self) -> bool:
        """Whether the scene was moved a moment ago, so that drafts follow each other."""
        return self._search_at is not None

    @property
    def searching(self) -> bool:
        """Whether the search for all paths is not finished; until then there is a draft, or nothing."""
        return self._search_at is not None or self._jobs.busy(_DRAFT) or self._jobs.busy(_FIND)

    def set_scene(self, scene: Scene) -> None:
        """Predict for `scene` from now on, and drop the results for the previous scene."""
        self._result, self.outline, self.chances = None, None, None
        self._comparer.use(None)
        self._oldest = self._generation + 1
        self.begin_scan()
        self.change_scene(scene)

    def change_scene(self, scene: Scene, moving: bool = False) -> None:
        """Predict for the changed `scene`; the previous results stay until there are new ones.

        `moving`: during a drag only drafts are computed.
        """
        self._scene = scene
        self._generation += 1
        now = self._clock()
        # on a slow computer, twice the time between two movements is longer, and a search would slow a drag down
        rest = min(max(2 * (now - self._moved_at), SHORT_REST), REST) if moving else 0.0
        self._changed_at[self._generation], self._moved_at, self._search_at = now, now, None
        if scene.room is None:
            return
        effort = EFFORTS[self._level]
        options = effort.limit(scene.options)
        self._jobs.run(
            _DRAFT,
            find_and_compare,
            self._generation,
            scene,
            options,
            effort.headings,
            *self._comparer.first(scene, options),
            then=partial(self._accept_compared, self._comparer.scan),
        )
        self._search_at = now + rest
        self._search_when_due()

    def begin_scan(self) -> None:
        """Drop the readings; later readings belong to another scan."""
        self._comparer.begin_scan()

    def follow(self, readings: Sequence[Reading]) -> None:
        """Compare `readings`, all readings of the scan so far; until `begin_scan` they only grow."""
        self._comparer.follow(readings)

    def prefer(self, reading: int | None) -> None:
        """Compare the stretch of this reading first."""
        self._comparer.around = reading

    def take(self) -> bool:
        """Search all paths if that is due, and return whether anything has changed since the last call."""
        self._search_when_due()
        changed = self._update_outdated() or self._changed
        self._changed = False
        return changed

    def _update_outdated(self) -> bool:
        """Update `outdated`; return whether it changed. Only a comparison of the newest scene clears it."""
        was, compared = self.outdated, self.compared
        if compared is None or compared.scene_generation >= self._generation:
            self.outdated = False
        else:
            since = self._changed_at.get(compared.scene_generation + 1, self._clock())
            self.outdated = was or self._clock() - since >= LATE
        return self.outdated is not was

    def _search_when_due(self) -> None:
        if self._scene is not None and self._search_at is not None and self._clock() >= self._search_at:
            self._search_at = None
            self._jobs.run(_FIND, find_paths, self._generation, self._scene, self._scene.options, then=self._accept)

    def _accept_compared(self, scan: int, both: tuple[PathsFound, tuple[Stretch, ...]]) -> None:
        self._accept(*both, scan)

    def _accept(self, result: PathsFound, compared: tuple[Stretch, ...] = (), scan: int = 0) -> None:
        """Use these paths if they are of a newer scene, or complete instead of a draft of the same scene."""
        if result.draft:
            self._level = next_level(self._level, result.took)
        if result.generation < self._oldest or (self._result is not None and _rank(result) <= _rank(self._result)):
            return
        self._result, self.outline, self.chances, self._changed = result, result.outline, None, True
        if not result.draft and result.outline.board.states_spread:
            self._jobs.run(_WEIGH, outline_chances, result, then=partial(self._take_chances, result))
        if self.compared is None:
            self._forget_changes(result.generation)
        self._comparer.use(result, compared, scan)

    def _take_chances(self, result: PathsFound, chances: "RangeShading") -> None:
        if result is self._result:
            self.chances, self._changed = chances, True

    def _note_compared(self) -> None:
        self._changed = True
        if self.compared is not None:
            self._forget_changes(self.compared.scene_generation)

    def _forget_changes(self, done: int) -> None:
        self._changed_at = {scene: when for scene, when in self._changed_at.items() if scene > done}


def _rank(result: PathsFound) -> tuple[int, bool]:
    return result.generation, not result.draft
