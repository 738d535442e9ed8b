"""The prediction behind the window: paths, outline and comparison, computed in threads.

Paths come twice: a quick draft, then all of them. While something is dragged there are drafts only. Answers for a scene
or scan that is no longer shown are dropped.
"""

import time
from collections.abc import Callable, Sequence

from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw.readings import Reading
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.work.effort import EffortChoice
from sonarhw_gui.work.prediction_requests import Compared, CompareRequest, PathsFound, PathsRequest
from sonarhw_gui.work.worker import Failure, Worker

MOST_COMPARED = 1440  # readings: the newest are compared, lest an hour of scanning fill the memory
LATE = 0.15  # s that figures of the scene before may stand without a sign: a shorter one would only flicker
REST = 0.2  # s without a movement, after which a hand is taken to stand still


class Forecast:
    """Keeps outline and comparison up with the scene and the readings."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.outline: PredictedScan | None = None
        self.compared: Compared | None = None
        self.outdated = False  # whether the comparison has belonged to a scene before for a while
        self.failures: list[str] = []
        self._clock = clock
        self._effort = EffortChoice()
        self._scene: Scene | None = None
        self._readings: Sequence[Reading] = ()
        self._found: PathsFound | None = None
        self._generation = 0  # of the scene; every change of it counts
        self._changed_at: dict[int, float] = {}  # when each scene after the one compared came to be shown
        self._oldest = 0  # what is older belongs to another room
        self._scan_generation = 0
        self._search_at: float | None = None  # when to seek the rest of the paths
        # three, so that drafts and a growing scan never wait for the rest of the paths
        self._drafter = Worker("draft paths")
        self._finder = Worker("find paths")
        self._comparer = Worker("compare readings")

    @property
    def searching(self) -> bool:
        """Whether paths are still sought; until then there is a draft, or nothing."""
        return self._search_at is not None or self._drafter.busy or self._finder.busy

    def set_scene(self, scene: Scene) -> None:
        """Predict for `scene` from now on, and forget the one before."""
        self._found, self.outline = None, None
        self._oldest = self._generation + 1
        self.begin_scan()
        self.change_scene(scene)

    def change_scene(self, scene: Scene, moving: bool = False) -> None:
        """Predict for `scene`, in which something has been changed; what is known stands until there is better.

        While a hand is `moving` there are drafts only.
        """
        self._scene = scene
        self._generation += 1
        self._changed_at[self._generation] = self._clock()
        self._search_at = None
        if scene.room is None:
            return
        effort = self._effort.effort
        self._drafter.submit(PathsRequest(self._generation, scene, effort.limit(scene.options), effort.headings))
        self._search_at = self._clock() + (REST if moving else 0.0)
        self._search_when_due()

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
        self._search_when_due()
        changed = False
        for answer in (*self._drafter.take(), *self._finder.take(), *self._comparer.take()):
            changed = self._take_in(answer) or changed
        return self._update_outdated() or changed

    def close(self) -> None:
        """End the threads."""
        for worker in (self._drafter, self._finder, self._comparer):
            worker.close()

    def _update_outdated(self) -> bool:
        """Whether it has changed that the comparison is behind; once it is, only that of the newest scene helps."""
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

    def _take_in(self, answer: PathsFound | Compared | Failure) -> bool:
        match answer:
            case Failure():
                self.failures.append(answer.message)
                return True
            case PathsFound():
                if answer.draft:
                    self._effort.took(answer.took)
                return self._take_found(answer)
            case Compared(generation=self._scan_generation):
                self.compared = answer
                self._forget_changes(answer.scene_generation)
                return True
        return False

    def _take_found(self, found: PathsFound) -> bool:
        """Take it where it is for a newer scene than what there is, or says more of the same."""
        known = self._found
        if found.generation < self._oldest or (known is not None and _rank(found) <= _rank(known)):
            return False
        self._found, self.outline = found, found.outline
        if self.compared is None:
            self._forget_changes(found.generation)
        self._ask()
        return True

    def _forget_changes(self, done: int) -> None:
        self._changed_at = {scene: at for scene, at in self._changed_at.items() if scene > done}

    def _ask(self) -> None:
        if self._found is None or not self._readings:
            return
        first = max(0, len(self._readings) - MOST_COMPARED)
        newest = tuple(self._readings[first:])
        self._comparer.submit(CompareRequest(self._scan_generation, self._found, newest, first))


def _rank(found: PathsFound) -> tuple[int, bool]:
    return found.generation, not found.draft
