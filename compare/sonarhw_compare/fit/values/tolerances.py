"""Values that a fit does not determine and does not take as exact: walls, reflectances, threshold, aperture, turntable.

Each is a parameter of the posterior, with a normal prior about its present value, and is marginalised.
"""

from collections.abc import Sequence
from dataclasses import replace

from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.model import Place, Room

from sonarhw_compare.fit.values.parameters import Parameter, free_parameters, present_value
from sonarhw_compare.fit.values.quantities import QUANTITIES, WALL

_REACH = 5.0  # standard deviations, half the width of the bounds


def tolerated_parameters(
    free: Sequence[Parameter], room: Room, board: Board, room_tolerance: float, walls: Sequence[str]
) -> tuple[Parameter, ...]:
    """Return the parameters that are neither free nor exact.

    `room_tolerance` (m) is the standard deviation of the position of a wall; only `walls` may be off.
    """
    taken = {parameter.name for parameter in free}
    names = [
        name
        for quantity in QUANTITIES
        if quantity.tolerance is not None
        for name in ([f"{WALL}:{wall}" for wall in walls] if quantity is WALL else [quantity.name])
        if quantity is WALL or hasattr(quantity, "key") or quantity.parts(room)  # type: ignore[attr-defined]
    ]
    several = free_parameters(names, [""], room, board)
    found = [_tolerated(one, room, board, room_tolerance) for one in several if one.name not in taken]
    return tuple(one for one in found if one.deviation)


def _tolerated(parameter: Parameter, room: Room, board: Board, room_tolerance: float) -> Parameter:
    quantity = parameter.quantity
    assert quantity.tolerance is not None
    deviation = room_tolerance if quantity is WALL else quantity.tolerance(board)
    present = present_value(parameter, Place("", (0.0, 0.0)), room, board)
    return replace(
        parameter,
        expected=present,
        deviation=deviation,
        lower=max(parameter.lower, present - _REACH * deviation),
        upper=min(parameter.upper, present + _REACH * deviation),
        is_tolerated=True,
    )
