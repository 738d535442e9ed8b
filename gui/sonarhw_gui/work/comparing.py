"""Compares every reading of a scan with the prediction, in stretches, in a thread.

The stretch of the selected reading is compared first, then its neighbours, then the rest. The readings of a running
scan are compared in short stretches, so that each is compared a few times only, and again together when there are
STRETCH of them.
"""

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from sonarhw_compare.match import Comparison, Kind, Matched, headings_of, match_readings
from sonarhw_sim.predict.prediction import paths_serve_all_headings, predict_scan

from sonarhw.readings import FloatArray, Reading
from sonarhw_gui.scene.scene_edit import room_and_place
from sonarhw_gui.work.prediction_requests import PathsFound
from sonarhw_gui.work.worker import Failure, Worker

IntArray = NDArray[np.int64]
STRETCH = 360  # readings that are compared together
_SHORT = 30  # readings; a shorter stretch is compared again together with those that follow
_AT_ONCE = 4  # stretches of one request; about 0.1 s
KINDS = {kind: code for code, kind in enumerate(Kind)}
NO_PATH = -1


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
        return self.first + len(self.comparison.rows)

    @cached_property
    def predicted(self) -> FloatArray:
        """Predicted ranges, (n,) m; NaN: no echo."""
        return np.array([np.nan if row.predicted is None else row.predicted for row in self.comparison.rows], float)

    @cached_property
    def kinds(self) -> IntArray:
        """Index of each reading's class in `Kind`, (n,)."""
        return np.array([KINDS[row.kind] for row in self.comparison.rows], np.int64)

    @cached_property
    def paths(self) -> tuple[IntArray, tuple[str, ...]]:
        """Index of each reading's path name or NO_PATH, (n,), and the names.

        The path of a missed echo is the predicted one.
        """
        prediction, rows = self.comparison.prediction, self.comparison.rows
        missed = {row.index: int(prediction.winners[row.index]) for row in rows if row.kind is Kind.MISSED}
        found = np.array([missed.get(row.index, NO_PATH) if row.path is None else row.path for row in rows], np.int64)
        different, places = np.unique(found, return_inverse=True)
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
        return None if stretch is None else stretch.comparison.rows[reading - stretch.first]

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


@dataclass(frozen=True)
class CompareRequest:
    """Compare stretches of readings with the prediction from these paths."""

    scan: int  # number of the scan
    found: PathsFound
    stretches: tuple[tuple[int, tuple[Reading, ...]], ...]  # number of the first reading, and the readings

    def answer(self) -> "StretchesCompared":
        """Compare the readings."""
        return StretchesCompared(self.scan, tuple(self._compared(*stretch) for stretch in self.stretches))

    def _compared(self, first: int, readings: tuple[Reading, ...]) -> Stretch:
        found, scene = self.found, self.found.scene
        room, _ = room_and_place(scene)
        headings = headings_of(readings, scene.pose, scene.board)
        prediction = predict_scan(room, scene.pose, scene.board, headings, found.options, found.paths)
        if prediction.only_at is None and len(prediction.paths) == len(found.paths):
            # all stretches share one table of paths; their copies would fill the memory
            prediction = replace(prediction, paths=found.paths)
        stretch = Stretch(first, match_readings(readings, prediction), found.draft, found.generation)
        _ = stretch.predicted, stretch.kinds, stretch.paths  # computed here, not in the thread that draws
        return stretch


@dataclass(frozen=True)
class StretchesCompared:
    """The answer to a `CompareRequest`."""

    scan: int
    stretches: tuple[Stretch, ...]


class Comparer:
    """Keeps the comparison of one growing scan up to date with the newest paths."""

    def __init__(self) -> None:
        self.compared: ComparedScan | None = None
        self.around: int | None = None  # reading whose stretch is compared first; None: the newest
        self._readings: Sequence[Reading] = ()
        self._found: PathsFound | None = None
        self._scan = 0
        self._worker = Worker("compare readings")

    def begin_scan(self) -> None:
        """Drop the readings; later readings belong to another scan."""
        self.compared, self._readings, self.around = None, (), None
        self._scan += 1

    def follow(self, readings: Sequence[Reading]) -> None:
        """Compare all these readings; until `begin_scan` they only grow."""
        self._readings = readings
        self._submit()

    def use(self, found: PathsFound | None) -> None:
        """Compare with the prediction from these paths."""
        self._found = found
        self._submit()

    @property
    def uncompared(self) -> int:
        """The number of readings that are not compared with the newest paths yet; 0 without paths."""
        if self._found is None:
            return 0
        return len(self._readings) - sum(stretch.end - stretch.first for stretch in self._current)

    def take(self) -> tuple[bool, list[Failure]]:
        """Fetch the answers; return whether anything was compared, and failures."""
        failures: list[Failure] = []
        changed = False
        for answer in self._worker.take():
            if isinstance(answer, Failure):
                failures.append(answer)
            elif answer.scan == self._scan:
                known = self.compared or ComparedScan(())
                self.compared, changed = known.with_newer(answer.stretches), True
        if not failures:  # a request that fails would fail again
            self._submit()
        return changed, failures

    def close(self) -> None:
        """End the thread."""
        self._worker.close()

    def _submit(self) -> None:
        found = self._found
        if found is None or self._worker.busy:
            return
        alike = paths_serve_all_headings(found.scene.board, found.options.unit)
        around = len(self._readings) - 1 if self.around is None else self.around
        nearest = sorted(self._stale(), key=lambda stretch: _apart(stretch, around))
        chosen = nearest[: _AT_ONCE if alike else 1]  # otherwise each heading needs its own search
        if chosen:
            stretches = tuple((begin, tuple(self._readings[begin:end])) for begin, end in chosen)
            self._worker.submit(CompareRequest(self._scan, found, stretches))

    @property
    def _current(self) -> list[Stretch]:
        """The stretches that are compared with the newest paths."""
        found, compared = self._found, self.compared
        if found is None or compared is None:
            return []
        newest = (found.generation, found.draft)
        return [stretch for stretch in compared.stretches if (stretch.scene_generation, stretch.draft) == newest]

    def _stale(self) -> Iterator[tuple[int, int]]:
        """Yield begin and end of the stretches that are to be compared with the newest paths."""
        if self._found is None:
            return
        last = {stretch.first // STRETCH: stretch for stretch in self._current}  # of each STRETCH readings
        for begin in range(0, len(self._readings), STRETCH):
            end, known = min(begin + STRETCH, len(self._readings)), last.get(begin // STRETCH)
            if known is None or (end == begin + STRETCH and known.first > begin):
                yield begin, end
            elif known.end < end:
                yield (known.first if known.end - known.first < _SHORT else known.end), end


def _apart(stretch: tuple[int, int], reading: int) -> int:
    """Return how far a reading is from a stretch; 0 inside."""
    begin, end = stretch
    return max(begin - reading, reading - end + 1, 0)
