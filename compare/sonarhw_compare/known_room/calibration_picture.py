"""Picture of scans beside their predictions, before and after a calibration."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.known_room.room_calibration import RoomCalibration, ScanFigures
from sonarhw_compare.matching.match import Kind
from sonarhw_compare.pictures.colours import MEASURED, OWN_BODY, PREDICTED
from sonarhw_compare.pictures.picture_text import picture_text
from sonarhw_compare.pictures.shown_figure import laid_out, new_figure

MOST_SCANS = 8  # in one picture
_SILENT = -0.12  # of the largest range: where readings without an echo are drawn


def draw_calibration(found: RoomCalibration, scans: Sequence[PlacedScan]) -> Figure:
    """Return a figure with a row for each of the first 8 scans: range by heading, before and after."""
    shown = min(len(scans), MOST_SCANS)
    figure = new_figure(12, 0.8 + 2.1 * shown, 100)
    axes = figure.subplots(shown, 2, squeeze=False, sharex=True, sharey=True)
    for row in range(shown):
        for column, (when, figures) in enumerate((("before", found.before[row]), ("after", found.after[row]))):
            _draw(axes[row, column], figures)
            summary = figures.comparison.summary()
            share = "no echo" if summary.within_5cm is None else f"{summary.within_5cm:.0%} of echoes within 5 cm"
            silence = summary.no_echo_agreement
            title = f"{scans[row].name}, {when}: {share}" + ("" if silence is None else f", silence {silence:.0%}")
            axes[row, column].set_title(picture_text(title), fontsize=9, loc="left")
        axes[row, 0].set_ylabel("range (m)")
    axes[0, 0].yaxis.set_major_formatter(lambda value, _: f"{value:g}" if value >= 0 else "")  # shared by all
    for one in axes[-1]:
        one.set(xlabel="heading in the room (°)", xlim=(0, 360), xticks=range(0, 361, 45))
    handles = {
        label: handle for one in axes.flat for handle, label in zip(*one.get_legend_handles_labels(), strict=True)
    }
    figure.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=4, frameon=False)
    return laid_out(figure)


def _draw(axes: Axes, figures: ScanFigures) -> None:
    comparison = figures.comparison
    named = f"{comparison.origin.value} (grey band: no echo)"
    quiet = _SILENT * comparison.prediction.board.max_range
    headings = np.degrees(comparison.prediction.headings) % 360
    predicted = comparison.prediction.ranges
    axes.axhspan(2 * quiet, quiet / 2, color="#EEEEEE")
    axes.plot(headings, _or(predicted, quiet * 1.4), "o", mfc="none", mec=PREDICTED, ms=4, mew=0.8, label="predicted")
    for kinds, colour, marker, label in (
        ([kind for kind in Kind if kind is not Kind.OWN_BODY], MEASURED, ".", named),
        ([Kind.OWN_BODY], OWN_BODY, "d", "own body"),
    ):
        rows = [row for row in comparison.rows if row.kind in kinds]
        if rows:
            measured = np.array([math.nan if row.measured is None else row.measured for row in rows])
            at = np.degrees([row.heading for row in rows]) % 360
            axes.plot(at, _or(measured, quiet), marker, color=colour, ms=4, ls="none", label=label)
    axes.grid(alpha=0.25)


def _or(values: np.ndarray, instead: float) -> np.ndarray:
    return np.where(np.isnan(values), instead, values)
