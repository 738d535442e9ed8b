"""The picture of a checked room shows where the zero of the turntable points, and its texts are apart."""

import math
from itertools import combinations

import pytest
from sonarhw_compare.drawings import draw_checked_room
from sonarhw_sim.check import Finding
from sonarhw_sim.room.room import parse_room

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


def test_no_text_covers_another() -> None:
    # three places at one position, and one so near that its name would cover theirs
    more = "".join(
        f"[places.{name}]\nposition = [{x}, 2.0]\nheading_deg = {heading}\n"
        for name, x, heading in (("robot", 1.0, 40), ("tripod", 1.0, 220), ("shelf", 1.1, 0))
    )
    at = ((1.0, 2.0),)
    findings = [Finding("place in wall", "desk", "", "", at), Finding("place in object", "robot", "", "", at)]
    figure = draw_checked_room(parse_room(ROOM.format(heading=90) + more, "square"), findings)
    figure.canvas.draw()  # as saved
    (axes,) = figure.axes
    texts = {text.get_text(): text.get_window_extent() for text in axes.texts if text.arrow_patch is None}
    assert list(texts) == ["desk, robot, tripod", "shelf", "1, 2"]
    assert not any(one.overlaps(other) for one, other in combinations(texts.values(), 2))
    arrows = [text.get_window_extent() for text in axes.texts if text.arrow_patch is not None]
    assert not any(text.overlaps(arrow) for text in texts.values() for arrow in arrows)


def test_the_arrow_of_a_place_outside_is_drawn() -> None:
    place = "[places.out]\nposition = [4.5, 2.0]\n"
    figure = draw_checked_room(parse_room(ROOM.format(heading=0) + place, "square"))
    figure.canvas.draw()
    (axes,) = figure.axes
    arrows = [text.get_window_extent() for text in axes.texts if text.arrow_patch is not None]
    assert len(arrows) == 2
    assert all(axes.bbox.x1 > arrow.x1 for arrow in arrows)
