"""Study files and their cases: the room, place, board and options of each scan of a study, from its number alone."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal, Self
from zlib import crc32

import numpy as np
from pydantic import AfterValidator, Field, model_validator
from sonarhw_sim.air import Air, EdgeStrength, Model, Receiver, Unit
from sonarhw_sim.board.profile import Board, BoardFile, board_from, load_board
from sonarhw_sim.files import TomlModel, checked, is_file, parse_table, parse_toml, read_text
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Place, Room, load_room, parse_room, with_air, with_material
from sonarhw_sim.room.room_file import AirSection, Material, RoomFile

from sonarhw import arguments
from sonarhw.errors import InputError
from sonarhw.readings import FloatArray, headings_between, sector
from sonarhw.wire.limits import MOST_HEADINGS
from sonarhw_compare.free_space import FreeSpace, find_free_space

# Axes of a study: the values of a key of `[vary]`.
#
# A value or a list becomes a `Listed` grid axis. A distribution becomes a `Drawn` axis with one value for each draw.


Value = bool | int | float | str

FARTHEST = 3.0  # standard deviations; a normal draw farther from the mean is repeated
_EXPECTED = "expected a value, a list of values, { uniform = [low, high] } or { normal = [mean, deviation] }"


@dataclass(frozen=True)
class Listed:
    """A grid axis; a constant has one value."""

    values: tuple[Value, ...]

    @property
    def extremes(self) -> tuple[Value, ...]:
        """The values to validate."""
        return self.values


@dataclass(frozen=True)
class Drawn:
    """A random value for each draw."""

    kind: str  # uniform or normal
    first: float  # low, or mean
    second: float  # high, or standard deviation

    @property
    def extremes(self) -> tuple[Value, ...]:
        """The lowest and highest possible value."""
        if self.kind == "uniform":
            return self.first, self.second
        return self.first - FARTHEST * self.second, self.first + FARTHEST * self.second

    def value(self, random: np.random.Generator) -> float:
        """Draw one value."""
        if self.kind == "uniform":
            return float(random.uniform(self.first, self.second))
        drawn = float(random.normal())
        while abs(drawn) > FARTHEST:
            drawn = float(random.normal())
        return self.first + self.second * drawn


Axis = Listed | Drawn


def read_axis(written: object) -> Axis:
    """Return the axis of a key. Raises ValueError with the expected form."""
    if isinstance(written, Value):
        return Listed((written,))
    if isinstance(written, tuple) and written and all(isinstance(value, Value) for value in written):
        if len(set(written)) < len(written):
            raise ValueError(f"expected different values, got {list(written)}")
        return Listed(_of_one_kind(written))
    if isinstance(written, Mapping) and len(written) == 1:
        ((kind, numbers),) = written.items()
        if kind in ("uniform", "normal") and isinstance(numbers, tuple) and len(numbers) == 2:
            return _drawn(kind, *numbers)
    raise ValueError(f"{_EXPECTED}, got {_as_written(written)!r}")


def _of_one_kind(values: tuple[Value, ...]) -> tuple[Value, ...]:
    """Return the values with one type for a column; integers among floats become floats."""
    kinds = {type(value) for value in values}
    if kinds == {int, float}:
        return tuple(float(value) for value in values)
    if len(kinds) > 1:
        raise ValueError(f"expected values of one kind, got {list(values)}")
    return values


def _drawn(kind: str, first: object, second: object) -> Drawn:
    for number in (first, second):
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise ValueError(f"{_EXPECTED}, got {number!r} in {kind}")
    drawn = Drawn(kind, float(first), float(second))  # type: ignore[arg-type]
    if kind == "uniform" and drawn.first >= drawn.second:
        raise ValueError(f"expected uniform = [low, high] with low below high, got {[first, second]}")
    if kind == "normal" and drawn.second <= 0:
        raise ValueError(f"expected normal = [mean, deviation] with a deviation over 0, got {[first, second]}")
    return drawn


def _as_written(value: object) -> object:
    """Return a value with lists instead of tuples, as in the file."""
    if isinstance(value, tuple):
        return list(value)
    return {key: _as_written(part) for key, part in value.items()} if isinstance(value, Mapping) else value


WrittenAxis = Annotated[Any, AfterValidator(read_axis)]


def random_of(seed: int, draw: int, key: str) -> np.random.Generator:
    """Return the random numbers of `key` in a draw. They depend on these three values only."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(draw, crc32(key.encode()))))


# Study files: format and validation.
#
# A `Study` contains the text of all its rooms and boards, so that any process on any machine can work on it. Errors
# name the file and the key, and are raised before anything is predicted.


ANYWHERE = "anywhere"  # name of a place that is random in each draw
MOST_SCANS = 100_000_000

_BY_NAME = Field(strict=False)  # a file has the name of a choice, which a strict model would reject

Degrees = Annotated[float, Field(ge=-720, le=720)]


class HeadingsSection(TomlModel):
    """`[headings]` of every scan, in the room, degrees, as for `simulate`."""

    start: Annotated[Degrees, Field(alias="from")] = 0.0
    stop: Annotated[Degrees, Field(alias="to")] = 360.0
    step: Annotated[float, Field(gt=0, le=360)] = 5.0

    @model_validator(mode="after")
    def _not_empty(self) -> Self:
        count = headings_between(self.start, self.stop, self.step)
        if count > MOST_HEADINGS:
            raise ValueError(
                f"step: a scan has {count:.6g} headings, at most {MOST_HEADINGS} are possible; use a larger step"
            )
        return self


class RoomSection(TomlModel):
    """`[[rooms]]`."""

    file: str
    # names, X,Y or anywhere; default: all places of the room
    places: Annotated[tuple[str, ...], Field(min_length=1)] | None = None
    clearance: Annotated[float, Field(ge=0, le=1000)] = 0.1  # m, distance of a random place from walls and posts


class OptionValues(TomlModel):
    """One value for each key of `[vary.options]`."""

    model: Annotated[Model, _BY_NAME] = Model.RAY_FOLLOWING
    receiver: Annotated[Receiver | None, _BY_NAME] = None
    unit: Annotated[Unit, _BY_NAME] = Unit.PASS
    edge_strength: Annotated[EdgeStrength | None, _BY_NAME] = None
    diffraction: bool = True
    max_bounces: Annotated[int, Field(ge=0, le=1000)] = 64
    rays: Annotated[int, Field(ge=8, le=1_000_000)] = 5760
    sections: Annotated[int, Field(ge=1, le=99)] = 1
    noise: Annotated[float, Field(ge=0, le=1)] = 0.0  # rms of the receiver, 1 is full scale


class VarySection(TomlModel):
    """`[vary]`: each key has a value, a list (a grid) or a distribution."""

    board: dict[str, WrittenAxis] = Field(default_factory=dict)  # keys of a board profile
    mount: dict[str, WrittenAxis] = Field(default_factory=dict)  # keys of its [mount]
    air: dict[str, WrittenAxis] = Field(default_factory=dict)  # keys of a room's [air]
    materials: dict[str, dict[str, WrittenAxis]] = Field(default_factory=dict)  # keys of a room's materials
    options: dict[str, WrittenAxis] = Field(default_factory=dict)

    @property
    def axes(self) -> tuple[tuple[str, Axis], ...]:
        """Every axis with its key, such as `board.threshold_db`."""
        sections = ["board", "mount", "air", "options"]
        plain = [(f"{name}.{key}", axis) for name in sections for key, axis in getattr(self, name).items()]
        materials = [
            (f"materials.{name}.{key}", axis) for name, keys in self.materials.items() for key, axis in keys.items()
        ]
        return (*plain, *materials)


class StudyFile(TomlModel):
    """A whole study file."""

    name: str
    rooms: Annotated[tuple[RoomSection, ...], Field(min_length=1)]
    boards: Annotated[tuple[str, ...], Field(min_length=1)] = ("polaroid-6500",)
    seed: Annotated[int, Field(ge=0, lt=2**63)] = 0
    draws: Annotated[int, Field(ge=1, le=MOST_SCANS)] = 1  # of all random values; each passes through the whole grid
    rows: Literal["headings", "scans"] = "headings"  # what is kept: every heading, or only the figures of each scan
    headings: HeadingsSection = HeadingsSection()
    vary: VarySection = VarySection()


@dataclass(frozen=True)
class StudyRoom:
    """A room of a study."""

    name: str  # as in the room file, so that results do not depend on its path
    text: str
    places: tuple[str, ...]
    clearance: float  # m


@dataclass(frozen=True)
class Study:
    """Everything that determines the results of a study."""

    name: str
    text: str  # the study file
    rooms: tuple[StudyRoom, ...]
    boards: tuple[tuple[str, str], ...]  # name and profile
    seed: int
    draws: int
    rows: str
    headings: tuple[float, float, float]  # degrees: from, to, step
    axes: tuple[tuple[str, Axis], ...]  # keys such as `board.threshold_db`, in the order of the file

    @property
    def points(self) -> int:
        """The number of points of the grid."""
        count = sum(len(room.places) for room in self.rooms) * len(self.boards)
        for _, axis in self.axes:
            count *= len(axis.values) if isinstance(axis, Listed) else 1
        return count

    @property
    def headings_of_scan(self) -> int:
        """The number of headings of a scan."""
        return headings_between(*self.headings)

    @property
    def scans(self) -> int:
        """The number of scans."""
        return self.draws * self.points


@arguments.checked(path=arguments.file_name)
def load_study(path: Path | str) -> Study:
    """Return the study in a file; rooms and boards are files relative to it, or included ones. Raises InputError."""
    path = Path(path)
    text = read_text(path, "study file")
    file = parse_toml(text, str(path), StudyFile)
    rooms = tuple(_read_room(section, path, number) for number, section in enumerate(file.rooms))
    _check_names([room for room, _ in rooms], path)
    boards = tuple(_read_board(name, path, number) for number, name in enumerate(file.boards))
    _check_axes(file.vary, str(path), [room for _, room in rooms], boards)
    study = Study(
        file.name,
        text,
        tuple(room for room, _ in rooms),
        tuple((name, board.text) for name, board in zip(file.boards, boards, strict=True)),
        file.seed,
        file.draws,
        file.rows,
        (file.headings.start, file.headings.stop, file.headings.step),
        file.vary.axes,
    )
    _check_count(study, str(path))
    return study


def _check_count(study: Study, where: str) -> None:
    if study.scans > MOST_SCANS:
        raise InputError(
            f"{where}: {study.scans} scans, expected at most {MOST_SCANS}; use fewer values or fewer draws"
        )
    drawn = any(isinstance(axis, Drawn) or key == "options.noise" for key, axis in study.axes)
    if study.draws > 1 and not drawn and not any(ANYWHERE in room.places for room in study.rooms):
        raise InputError(f"{where}: draws: nothing is random, so {study.draws} draws would all be equal; use draws = 1")


def _read_room(section: RoomSection, spec: Path, number: int) -> tuple[StudyRoom, Room]:
    try:
        room = load_room(_from_spec(section.file, spec))
    except InputError as error:
        raise InputError(f"{spec}: rooms[{number}].file: {error}") from error
    places = tuple(room.places) if section.places is None else section.places
    where = f"{spec}: rooms[{number}].places"
    if not places:
        raise InputError(f"{where}: {section.file} has no places; give X,Y or {ANYWHERE!r}")
    if len(set(places)) < len(places):
        raise InputError(f"{where}: expected different places, got {list(places)}")
    for name in places:
        if name != ANYWHERE:
            try:
                room.place(name)
            except InputError as error:
                raise InputError(f"{where}: {error}") from error
    if ANYWHERE in places:
        _check_clearance(room, section.clearance, f"{spec}: rooms[{number}].clearance")
    return StudyRoom(room.name, room.text, places, section.clearance), room


def _from_spec(name: str, spec: Path) -> Path | str:
    """Return the name of something shipped, or the file that the study names, relative to the study."""
    return spec.parent / name if is_file(name) else name


def _check_names(rooms: list[StudyRoom], spec: Path) -> None:
    """Raise InputError if two rooms have the same name, which identifies them in results."""
    texts: dict[str, str] = {}
    for number, room in enumerate(rooms):
        if texts.setdefault(room.name, room.text) != room.text:
            raise InputError(
                f"{spec}: rooms[{number}].file: another room of the study has the same name {room.name!r}, so results "
                "would be ambiguous; change the name in the room file"
            )


def _check_clearance(room: Room, clearance: float, where: str) -> None:
    """Raise InputError if no random place can have this clearance."""
    try:
        find_free_space(room).draw(np.random.default_rng(0), clearance)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def _read_board(name: str, spec: Path, number: int) -> Board:
    try:
        return load_board(_from_spec(name, spec))
    except InputError as error:
        raise InputError(f"{spec}: boards[{number}]: {error}") from error


def _check_axes(vary: VarySection, where: str, rooms: list[Room], boards: tuple[Board, ...]) -> None:
    """Raise InputError if a key is unknown, or a value is not allowed in its file."""
    for section, keys in (("board", vary.board), ("mount", vary.mount)):
        for key, axis in keys.items():
            for board, value in product(boards, axis.extremes):
                board_with(board.text, {f"{section}.{key}": value}, f"{where}: vary.{section}")
    for key, axis in vary.air.items():
        for value in axis.extremes:
            checked({key: value}, f"{where}: vary.air", AirSection)
    for material, keys in vary.materials.items():
        if not any(material in room.materials for room in rooms):
            raise InputError(f"{where}: vary.materials.{material}: no wall or post of any room has this material")
        for key, axis in keys.items():
            for value in axis.extremes:
                checked({"reflectance": 1.0, key: value}, f"{where}: vary.materials.{material}", Material)
    for key, axis in vary.options.items():
        for value in axis.extremes:
            checked({key: value}, f"{where}: vary.options", OptionValues)
    _check_noise(vary.options, where, boards)


def _check_noise(options: dict[str, Axis], where: str, boards: tuple[Board, ...]) -> None:
    """Raise InputError if there is noise, but no scan has a receiver that uses it."""
    noisy = "noise" in options and any(options["noise"].extremes)
    named = options["receiver"].extremes if "receiver" in options else [board.receiver.value for board in boards]
    if noisy and "board" not in named:
        raise InputError(f'{where}: vary.options: noise: has no effect with this receiver; add receiver = "board"')


def board_with(profile: str, values: dict[str, Value], where: str) -> Board:
    """Return the board of a profile with the values of `board.…` and `mount.…` keys replaced. Raises InputError."""
    table = parse_table(profile, where)
    for name, value in values.items():
        section, _, key = name.partition(".")
        if section == "board":
            table[key] = value
        elif section == "mount":
            table["mount"] = table.get("mount", {}) | {key: value}
    return board_from(checked(table, where, BoardFile))


# Cases: the room, place, board and options of each scan of a study, from its number alone.
#
# Scan numbers pass through the whole grid once for each draw. Drawn values, such as a place, are therefore the same
# at every point of the grid. Points can be compared in pairs, and neighbouring scans share the paths of a place.


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
        self._changed_room = lru_cache(maxsize=64)(self._change)
        self._free_space = lru_cache(maxsize=None)(lambda room: find_free_space(self._rooms[room]))
        self._place = lru_cache(maxsize=64)(self._find_place)

    def case(self, number: int) -> Case:
        """Return scan `number` of the study. Raises InputError if its drawn values do not fit together."""
        study = self._study
        draw, point = divmod(number, study.points)
        spot, board_at, *listed = np.unravel_index(point, self._shape)
        position, place_name = self._spots[spot]
        values = {
            key: axis.value(random_of(study.seed, draw, key)) if isinstance(axis, Drawn) else axis.values[at_value]
            for (key, axis), at_value in zip(study.axes, listed, strict=True)
        }
        place = self._place(position, place_name, draw if place_name == ANYWHERE else 0)
        board = self._board(
            int(board_at), tuple(item for item in values.items() if _section(item[0]) in ("board", "mount"))
        )
        model, options = _options(values, study.seed, number)
        return Case(
            number,
            draw,
            study.rooms[position].name,
            self._changed_room(
                position, tuple(item for item in values.items() if _section(item[0]) in ("air", "materials"))
            ),
            place,
            study.boards[board_at][0],
            board,
            replace(board, threshold_db=min([board.threshold_db, *self._thresholds])),
            model,
            options,
            self._headings if board.ring is None else board.ring.headings(place),
            values,
            (position, place, *(item for item in values.items() if _section(item[0]) == "materials")),
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

    def _change(self, number: int, items: tuple[tuple[str, Value], ...]) -> Room:
        """Return the room with the air and the materials of a case."""
        room, values = self._rooms[number], dict(items)
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
