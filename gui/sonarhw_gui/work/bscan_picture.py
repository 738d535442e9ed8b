"""The B-scan as pixels, flat or polar.

Colours are looked up before positions, so a picture of half a million pixels takes some milliseconds.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from sonarhw_compare.pictures.bscan import SAME_HEADING, BScan, RangeCells
from sonarhw_compare.pictures.trace_levels import in_db

from sonarhw.readings import FloatArray
from sonarhw_gui.look.palette import Palette
from sonarhw_gui.work.bscan_rows import BScanRows

if TYPE_CHECKING:
    from matplotlib.colors import Colormap

Pixels = NDArray[np.uint8]  # (height, width, 4), first the lowest row; not opaque where nothing is known
COLOURS = 256
_SIDE = 1200  # pixels of a polar picture
_TURN = round(math.tau / SAME_HEADING)  # columns of a flat one
_DIFFERENCE_DB = 30.0
_DIFFERENCE = 0.5  # of full scale


class Pane(Enum):
    """What a B-scan shows."""

    MEASURED = "Measured"
    PREDICTED = "Predicted"
    DIFFERENCE = "Difference"


@dataclass(frozen=True)
class BScanSettings:
    """What a person wants to see of the B-scan."""

    panes: tuple[Pane, ...]
    polar: bool
    decibels: bool


@dataclass(frozen=True)
class ColourScale:
    """Which colour is which level."""

    colours: NDArray[np.uint8]  # (COLOURS, 4)
    low: float
    high: float
    label: str  # with its unit

    def of(self, values: FloatArray) -> NDArray[np.uint32]:
        """The colour of every value, same shape, four bytes in one; nothing at all where it is NaN."""
        steps = (values - self.low) * ((COLOURS - 1) / (self.high - self.low))
        unknown = np.isnan(steps)
        rows = np.where(unknown, 0.0, steps).clip(0, COLOURS - 1).astype(np.intp)
        return np.asarray(np.where(unknown, np.uint32(0), self.colours.view(np.uint32)[rows, 0]))


@dataclass(frozen=True)
class PanePicture:
    """One pane, drawn."""

    pixels: Pixels
    scale: ColourScale


@dataclass(frozen=True)
class BScans:
    """The B-scan as far as it is worked out."""

    generation: int
    settings: BScanSettings
    rows: BScanRows
    measured: BScan
    predicted: BScan
    pictures: Mapping[Pane, PanePicture]


@lru_cache(maxsize=16)
def colour_scale(pane: Pane, decibels: bool, floor_db: float, palette: Palette) -> ColourScale:
    """The colours of one pane; those of a difference run from predicted's colour by the paper's to measured's."""
    # half a second, which only the first picture takes, and not every start of the window
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
    """Where heading and range lie in a polar picture: the transducer stands on an arm that turns about the place."""

    ahead: float = 0.0  # of the turning axis, m
    left: float = 0.0  # of it, m

    def reach(self, range_: float) -> float:
        """How far off the axis a range lies, m."""
        return math.hypot(self.ahead + range_, self.left)

    def places(self, headings: FloatArray, ranges: FloatArray) -> FloatArray:
        """Where they lie off the axis, (n, 2) float, m."""
        cosines, sines, along = np.cos(headings), np.sin(headings), self.ahead + ranges
        return np.column_stack((along * cosines - self.left * sines, along * sines + self.left * cosines))

    def seen_at(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Heading, rad, and range, m, of what lies there off the axis; NaN where no heading looks."""
        with np.errstate(invalid="ignore"):
            along = np.sqrt(x**2 + y**2 - self.left**2)
        return np.arctan2(y, x) - np.arctan2(self.left, along), along - self.ahead


def draw_bscan(bscan: BScan, scale: ColourScale, floor_db: float | None, polar: Arm | None) -> Pixels:
    """The picture of one pane: flat over heading (all of the turn) and range, or polar with heading 0 to the right."""
    coloured = scale.of(bscan.levels if floor_db is None else in_db(bscan.levels, floor_db))
    rows = bscan.rows_at(SAME_HEADING * np.arange(_TURN, dtype=np.float64))
    # one row more, of nothing: where a gap is, -1 picks it
    coloured = np.vstack((coloured, np.zeros((1, bscan.cells.count), dtype=np.uint32)))
    if polar is not None:
        headings, cells = _polar_places(bscan.cells, polar)
        beyond = np.concatenate((rows, [-1])) % len(coloured)
        pixels = np.take(coloured.reshape(-1), np.take(beyond * bscan.cells.count, headings) + cells)
        pixels = pixels.reshape(_SIDE, _SIDE)
    else:
        pixels = coloured[rows].T
    return np.ascontiguousarray(pixels).view(np.uint8).reshape(*pixels.shape, 4)


@lru_cache(maxsize=4)
def _polar_places(cells: RangeCells, arm: Arm) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Of every pixel of a polar picture which heading of _TURN, _TURN where none is drawn, and the cell; both flat."""
    along = ((np.arange(_SIDE) + 0.5) / _SIDE * 2 - 1) * arm.reach(cells.reach)
    directions, ranges = arm.seen_at(*np.meshgrid(along, along))
    drawn = (ranges >= 0) & (ranges < cells.reach)
    headings = np.full(drawn.shape, _TURN, dtype=np.int32)
    headings[drawn] = np.round(np.mod(directions[drawn], math.tau) / SAME_HEADING) % _TURN
    number = np.zeros(drawn.shape, dtype=np.int32)
    number[drawn] = (ranges[drawn] / cells.width).clip(0, cells.count - 1)
    return headings.ravel(), number.ravel()


def flat_area(cells: RangeCells) -> tuple[float, float, float, float]:
    """Where a flat picture lies: left and width in degrees, bottom and height in m (left, bottom, width, height)."""
    return -180.0 / _TURN, 0.0, 360.0, cells.reach


def polar_area(cells: RangeCells, middle: tuple[float, float], arm: Arm = Arm()) -> tuple[float, float, float, float]:
    """Where a polar picture round `middle` lies in the room, m (left, bottom, width, height)."""
    reach = arm.reach(cells.reach)
    return middle[0] - reach, middle[1] - reach, 2 * reach, 2 * reach
