"""The rooms in docs/how_to/rooms.md: legs of a table are detected from below its top; foam has a table of values."""

import math
import re

import numpy as np
import pytest
from sonarhw_sim.air import Receiver
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import parse_room

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
BLOCKS = re.findall(r"```toml\n(.*?)```", (CHECKOUT / "docs/how_to/rooms.md").read_text(), flags=re.DOTALL)


@pytest.mark.parametrize(
    ("place", "range_m"),
    [
        ("below", 3.0 - 2.15 - 0.03),  # the near side of the leg
        ("level", 3.0 - 2.2),  # the edge of the top
    ],
)
def test_the_first_echo_comes_from_the_leg_or_the_top(place: str, range_m: float) -> None:
    _, table = BLOCKS
    room = parse_room(f'name = "Table"\n{ROOM}{table}', "table.toml")
    options = PredictionOptions(receiver=Receiver.FIRST_ECHO)
    scan = sonarhw.predict(room, place, headings=math.pi, options=options)
    assert scan.ranges[0] == pytest.approx(range_m, abs=1e-6)


def test_foam_is_a_material() -> None:
    foam, _ = BLOCKS
    room = parse_room(f'name = "Foam"\n{foam}{ROOM.replace(chr(34) + "wood", chr(34) + "foam")}', "foam.toml")
    (reflectances,) = room.tables["foam"].at(np.radians([30.0]), np.array([50e3, 55e3, 60e3]))
    assert reflectances == pytest.approx([0.45, 0.425, 0.4])
