"""All findings in a room: its plan, its materials, and places from which nothing is heard."""

import math
from collections.abc import Iterator

import numpy as np

from sonarhw_sim.board.profile import Board
from sonarhw_sim.check.finding import Finding
from sonarhw_sim.check.no_echo import reason_for_silence
from sonarhw_sim.check.plan_check import plan_findings
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.model import Room
from sonarhw_sim.room.room_file import RoomFile
from sonarhw_sim.room.room_writing import materials
from sonarhw_sim.toml_file import parse_table, problems_of

_STEP_DEG = 5.0  # from one heading to the next
_MOST_WALLS = 2000  # with more, no scan is predicted: it would take minutes


def check_room(room: Room, board: Board) -> list[Finding]:
    """Return everything that is probably wrong in a room, if it is scanned with `board`."""
    return [*plan_findings(room), *_unused_materials(room), *_silent_places(room, board)]


def refusals_of(text: str, where: str) -> list[str]:
    """Return a line for each error in the text of a room file; empty if it can be used. Raises InputError."""
    return problems_of(parse_table(text, where), RoomFile)


def _unused_materials(room: Room) -> Iterator[Finding]:
    for name in materials(room):
        if name not in room.materials:
            found = "no wall, post, floor or ceiling has it"
            yield Finding("unused material", f"material {name!r}", found, "use it, or remove it")


def _silent_places(room: Room, board: Board) -> Iterator[Finding]:
    """Yield the places inside the room at which the board detects nothing in a whole turn."""
    if len(room.walls) > _MOST_WALLS:
        return
    for place in room.places.values():
        if room.is_outside(place.position):
            continue
        headings = np.arange(0, math.tau, math.radians(_STEP_DEG)) if board.ring is None else board.ring.headings(place)
        if np.isnan(predict_scan(room, place, board, headings).ranges).all():
            found = f"nothing is heard here: {reason_for_silence(room, place, board)}"
            advice = "move the place, or use another board"
            yield Finding("silence", f"place {place.name!r}", found, advice, (place.position,))
