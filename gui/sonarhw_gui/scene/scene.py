"""The scene of a prediction: a room, a place in it and a board; or a board alone if the room is unknown."""

from dataclasses import dataclass, field, replace
from functools import cached_property

from sonarhw_compare.scans import board_of_log
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Place, Room, parse_room
from sonarhw_sim.room.room_writing import with_place

from sonarhw.errors import InputError
from sonarhw.log import LogMetadata

NOWHERE = Place("", (0.0, 0.0))


@dataclass(frozen=True)
class Scene:
    """Room, place and board; room and place are both given or both missing. `options`: how sound is followed."""

    room: Room | None
    place: Place | None
    board: Board
    room_file: str = ""  # file name, for the log
    options: PredictionOptions = field(default_factory=PredictionOptions)

    @property
    def pose(self) -> Place:
        """The place, with the actual heading of the turntable's zero; without a room the origin, facing +x."""
        place = self.place or NOWHERE
        return replace(place, heading=self.board.heading_at(0.0, place.heading))

    @cached_property
    def written_room(self) -> Room | None:
        """The room as it is saved: with the place of the sensor, and without places that it was dragged to before."""
        if self.room is None or self.place is None or self.room.places.get(self.place.name) == self.place:
            return self.room
        return with_place(self.room, self.place, dragged_places(self.room))

    @property
    def title(self) -> str:
        """The text of the window's title."""
        return f"{self.room.name} · place {self.pose.name}" if self.room else "no room"


def scene_with(board: Board, room: Room | None = None, place: Place | None = None, room_file: str = "") -> Scene:
    """Return a scene with default options."""
    return Scene(room, place, board, room_file)


def position_name(position: tuple[float, float]) -> str:
    """Return the name of a place that has none, as in `--place X,Y`; position in m."""
    return f"{position[0]:g},{position[1]:g}"


def dragged_places(room: Room) -> list[str]:
    """Return the places named only by their position: the sensor was dragged there before the room was saved."""
    return [name for name, place in room.places.items() if name == position_name(place.position)]


def room_name(scene: Scene) -> str:
    """Return the name of the scene's room; empty without a room."""
    return scene.room.name if scene.room else ""


def first_place(room: Room) -> Place:
    """Return the first place of the room file. Raises InputError if the room has no places."""
    if not room.places:
        raise InputError(f"room {room.name!r}: it has no places; add [places.NAME] with a position to the file")
    return next(iter(room.places.values()))


def place_warning(metadata: LogMetadata, scene: Scene) -> str:
    """Return a warning if a log without a place is shown at the first of several places of the room; else empty."""
    room = scene.room
    if metadata.place or room is None or len(room.places) < 2 or scene.place != first_place(room):
        return ""
    return (
        f"the log contains no place; its readings are shown at {first_place(room).name}, the first place of the room: "
        "choose another place, or find the pose (F9)"
    )


def scene_of_log(metadata: LogMetadata) -> Scene:
    """Return the scene stored in a log. Raises InputError if its room or place is invalid."""
    board = board_of_log(metadata)
    if not metadata.room_text:
        return scene_with(board)
    room = parse_room(metadata.room_text, f"the room in the log ({metadata.room_file or 'no name'})")
    place = room.place(metadata.place) if metadata.place else first_place(room)
    return scene_with(board, room, place, metadata.room_file)
