"""Picture of two scans: both ranges against heading, and below them their difference."""

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from sonarhw_compare.pictures.colours import EXTRA, LONG, MEASURED, MISSED, PREDICTED, SHORT, WALL
from sonarhw_compare.pictures.picture_text import picture_text
from sonarhw_compare.pictures.shown_figure import laid_out, new_figure
from sonarhw_compare.two_scans.scan_difference import ScanChange, ScanDifference

# colour and marker of each change; the colours of short, long, extra and missed readings mean the same there
LOOK = {
    ScanChange.SAME: (WALL, "o"),
    ScanChange.NEARER: (SHORT, "v"),
    ScanChange.FARTHER: (LONG, "^"),
    ScanChange.FELL_SILENT: (MISSED, "x"),
    ScanChange.APPEARED: (EXTRA, "+"),
}


def draw_difference(difference: ScanDifference, names: tuple[str, str]) -> Figure:
    """Return a figure of two scans, called `names` in the legend, and their differences by heading."""
    figure = new_figure(9, 6.5, 120)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    headings = np.degrees([row.heading for row in difference.rows])
    marks = ((names[0], "o", PREDICTED, "none", 6), (names[1], ".", MEASURED, MEASURED, 6))
    for which, (name, marker, colour, fill, size) in enumerate(marks):
        medians = [(row.first, row.second)[which].median for row in difference.rows]
        ranges = np.array([math.nan if median is None else median for median in medians])
        above.plot(headings, ranges, marker, color=colour, mfc=fill, ms=size, ls="none", label=picture_text(name))
    above.set(ylabel="range (m)", ylim=(0, None))
    _draw_differences(below, difference)
    below.set(xlabel="heading (°)", ylabel="second minus first (cm)")
    below.xaxis.set_major_locator(MaxNLocator(9, steps=(1, 1.5, 3, 4.5, 9, 10)))  # 15°, 30°, 45°, 90°
    for axes in (above, below):
        axes.grid(alpha=0.25)
    figure.legend(loc="outside upper center", ncols=4)
    return laid_out(figure)


def _draw_differences(axes: Axes, difference: ScanDifference) -> None:
    headings = np.degrees([row.heading for row in difference.rows])
    limit = 100 * np.array([row.limit for row in difference.rows])
    axes.fill_between(headings, -limit, limit, step="mid", color=WALL, alpha=0.2, lw=0, label="explained by noise")
    for change, (colour, marker) in LOOK.items():
        rows = [row for row in difference.rows if row.change is change]
        if rows:
            # a heading that is silent in one scan has no difference; its mark is on the axis
            centimetres = [100 * (row.difference or 0.0) for row in rows]
            at = np.degrees([row.heading for row in rows])
            axes.plot(at, centimetres, marker, color=colour, ms=5, ls="none", label=change.value)
