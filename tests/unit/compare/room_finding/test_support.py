"""Readings speak for the walls that they are echoes of, and against walls that would have sent another echo."""

import math

import pytest
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.rooms.candidates import Support, support_of
from sonarhw_compare.rooms.draft import DraftEnd, DraftPost, DraftWall, RoomDraft
from sonarhw_compare.rooms.evidence import ROUGH, evidence_of
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.room.room import Place

from sonarhw.readings import Reading

BOARD = load_board("polaroid-6500")
HERE = Place("here", (0.0, 0.0))
SPEED = Air().speed_of_sound
EAST = DraftWall((1.0, 0.0), math.pi / 2, (DraftEnd(-1.0), DraftEnd(1.0)))
NORTH = DraftWall((0.0, 1.0), 0.0, (DraftEnd(-1.0), DraftEnd(0.8)))
BEHIND = DraftPost((-0.75, -0.75), 0.75 * math.sqrt(2) - 1.0)  # 1 m away, where it makes no ghost echo with a wall


def reading(number: int, degrees: float, far: float | None) -> Reading:
    times = () if far is None else (2 * far / SPEED,)
    return Reading(number, 0, 0, math.radians(degrees), float(number), times, SPEED)


def supports(*ranges: float | None) -> tuple[Support, ...]:
    """Return the support by readings of these ranges at 0°, 90° and 225°, of an east and a north wall and a post."""
    readings = [reading(k, heading, far) for k, (heading, far) in enumerate(zip((0, 90, 225), ranges, strict=True))]
    evidence = evidence_of([PlacedScan(readings, HERE)], [PoseSpread()], BOARD, Air())
    return support_of(evidence, RoomDraft((HERE,), {3: EAST, 7: NORTH}, (BEHIND,)), ROUGH)


@pytest.mark.parametrize(
    ("ranges", "for_it", "against_it"),
    [
        ((1.0, 1.0, None), {"wall 1": [0], "wall 2": [1]}, {"post 1": [2]}),
        ((None, 1.0, 1.0), {"wall 2": [1], "post 1": [2]}, {"wall 1": [0]}),
        ((1.0, None, 1.0), {"wall 1": [0], "post 1": [2]}, {"wall 2": [1]}),
    ],
)
def test_echoes_speak_for_and_silence_against(
    ranges: tuple[float | None, ...], for_it: dict[str, list[int]], against_it: dict[str, list[int]]
) -> None:
    for support in supports(*ranges):
        (speaking,), (contradicting,) = support.speaking(1), support.speaking(-1)
        assert speaking.nonzero()[0].tolist() == for_it.get(support.name, [])
        assert contradicting.nonzero()[0].tolist() == against_it.get(support.name, [])
