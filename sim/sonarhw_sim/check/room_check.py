"""All findings in a room: its plan, its materials, and places from which nothing is heard."""

import math
from collections.abc import Iterator

import numpy as np

from sonarhw.errors import InputError
from sonarhw_sim.board.profile import Board
from sonarhw_sim.check.finding import Finding
from sonarhw_sim.check.no_echo import reason_for_silence
from sonarhw_sim.check.plan_check import plan_findings
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.model import Room
from sonarhw_sim.room.objects import object_around
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
    """Yield the places at which the board detects nothing in a whole turn, or that have no prediction.

    Places outside the room or in an object are left out: they have a finding, and in a closed box a search of paths can
    take minutes.
    """
    if len(room.walls) > _MOST_WALLS:
        return
    for place in room.places.values():
        if room.is_outside(place.position) or object_around(room, place) is not None:
            continue
        where = f"place {place.name!r}"
        headings = np.arange(0, math.tau, math.radians(_STEP_DEG)) if board.ring is None else board.ring.headings(place)
        try:
            ranges = predict_scan(room, place, board, headings).ranges
        except InputError as error:
            # the advice after the semicolon is about options that a check does not have
            found = f"its echoes cannot be predicted: {str(error).partition(';')[0]}"
            advice = "check whether surfaces enclose it, the reflectances, and the number of surfaces"
            yield Finding("no prediction", where, found, advice, (place.position,))
            continue
        if np.isnan(ranges).all():
            found = f"nothing is heard here: {reason_for_silence(room, place, board)}"
            advice = "move the place, or use another board"
            yield Finding("silence", where, found, advice, (place.position,))
