"""Values that a fit does not determine and does not take as exact: walls, reflectances, threshold, aperture, turntable.

Each is a parameter of the posterior, with a normal prior about its present value, and is marginalised.
"""

from collections.abc import Sequence
from dataclasses import replace

from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.room import Place, Room

from sonarhw_compare.fit.values.parameters import Parameter, free_parameters, present_value
from sonarhw_compare.fit.values.quantities import QUANTITIES, WALL, PartQuantity, Quantity

_REACH = 5.0  # standard deviations, half the width of the bounds


def tolerated_parameters(
    free: Sequence[Parameter], room: Room, board: Board, room_tolerance: float, walls: Sequence[str]
) -> tuple[Parameter, ...]:
    """Return the parameters that are neither free nor exact.

    `room_tolerance` (m) is the standard deviation of the position of a wall; only `walls` may be off.
    """
    taken = {parameter.name for parameter in free}
    words = [word for quantity in QUANTITIES for word in _words(quantity, room, walls)]
    found = [_tolerated(one, room, board, room_tolerance) for one in free_parameters(words, [""], room, board)]
    return tuple(one for one in found if one.deviation and one.name not in taken)


def _words(quantity: Quantity, room: Room, walls: Sequence[str]) -> list[str]:
    if quantity.tolerance is None or (isinstance(quantity, PartQuantity) and not quantity.parts(room)):
        return []
    return [f"{WALL}:{wall}" for wall in walls] if quantity is WALL else [quantity.name]


def _tolerated(parameter: Parameter, room: Room, board: Board, room_tolerance: float) -> Parameter:
    quantity = parameter.quantity
    stated = quantity.tolerance(board) if quantity.tolerance else 0.0
    deviation = room_tolerance if quantity is WALL else stated
    present = present_value(parameter, Place("", (0.0, 0.0)), room, board)
    return replace(
        parameter,
        expected=present,
        deviation=deviation,
        lower=max(parameter.lower, present - _REACH * deviation),
        upper=min(parameter.upper, present + _REACH * deviation),
        is_tolerated=True,
    )
