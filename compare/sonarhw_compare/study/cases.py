"""Cases: the room, place, board and options of each scan of a study, from its number alone.

Scan numbers pass through the whole grid once for each draw. Drawn values, such as a place, are therefore the same at
every point of the grid. Points can be compared in pairs, and neighbouring scans share the paths of a place.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from sonarhw_sim.air import Air, Model
from sonarhw_sim.board.profile import Board
from sonarhw_sim.files import parse_toml
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Place, Room, parse_room, with_air, with_material
from sonarhw_sim.room.room_file import Material, RoomFile

from sonarhw.readings import FloatArray, sector
from sonarhw_compare.free_space import FreeSpace, find_free_space
from sonarhw_compare.study.axes import Drawn, Listed, Value, random_of
from sonarhw_compare.study.spec import ANYWHERE, OptionValues, Study, board_with

_KNOWN_OF_WALLS = (
    "surfaces",
    "enclosures",
    "edges_on_walls",
)  # computed once for each room, because they do not depend on air and materials


@dataclass(frozen=True)
class Case:
    """The input of one predicted scan."""

    number: int
    draw: int
    room_name: str
    room: Room
    place: Place
    board_name: str
    board: Board
    most_sensitive: Board  # the board with the lowest threshold of the grid, for paths that serve all points
    model: Model
    options: PredictionOptions
    headings: FloatArray  # (n,), rad in the room
    values: dict[str, Value]  # of every key of [vary]
    where: tuple[object, ...]  # equal for scans at the same position in the same room with the same materials


class Cases:
    """The scans of a study by number."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._rooms = [parse_room(room.text, room.name) for room in study.rooms]
        self._materials = [parse_toml(room.text, room.name, RoomFile).materials for room in study.rooms]
        for room in self._rooms:
            for known in _KNOWN_OF_WALLS:
                getattr(room, known)
        self._spots = [(number, place) for number, room in enumerate(study.rooms) for place in room.places]
        self._thresholds = [
            float(value) for key, axis in study.axes if key == "board.threshold_db" for value in axis.extremes
        ]
        lengths = [len(axis.values) if isinstance(axis, Listed) else 1 for _, axis in study.axes]
        self._shape = (len(self._spots), len(study.boards), *lengths)
        self._headings = sector(*study.headings).angles()
        self._board = lru_cache(maxsize=64)(self._make_board)
        self._free_space = lru_cache(maxsize=None)(lambda room: find_free_space(self._rooms[room]))
        self._place = lru_cache(maxsize=64)(self._find_place)

    def case(self, number: int) -> Case:
        """Return scan `number` of the study. Raises InputError if its drawn values do not fit together."""
        study = self._study
        draw, point = divmod(number, study.points)
        spot, board_at, *listed = np.unravel_index(point, self._shape)
        at, place_name = self._spots[spot]
        values = {
            key: axis.value(random_of(study.seed, draw, key)) if isinstance(axis, Drawn) else axis.values[at_value]
            for (key, axis), at_value in zip(study.axes, listed, strict=True)
        }
        place = self._place(at, place_name, draw if place_name == ANYWHERE else 0)
        board = self._board(
            int(board_at), tuple(item for item in values.items() if _section(item[0]) in ("board", "mount"))
        )
        model, options = _options(values, study.seed, number)
        return Case(
            number,
            draw,
            study.rooms[at].name,
            self._changed(at, values),
            place,
            study.boards[board_at][0],
            board,
            replace(board, threshold_db=min([board.threshold_db, *self._thresholds])),
            model,
            options,
            self._headings if board.ring is None else board.ring.headings(place),
            values,
            (at, place, *(item for item in values.items() if _section(item[0]) == "materials")),
        )

    def _find_place(self, room: int, name: str, draw: int) -> Place:
        if name != ANYWHERE:
            return self._rooms[room].place(name)
        space: FreeSpace = self._free_space(room)
        random = random_of(self._study.seed, draw, f"place in {self._study.rooms[room].name}")
        return Place(name, space.draw(random, self._study.rooms[room].clearance))

    def _make_board(self, number: int, values: tuple[tuple[str, Value], ...]) -> Board:
        name, profile = self._study.boards[number]
        return board_with(profile, dict(values), f"study {self._study.name!r}, board {name}")

    def _changed(self, number: int, values: dict[str, Value]) -> Room:
        """Return the room with the air and the materials of a case."""
        room = self._rooms[number]
        air = {key.partition(".")[2]: value for key, value in values.items() if _section(key) == "air"}
        if air:
            room = with_air(room, Air(**(vars(room.air) | air)))
        for name, material in self._materials[number].items():
            new = {key: values.get(f"materials.{name}.{key}") for key in ("reflectance", "scatter")}
            if any(value is not None for value in new.values()):
                # a new reflectance replaces a table
                old = {"scatter": material.scatter} if new["reflectance"] is not None else vars(material)
                given = {key: value for key, value in new.items() if value is not None}
                changed = Material.model_validate(old | given)
                room = with_material(room, name, changed.reflectance, changed.scatter)
        return room


def _section(key: str) -> str:
    return key.partition(".")[0]


def _options(values: dict[str, Value], seed: int, number: int) -> tuple[Model, PredictionOptions]:
    """Return the model and the options of a case; its seed follows from its number."""
    given = {key.partition(".")[2]: value for key, value in values.items() if _section(key) == "options"}
    chosen = OptionValues.model_validate(given)
    return chosen.model, PredictionOptions(
        unit=chosen.unit,
        max_bounces=chosen.max_bounces,
        diffraction=chosen.diffraction,
        rays=chosen.rays,
        edge_strength=chosen.edge_strength,
        receiver=chosen.receiver,
        noise=chosen.noise,
        # without noise nothing is random
        seed=int(random_of(seed, number, "noise").integers(2**32)) if chosen.noise else None,
        sections=chosen.sections,
    )
