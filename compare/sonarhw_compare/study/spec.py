"""Study files: format and validation.

A `Study` contains the text of all its rooms and boards, so that any process on any machine can work on it. Errors name
the file and the key, and are raised before anything is predicted.
"""

from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator
from sonarhw_sim.air import EdgeStrength, Model, Receiver, Unit
from sonarhw_sim.board.profile import Board, BoardFile, board_from, load_board
from sonarhw_sim.files import TomlModel, checked, is_file, parse_table, parse_toml, read_text
from sonarhw_sim.room.room import Room, load_room
from sonarhw_sim.room.room_file import AirSection, Material

from sonarhw.errors import InputError
from sonarhw.readings import headings_between
from sonarhw_compare.free_space import find_free_space
from sonarhw_compare.study.axes import Axis, Drawn, Listed, Value, WrittenAxis

ANYWHERE = "anywhere"  # name of a place that is random in each draw
MOST_SCANS = 100_000_000
MOST_HEADINGS = 65_535  # as of a scan command

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


def load_study(path: Path) -> Study:
    """Return the study in a file; rooms and boards are files relative to it, or included ones. Raises InputError."""
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
