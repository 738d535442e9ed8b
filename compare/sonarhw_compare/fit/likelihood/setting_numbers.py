"""Board, turning axis and air of a vector as plain numbers. Copies of room and board for each vector would be slow."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board, axis_beside
from sonarhw_sim.room.room import Place

from sonarhw.readings import FloatArray
from sonarhw_compare.fit.likelihood.echo_likelihood import BoardValues
from sonarhw_compare.fit.values.parameters import Parameter
from sonarhw_compare.fit.values.quantities import (
    AHEAD,
    APERTURE,
    ASIDE,
    AXIS_X,
    AXIS_Y,
    HEADING,
    OFFSET,
    SCALE,
    SLOPE,
    THRESHOLD,
    AirQuantity,
    BoardQuantity,
    X,
    Y,
)

# all quantities of the board that the likelihood depends on
_OF_BOARD = (OFFSET, SLOPE, AHEAD, ASIDE, SCALE, AXIS_X, AXIS_Y, THRESHOLD, APERTURE)


@dataclass(frozen=True)
class SettingNumbers:
    """The numbers of `Problem.setting` that the likelihood depends on, for vectors of the `parameters`, (size,)."""

    board: Board
    air: Air
    places: tuple[Place, ...]  # of the scans
    parameters: tuple[Parameter, ...]
    pose_rows: tuple[list[int], ...]  # by scan: the rows of the parameters of its place
    reported_speed: float | None  # m/s, for ranges from echo times; None if the air is not free

    def of_board(self, values: FloatArray) -> dict[str, float]:
        """Return the numbers of the board profile by key."""
        present = self._present
        changed = {one.key: one.number(present[one.key], float(values[row])) for row, one in self.board_rows}
        return present | changed

    def axis_pose(self, values: FloatArray, scan: int, numbers: Mapping[str, float]) -> tuple[float, float, float]:
        """Return the position of the turning axis, m, and the actual heading of step 0, rad.

        `numbers` are those of the board for the same `values`.
        """
        present, rows = self._poses[scan]
        pose = present | {name: float(values[row]) for row, name in rows}
        heading = pose[HEADING.name] + math.radians(self.board.home_angle_deg)
        x, y = axis_beside((pose[X.name], pose[Y.name]), heading, numbers[AXIS_X.key], numbers[AXIS_Y.key])
        return x, y, heading

    def air_of(self, values: FloatArray) -> Air:
        """Return the air."""
        air = self.air
        for row, parameter in enumerate(self.parameters):
            if isinstance(parameter.quantity, AirQuantity):
                air = parameter.quantity.put(air, float(values[row]))
        return air

    def for_kernel(
        self, values: FloatArray, numbers: Mapping[str, float], heading: float, stretch: float
    ) -> BoardValues:
        """Return the board as the kernel of the likelihood needs it, for step 0 at `heading` (rad).

        `stretch` is the ratio of measured to true ranges; a free speed of sound replaces it.
        """
        board, speed = self.board, self.air.speed_of_sound
        if self.reported_speed is not None:
            speed = self.air_of(values).speed_of_sound
            stretch = self.reported_speed / speed
        stretch *= 1 + numbers[SLOPE.key]
        ahead, aside, half = numbers[AHEAD.key], numbers[ASIDE.key], board.mount.separation / 2
        offset = numbers[OFFSET.key]
        return BoardValues(
            heading=heading,
            scale=numbers[SCALE.key],
            ka=math.tau * board.frequency / speed * numbers[APERTURE.key],
            threshold_db=numbers[THRESHOLD.key],
            opens=board.blanking_end * speed / 2 * stretch + offset,
            closes=board.max_range * stretch + offset,
            dead=board.rearm * speed / 2 * stretch,
            stretch=stretch,
            offset=offset,
            sender=(ahead, aside + half),
            listener=(ahead, aside - half),
        )

    @cached_property
    def board_rows(self) -> list[tuple[int, BoardQuantity]]:
        """The rows of the parameters of the board, with their quantities."""
        quantities = ((row, one.quantity) for row, one in enumerate(self.parameters))
        return [(row, quantity) for row, quantity in quantities if isinstance(quantity, BoardQuantity)]

    @cached_property
    def _present(self) -> dict[str, float]:
        return {one.key: one.read(self.board) for one in _OF_BOARD}

    @cached_property
    def _poses(self) -> list[tuple[dict[str, float], list[tuple[int, str]]]]:
        """For each scan, the present pose by name of its quantities, and the rows that change it."""
        return [
            (
                {one.name: one.value(place) for one in (X, Y, HEADING)},
                [(row, self.parameters[row].quantity.name) for row in rows],
            )
            for place, rows in zip(self.places, self.pose_rows, strict=True)
        ]
