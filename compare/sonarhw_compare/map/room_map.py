"""The map from several scans: grid and features of all readings, and of those without several reflections."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np
from sonarhw_sim.board.profile import Board, without_own_body
from sonarhw_sim.room.room import Room

from sonarhw.errors import InputError
from sonarhw.readings import BoolArray
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.fit.values.given_twice import check_given_once
from sonarhw_compare.map.arcs import arcs_of
from sonarhw_compare.map.certainty import CertaintyGrid, certainty_grid
from sonarhw_compare.map.contradiction import with_possible_walls
from sonarhw_compare.map.features import Features, count_places, find_features
from sonarhw_compare.map.rejection import judged_readings, room_of


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
    # the room in which sound is followed: the given one, else one of the confirmed walls. None: not followed
    followed_room: Room | None
    direct: Layer  # without readings from several reflections
    explained: tuple[BoolArray, ...]  # readings with a path in that room, (n,) for each scan

    @property
    def places(self) -> int:
        """The number of different positions of the scans."""
        return count_places(scan.place.position for scan in self.scans)

    @property
    def echoes(self) -> int:
        """The number of readings with an echo."""
        return self._echoes_not(tuple(np.zeros_like(kept) for kept in self.direct.kept))

    @property
    def rejected(self) -> int:
        """The number of rejected readings with an echo."""
        return self._echoes_not(self.direct.kept)

    @property
    def undetermined(self) -> int:
        """The number of echoes without a path: whether they came by several reflections is not determined."""
        return self._echoes_not(self.explained)

    def _echoes_not(self, among: tuple[BoolArray, ...]) -> int:
        return sum(
            reading.range is not None and not inside
            for scan, rows in zip(self.scans, among, strict=True)
            for reading, inside in zip(scan.readings, rows.tolist(), strict=True)
        )


def map_scans(
    scans: Sequence[PlacedScan],
    board: Board,
    room: Room | None = None,
    tick: Callable[[float], None] = lambda _share: None,
) -> RoomMap:
    """Return the map from scans at known places. Readings of the carrier's own body are left out.

    Sound is followed in `room` if given, or else in a room of the walls that three places agree on. `tick` receives the
    completed share, 0..1. Raises InputError if no reading has an echo, a scan is given twice or the board is a ring.
    """
    if board.ring is not None:
        raise InputError(f"board {board.name!r} is a ring of sensors; a map needs a turntable")
    scans = [replace(scan, readings=without_own_body(board.own_body, scan.readings)) for scan in scans]
    if all(reading.range is None for scan in scans for reading in scan.readings):
        raise InputError("nothing to map: no reading has an echo")
    check_given_once(scans)
    parts = count()

    def begin_part() -> None:
        # a layer of all readings, one part for each scan, a layer of the kept readings
        tick(next(parts) / (len(scans) + 2))

    begin_part()
    plain = _layer(scans, board, tuple(np.ones(len(scan.readings), dtype=np.bool_) for scan in scans))
    found = room_of(plain.features) if plain.features.confirmed else None
    followed_room = found if room is None else room
    direct, explained = plain, tuple(np.zeros_like(kept) for kept in plain.kept)
    if followed_room is not None:
        judged = judged_readings(scans, followed_room, board, begin_part)
        begin_part()
        direct, explained = _layer(scans, board, judged.direct), judged.explained
    tick(1.0)
    return RoomMap(tuple(scans), plain, followed_room, direct, explained)


def _layer(scans: Sequence[PlacedScan], board: Board, kept: tuple[BoolArray, ...]) -> Layer:
    features = find_features(arcs_of(scans, board, kept))
    return Layer(kept, certainty_grid(scans, board, kept), with_possible_walls(features, scans, board, kept))
