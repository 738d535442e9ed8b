"""Picture of a scan over its prediction, in the plan of the room."""

from matplotlib.figure import Figure

from sonarhw_compare.matching.match import Comparison
from sonarhw_compare.pictures.overlay_picture import draw_plan


def draw_comparison(comparison: Comparison) -> Figure:
    """Return a figure of the room with the scan over its prediction."""
    measured = [(row.heading, row.measured) for row in comparison.rows if row.measured is not None]
    return draw_plan(comparison.prediction, measured, origin=comparison.origin)
