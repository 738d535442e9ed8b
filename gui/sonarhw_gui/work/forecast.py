"""The prediction that the window shows: paths, outline and comparison, computed in threads.

Paths are computed twice: first a quick draft, then all paths. During a drag there are only drafts. Answers for a scene
or scan that is no longer shown are dropped.
"""

import math
import time
from collections.abc import Callable, Sequence

from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw.readings import Reading
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.work.comparing import ComparedScan, Comparer
from sonarhw_gui.work.effort import EffortChoice
from sonarhw_gui.work.outline_chances import ChancesRequest, OutlineChances
from sonarhw_gui.work.prediction_requests import PathsFound, PathsRequest
from sonarhw_gui.work.worker import Failure, Worker

LATE = 0.15  # s before values of the previous scene are marked as outdated; a shorter time makes them flicker
# s without a movement, after which a drag is considered to pause: at least the first, at most the second
SHORT_REST, REST = 0.05, 0.1


class Forecast:
    """Keeps outline and comparison up to date with the scene and the readings."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.outline: PredictedScan | None = None
        self.chances: OutlineChances | None = None  # of the outline, after the search for all paths
        self.outdated = False  # whether the comparison is of a previous scene for longer than LATE
        self.failures: list[str] = []
        self._clock = clock
        self._effort = EffortChoice()
        self._scene: Scene | None = None
        self._found: PathsFound | None = None
        self._generation = 0  # number of the scene; every change increments it
        self._changed_at: dict[int, float] = {}  # generation: time of its change; only those after the compared scene
        self._moved_at = -math.inf  # of the last change of the scene
        self._oldest = 0  # older generations belong to another room
        self._search_at: float | None = None  # time of the next search for all paths
        # four threads: drafts and comparisons never wait for the search for all paths, nor for probabilities
        self._drafter = Worker("draft paths")
        self._finder = Worker("find paths")
        self._weigher = Worker("probabilities")
        self._comparer = Comparer()

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
        return self._search_at is not None or self._drafter.busy or self._finder.busy

    def set_scene(self, scene: Scene) -> None:
        """Predict for `scene` from now on, and drop the results for the previous scene."""
        self._found, self.outline, self.chances = None, None, None
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
        effort = self._effort.effort
        self._drafter.submit(PathsRequest(self._generation, scene, effort.limit(scene.options), effort.headings))
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
        """Fetch the answers since the last call; return whether anything has changed."""
        self._search_when_due()
        changed = False
        for answer in (answer for worker in self._workers for answer in worker.take()):
            changed = self._accept(answer) or changed
        changed = self._take_compared() or changed
        return self._update_outdated() or changed

    def close(self) -> None:
        """End the threads."""
        for worker in self._workers:
            worker.close()
        self._comparer.close()

    @property
    def _workers(self) -> tuple[Worker, ...]:
        return self._drafter, self._finder, self._weigher

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
            self._finder.submit(PathsRequest(self._generation, self._scene, self._scene.options))

    def _take_compared(self) -> bool:
        changed, failures = self._comparer.take()
        self.failures += [failure.message for failure in failures]
        if self.compared is not None and changed:
            self._forget_changes(self.compared.scene_generation)
        return changed or bool(failures)

    def _accept(self, answer: PathsFound | OutlineChances | Failure) -> bool:
        match answer:
            case Failure():
                self.failures.append(answer.message)
                return True
            case PathsFound():
                if answer.draft:
                    self._effort.record(answer.took)
                return self._accept_paths(answer)
            case OutlineChances() if self._found is not None and answer.generation == self._found.generation:
                self.chances = answer
                return True
        return False

    def _accept_paths(self, found: PathsFound) -> bool:
        """Use these paths if they are of a newer scene, or complete instead of a draft of the same scene."""
        known = self._found
        if found.generation < self._oldest or (known is not None and _rank(found) <= _rank(known)):
            return False
        self._found, self.outline, self.chances = found, found.outline, None
        if not found.draft and found.outline.board.states_spread:
            self._weigher.submit(ChancesRequest(found))
        if self.compared is None:
            self._forget_changes(found.generation)
        self._comparer.use(found)
        return True

    def _forget_changes(self, done: int) -> None:
        self._changed_at = {scene: at for scene, at in self._changed_at.items() if scene > done}


def _rank(found: PathsFound) -> tuple[int, bool]:
    return found.generation, not found.draft
