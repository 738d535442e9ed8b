"""What a fit of given scans begins with: their room, board and places, and the parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.room import Place, Room

from sonarhw.errors import InputError, counted
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.fit.values.parameters import Parameter, free_parameters
from sonarhw_compare.fit.values.priors import check_words, with_priors
from sonarhw_compare.fit.values.quantities import X, Y
from sonarhw_compare.imports.given_scan import BoardInput, GivenScan, PlaceInput, RoomInput, common_board

NEAR = 0.25  # m; a free position is searched within this distance of a given place


@dataclass(frozen=True)
class FitSetting:
    """The arguments of `fit_scans`."""

    room: Room
    board: Board
    scans: tuple[PlacedScan, ...]
    parameters: tuple[Parameter, ...]


def fit_setting(
    scans: Sequence[GivenScan],
    room: RoomInput | None,
    places: Sequence[PlaceInput],
    board: BoardInput | None,
    words: Sequence[str],
    priors: Sequence[str],
) -> FitSetting:
    """Return the setting of a fit of the quantities in `words`, with their `priors`.

    Room, places (none, or one for each scan) and board that are not given are taken from the logs. Raises InputError if
    the logs do not contain them, or contain different ones.
    """
    check_count(places, len(scans))
    check_words(words, priors)
    room = _common_room(scans) if room is None else scans[0].room(room)
    board = common_board(scans, board)
    names = _names(scans)
    parameters = free_parameters(words, names, room, board)
    fixed = [name for name in ("x", "y") if all(parameter.quantity.name != name for parameter in parameters)]
    at = [room.place(place) for place in places] or [_recorded(scan, room, fixed) for scan in scans]
    placed = placed_scans(scans, at)
    if places:
        parameters = tuple(_near(parameter, placed) for parameter in parameters)
    return FitSetting(room, board, placed, with_priors(parameters, priors))


def placed_scans(scans: Sequence[GivenScan], places: Sequence[Place]) -> tuple[PlacedScan, ...]:
    """Return scans at these places, each with a name of its own: that of its log, numbered if several have it."""
    return tuple(
        PlacedScan(scan.readings, place, name, scan.where)
        for scan, place, name in zip(scans, places, _names(scans), strict=True)
    )


def check_count(places: Sequence[PlaceInput], scans: int) -> None:
    """Raise InputError unless there is no place, or one for each scan."""
    if places and len(places) != scans:
        raise InputError(f"places: expected one for each of {counted(scans, 'log')}, got {len(places)}")


def _common_room(scans: Sequence[GivenScan]) -> Room:
    """Return the room inside the logs. Raises InputError if there is none, or if they have different ones."""
    first = scans[0]
    room = first.room()
    for scan in scans:
        if scan.room_text not in ("", room.text):
            raise InputError(f"{first.where} and {scan.where} contain different rooms; give one room for both")
    return room


def _names(scans: Sequence[GivenScan]) -> list[str]:
    stems = [Path(scan.where).stem for scan in scans]
    return stems if len(set(stems)) == len(stems) else [f"{stem}{k + 1}" for k, stem in enumerate(stems)]


def _recorded(scan: GivenScan, room: Room, fixed: Sequence[str]) -> Place:
    """Return the place of a log. Raises InputError if it is unknown although a coordinate is fixed."""
    recorded = scan.recorded_place(room)
    if recorded is not None:
        return room.place(recorded)
    if not fixed:
        # the whole room is searched, so the place may be unknown
        return Place("", _middle(room))
    if len(room.places) == 1:
        return room.place(None)
    reason = f"{' and '.join(fixed)} {'is' if len(fixed) == 1 else 'are'} fixed"
    raise InputError(f"{scan.where}: its place is unknown, and {reason}; give a place, or free the position")


def _middle(room: Room) -> tuple[float, float]:
    ends = room.walls.reshape(-1, 2)
    x, y = ((ends.min(axis=0) + ends.max(axis=0)) / 2).tolist()
    return x, y


def _near(parameter: Parameter, scans: Sequence[PlacedScan]) -> Parameter:
    if parameter.quantity not in (X, Y):
        return parameter
    at = scans[parameter.scan or 0].place.position[0 if parameter.quantity is X else 1]
    return replace(parameter, lower=at - NEAR, upper=at + NEAR)
