"""The B-scan as pixels, rectangular or polar.

The colour of each level is looked up before the pixels are placed, so half a million pixels take some milliseconds.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from sonarhw_compare.pictures import SAME_HEADING, BScan, RangeCells, in_db

from sonarhw.readings import FloatArray
from sonarhw_gui.look.palette import Palette
from sonarhw_gui.work.bscan_rows import BScanRows

if TYPE_CHECKING:
    from matplotlib.colors import Colormap

BScanPixels = NDArray[np.uint8]  # (height, width, 4), lowest row first; transparent where there is no value
COLOURS = 256
_SIDE = 1200  # pixels of a polar picture
_TURN = round(math.tau / SAME_HEADING)  # columns of a rectangular picture
_DIFFERENCE_DB = 30.0
_DIFFERENCE = 0.5  # of full scale


class Pane(Enum):
    """What a B-scan shows."""

    MEASURED = "Recorded"  # by a scanner or a program: the origin is in the legend
    PREDICTED = "Predicted"
    DIFFERENCE = "Difference"


@dataclass(frozen=True)
class BScanSettings:
    """The panes of the B-scan that are visible, and how they are drawn."""

    panes: tuple[Pane, ...]
    polar: bool
    decibels: bool


@dataclass(frozen=True)
class ColourScale:
    """The colours of the levels from `low` to `high`."""

    colours: NDArray[np.uint8]  # (COLOURS, 4)
    low: float
    high: float
    label: str  # with its unit

    def of(self, values: FloatArray) -> NDArray[np.uint32]:
        """Return the colour of every value, same shape, RGBA in one integer; 0 (transparent) for NaN."""
        steps = (values - self.low) * ((COLOURS - 1) / (self.high - self.low))
        unknown = np.isnan(steps)
        rows = np.where(unknown, 0.0, steps).clip(0, COLOURS - 1).astype(np.intp)
        return np.asarray(np.where(unknown, np.uint32(0), self.colours.view(np.uint32)[rows, 0]))


@dataclass(frozen=True)
class PanePicture:
    """The picture of one pane, and its colours."""

    pixels: BScanPixels
    scale: ColourScale


@dataclass(frozen=True)
class BScans:
    """The part of the B-scan that is computed so far."""

    generation: int
    settings: BScanSettings
    rows: BScanRows
    measured: BScan
    predicted: BScan
    pictures: Mapping[Pane, PanePicture]


@lru_cache(maxsize=16)
def colour_scale(pane: Pane, decibels: bool, floor_db: float, palette: Palette) -> ColourScale:
    """Return the colours of one pane; those of the difference go from predicted over the background to measured."""
    # the import takes half a second, so it waits for the first picture
    from matplotlib import colormaps
    from matplotlib.colors import LinearSegmentedColormap

    if pane is not Pane.DIFFERENCE:
        colours = _bytes(colormaps["cividis"])
        if decibels:
            return ColourScale(colours, floor_db, 0.0, "dB of full scale")
        return ColourScale(colours, 0.0, 1.0, "of full scale")
    named = [palette.predicted, palette.paper, palette.measured]
    colours = _bytes(LinearSegmentedColormap.from_list("difference", named))
    if decibels:
        return ColourScale(colours, -_DIFFERENCE_DB, _DIFFERENCE_DB, "difference (dB)")
    return ColourScale(colours, -_DIFFERENCE, _DIFFERENCE, "difference (of full scale)")


def _bytes(colours: "Colormap") -> NDArray[np.uint8]:
    return np.asarray(colours(np.linspace(0, 1, COLOURS), bytes=True), dtype=np.uint8)


@dataclass(frozen=True)
class Arm:
    """Geometry of a polar picture: the transducer is mounted on an arm that turns about the place."""

    ahead: float = 0.0  # m, in front of the axis
    left: float = 0.0  # m, to the left of the axis

    def reach(self, range_: float) -> float:
        """Return the distance of a range from the axis, m."""
        return math.hypot(self.ahead + range_, self.left)

    def points(self, headings: FloatArray, ranges: FloatArray) -> FloatArray:
        """Return the points at these headings and ranges, relative to the axis, (n, 2) float, m."""
        cosines, sines, along = np.cos(headings), np.sin(headings), self.ahead + ranges
        return np.column_stack((along * cosines - self.left * sines, along * sines + self.left * cosines))

    def headings_and_ranges(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return headings, rad, and ranges, m, of points x, y (m) relative to the axis, of the same shape.

        NaN for a point that no heading covers.
        """
        with np.errstate(invalid="ignore"):
            along = np.sqrt(x**2 + y**2 - self.left**2)
        return np.arctan2(y, x) - np.arctan2(self.left, along), along - self.ahead


def draw_bscan(bscan: BScan, scale: ColourScale, floor_db: float | None, polar: Arm | None) -> BScanPixels:
    """Return the picture of one pane: a full turn of headings by range, or polar with heading 0 to the right."""
    coloured = scale.of(bscan.levels if floor_db is None else in_db(bscan.levels, floor_db))
    rows = bscan.rows_at(SAME_HEADING * np.arange(_TURN, dtype=np.float64))
    # an additional transparent row for gaps: index -1 selects it
    coloured = np.vstack((coloured, np.zeros((1, bscan.cells.count), dtype=np.uint32)))
    if polar is not None:
        headings, cells = _polar_lookup(bscan.cells, polar)
        beyond = np.concatenate((rows, [-1])) % len(coloured)
        pixels = np.take(coloured.reshape(-1), np.take(beyond * bscan.cells.count, headings) + cells)
        pixels = pixels.reshape(_SIDE, _SIDE)
    else:
        pixels = coloured[rows].T
    return np.ascontiguousarray(pixels).view(np.uint8).reshape(*pixels.shape, 4)


@lru_cache(maxsize=4)
def _polar_lookup(cells: RangeCells, arm: Arm) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return column (0 to _TURN - 1, or _TURN outside) and cell of every pixel of a polar picture, both flattened."""
    along = ((np.arange(_SIDE) + 0.5) / _SIDE * 2 - 1) * arm.reach(cells.reach)
    directions, ranges = arm.headings_and_ranges(*np.meshgrid(along, along))
    drawn = (ranges >= 0) & (ranges < cells.reach)
    headings = np.full(drawn.shape, _TURN, dtype=np.int32)
    headings[drawn] = np.round(np.mod(directions[drawn], math.tau) / SAME_HEADING) % _TURN
    number = np.zeros(drawn.shape, dtype=np.int32)
    number[drawn] = (ranges[drawn] / cells.width).clip(0, cells.count - 1)
    return headings.ravel(), number.ravel()


def flat_area(cells: RangeCells) -> tuple[float, float, float, float]:
    """Return the area of a rectangular picture (left, bottom, width, height): left and width in degrees, else m."""
    return -180.0 / _TURN, 0.0, 360.0, cells.reach


def polar_area(cells: RangeCells, middle: tuple[float, float], arm: Arm) -> tuple[float, float, float, float]:
    """Return the area of a polar picture around `middle` in the room (left, bottom, width, height), m."""
    reach = arm.reach(cells.reach)
    return middle[0] - reach, middle[1] - reach, 2 * reach, 2 * reach
