"""The map from several scans: grid and features of all readings, and of those without several reflections."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count

import numpy as np
from sonarhw_sim.board.profile import Board
from sonarhw_sim.room.model import Room

from sonarhw.errors import InputError
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.fit.values.given_twice import check_given_once
from sonarhw_compare.map.arcs import arcs_of
from sonarhw_compare.map.certainty import BoolArray, CertaintyGrid, certainty_grid
from sonarhw_compare.map.features import Features, find_features
from sonarhw_compare.map.rejection import direct_readings, room_of


@dataclass(frozen=True)
class Layer:
    """Grid and features of some of the readings."""

    kept: tuple[BoolArray, ...]  # (n,) for each scan
    grid: CertaintyGrid
    features: Features


@dataclass(frozen=True)
class RoomMap:
    """A room as estimated from scans."""

    scans: tuple[PlacedScan, ...]
    plain: Layer  # of all readings
    followed_room: (
        Room | None
    )  # the room in which sound is followed: the given one, or else one made of the walls found
    direct: Layer  # without readings from several reflections

    @property
    def rejected(self) -> int:
        """The number of rejected readings with an echo."""
        return sum(
            reading.range is not None and not keep
            for scan, kept in zip(self.scans, self.direct.kept, strict=True)
            for reading, keep in zip(scan.readings, kept.tolist(), strict=True)
        )


def map_scans(
    scans: Sequence[PlacedScan],
    board: Board,
    room: Room | None = None,
    tick: Callable[[float], None] = lambda _share: None,
) -> RoomMap:
    """Return the map from scans at known places.

    Sound is followed in `room` if given, or else in a room of the walls that the scans agree on. `tick` receives the
    completed share, 0..1. Raises InputError if no reading has an echo, a scan is given twice or the board is a ring.
    """
    if board.ring is not None:
        raise InputError(f"board {board.name!r} is a ring of sensors; a map needs a turntable")
    if all(reading.range is None for scan in scans for reading in scan.readings):
        raise InputError("nothing to map: no reading has an echo")
    check_given_once(scans)
    parts = count()

    def begin_part() -> None:
        # a layer of all readings, one part for each scan, a layer of the kept readings
        tick(next(parts) / (len(scans) + 2))

    begin_part()
    plain = _layer(scans, board, tuple(np.ones(len(scan.readings), dtype=np.bool_) for scan in scans))
    followed_room = room_of(plain.features) if room is None else room
    if followed_room is None:
        direct = plain
    else:
        kept = direct_readings(scans, followed_room, board, begin_part)
        begin_part()
        direct = _layer(scans, board, kept)
    tick(1.0)
    return RoomMap(tuple(scans), plain, followed_room, direct)


def _layer(scans: Sequence[PlacedScan], board: Board, kept: tuple[BoolArray, ...]) -> Layer:
    return Layer(kept, certainty_grid(scans, board, kept), find_features(arcs_of(scans, board, kept)))
