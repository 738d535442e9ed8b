"""The readings as rows of a table, in plain arrays that are extended while a scan grows."""

import math
from dataclasses import dataclass

import numpy as np
from sonarhw_compare.match import Kind

from sonarhw.readings import FloatArray, Reading
from sonarhw_gui.look.palette import Class, Unclassed
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.work.comparing import NO_PATH, ComparedScan, IntArray

CLASSES: tuple[Class, ...] = (*Kind, *Unclassed)  # begins with the codes of `Stretch.kinds`
CODES = {kind: code for code, kind in enumerate(CLASSES)}


@dataclass(frozen=True)
class ReadingRows:
    """One row for each reading; every array is (n,)."""

    readings: tuple[Reading, ...]
    angles: FloatArray  # of the turntable, degrees
    headings: FloatArray  # in the room, degrees from 0 to 360
    measured: FloatArray  # m; NaN: no echo
    predicted: FloatArray  # m; NaN: no echo, or not compared
    classes: IntArray  # indices into CLASSES
    paths: IntArray  # indices into `path_names`, or NO_PATH
    path_names: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.readings)

    @property
    def residuals(self) -> FloatArray:
        """Measured minus predicted, (n,) m; NaN if either has no echo."""
        return self.measured - self.predicted

    def path(self, row: int) -> str:
        """Return the path of a reading; empty if it is unknown."""
        return self.path_names[self.paths[row]] if self.paths[row] != NO_PATH else ""

    def counts(self) -> dict[Class, int]:
        """Return the number of readings of each class."""
        return dict(zip(CLASSES, np.bincount(self.classes, minlength=len(CLASSES)).tolist(), strict=True))


_EMPTY = np.empty(0)
_NONE = np.empty(0, np.int64)
NO_ROWS = ReadingRows((), _EMPTY, _EMPTY, _EMPTY, _EMPTY, _NONE, _NONE, ())


def rows_of(
    readings: tuple[Reading, ...],
    compared: ComparedScan | None,
    scene: Scene,
    before: ReadingRows = NO_ROWS,
) -> ReadingRows:
    """Return the rows of readings made in a scene.

    Values of the same readings are copied from the rows `before`.
    """
    known = _shared(before.readings, readings)
    fresh = readings[known:]
    angles = np.concatenate((before.angles[:known], np.degrees([reading.angle for reading in fresh])))
    ranges = (reading.range for reading in fresh)
    measured = np.concatenate((before.measured[:known], [math.nan if far is None else far for far in ranges]))
    uncompared = Unclassed.WAITING if scene.room else Unclassed.MEASURED
    predicted, classes, paths, names = _compared_values(len(angles), compared, CODES[uncompared])
    headings = np.mod(scene.board.turned(angles) + math.degrees(scene.pose.heading), 360.0)
    return ReadingRows(readings, angles, headings, measured, predicted, classes, paths, names)


def longer_of(rows: ReadingRows, earlier: ReadingRows) -> ReadingRows:
    """Return the longer of two tables if both are of one scan; else `rows`."""
    both = len(rows) and _shared(rows.readings, earlier.readings)
    return earlier if both and len(earlier) > len(rows) else rows


def _shared(earlier: tuple[Reading, ...], later: tuple[Reading, ...]) -> int:
    """Return how many leading readings are the same in both.

    One comparison is enough: a scan only grows, and a replay shows a longer or shorter part of one log.
    """
    both = min(len(earlier), len(later))
    return both if both and earlier[both - 1] is later[both - 1] else 0


def _compared_values(
    count: int, compared: ComparedScan | None, uncompared: int
) -> tuple[FloatArray, IntArray, IntArray, tuple[str, ...]]:
    """Return predicted ranges, classes and paths of `count` readings, and the names of the paths."""
    predicted, classes = np.full(count, math.nan), np.full(count, uncompared)
    paths = np.full(count, NO_PATH, np.int64)
    stretches = [stretch for stretch in (compared.stretches if compared else ()) if stretch.first < count]
    names = sorted(set().union(*(stretch.paths[1] for stretch in stretches)))
    places = {name: place for place, name in enumerate(names)}
    for stretch in stretches:
        here = slice(stretch.first, min(stretch.end, count))
        rows = slice(0, here.stop - here.start)
        predicted[here], classes[here] = stretch.predicted[rows], stretch.kinds[rows]
        found, own_names = stretch.paths
        paths[here] = np.array([*(places[name] for name in own_names), NO_PATH], np.int64)[found[rows]]
    return predicted, classes, paths, tuple(names)
