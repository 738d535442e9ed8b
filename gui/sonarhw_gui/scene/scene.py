"""The scene of a prediction: a room, a place in it and a board; or a board alone if the room is unknown."""

from dataclasses import dataclass, field, replace

from sonarhw_compare.imports.recorded_board import board_of_log
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.model import Place, Room, parse_room
from sonarhw_sim.room.room_writing import with_place

from sonarhw.errors import InputError
from sonarhw.log import LogMetadata

_NOWHERE = Place("", (0.0, 0.0))


@dataclass(frozen=True)
class Scene:
    """Room, place and board; room and place are both there or both missing. `options`: how sound is followed."""

    room: Room | None
    place: Place | None
    board: Board
    room_file: str = ""  # its name, for the log
    options: PredictionOptions = field(default_factory=PredictionOptions)

    @property
    def pose(self) -> Place:
        """The place, with the heading that the board's zero really has; without a room the origin, looking along +x."""
        place = self.place or _NOWHERE
        return replace(place, heading=self.board.heading_at(0.0, place.heading))

    @property
    def written_room(self) -> Room | None:
        """The room as it is saved: with the place where the sensor stands, though no file may have named it."""
        if self.room is None or self.place is None or self.room.places.get(self.place.name) == self.place:
            return self.room
        return with_place(self.room, self.place)

    @property
    def title(self) -> str:
        """What stands in the window's title."""
        return f"{self.room.name} · place {self.pose.name}" if self.room else "no room"


def scene_with(board: Board, room: Room | None = None, place: Place | None = None, room_file: str = "") -> Scene:
    """A scene to begin with: heard by the receiver that the board's profile names, as every command does."""
    return Scene(room, place, board, room_file, PredictionOptions(receiver=board.receiver))


def room_name(scene: Scene) -> str:
    """What its room is called, whatever was done to it; empty where there is none."""
    return scene.room.name if scene.room else ""


def first_place(room: Room) -> Place:
    """The place of that room to begin with: the first in its file. Raises InputError where it names none."""
    if not room.places:
        raise InputError(f"room {room.name!r}: it names no places; add [places.NAME] with a position to the file")
    return next(iter(room.places.values()))


def scene_of_log(metadata: LogMetadata) -> Scene:
    """The scene that a log carries inside. Raises InputError where its room or place cannot be understood."""
    board = board_of_log(metadata)
    if not metadata.room_text:
        return scene_with(board)
    room = parse_room(metadata.room_text, f"the room in the log ({metadata.room_file or 'no name'})")
    place = room.place(metadata.place) if metadata.place else first_place(room)
    return scene_with(board, room, place, metadata.room_file)
