"""Picture of a scan over its prediction, in the plan of the room."""

from matplotlib.figure import Figure
from sonarhw_sim.room.room import Room

from sonarhw_compare.matching.match import Comparison, Kind
from sonarhw_compare.pictures.overlay_picture import draw_plan
from sonarhw_compare.pictures.range_shading import RangeShading


def draw_comparison(comparison: Comparison, shading: RangeShading | None = None, changed: Room | None = None) -> Figure:
    """Return a figure of the room with the scan over its prediction, and the shading of `shading_around` behind.

    What only `changed` has is drawn as found: the room of `find_causes`.
    """
    measured = [row for row in comparison.rows if row.measured is not None]
    of_room, of_body = (
        [(row.heading, row.measured or 0.0) for row in measured if (row.kind is Kind.OWN_BODY) == own]
        for own in (False, True)
    )
    return draw_plan(
        comparison.prediction,
        of_room,
        origin=comparison.origin,
        own_body=of_body,
        shading=shading,
        changed=changed,
    )
