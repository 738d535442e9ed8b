"""The picture of a checked room shows where the zero of the turntable points."""

import math

import pytest
from sonarhw_compare.pictures.room_picture import draw_checked_room
from sonarhw_sim.room.model import parse_room

ROOM = """
name = "square"
[materials.wood]
reflectance = 0.9
[[walls]]
name = "room"
points = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]
closed = true
material = "wood"
[places.desk]
position = [1.0, 2.0]
heading_deg = {heading}
"""


@pytest.mark.parametrize("heading", [0, 45, 225])
def test_the_arrow_of_a_place_points_along_its_heading(heading: int) -> None:
    (axes,) = draw_checked_room(parse_room(ROOM.format(heading=heading), "square")).axes
    (arrow,) = [text for text in axes.texts if text.arrow_patch is not None]
    (x, y), (tip_x, tip_y) = arrow.xyann, arrow.xy
    assert (x, y) == (1.0, 2.0)
    assert math.degrees(math.atan2(tip_y - y, tip_x - x)) % 360 == pytest.approx(heading)
