"""The table of docs/how_to/rooms.md: legs are detected from below the top, its edge at its height."""

import math
import re

import pytest
from sonarhw_sim.choices import Receiver
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.model import parse_room

import sonarhw
from tests.checkout import CHECKOUT

ROOM = """
[materials.wood]
reflectance = 0.95
[[walls]]
name = "room"
points = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]
closed = true
material = "wood"
"""


@pytest.mark.parametrize(
    ("place", "range_m"),
    [
        ("below", 3.0 - 2.15 - 0.03),  # the near side of the leg
        ("level", 3.0 - 2.2),  # the edge of the top
    ],
)
def test_the_first_echo_comes_from_the_leg_or_the_top(place: str, range_m: float) -> None:
    (table,) = re.findall(r"```toml\n(.*?)```", (CHECKOUT / "docs/how_to/rooms.md").read_text(), flags=re.DOTALL)
    room = parse_room(f'name = "Table"\n{ROOM}{table}', "table.toml")
    options = PredictionOptions(receiver=Receiver.FIRST_ECHO)
    scan = sonarhw.predict(room, place, headings=math.pi, options=options)
    assert scan.ranges[0] == pytest.approx(range_m, abs=1e-6)
