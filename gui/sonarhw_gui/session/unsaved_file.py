"""The file of one room with unsaved changes: its content, reading and writing."""

import os
from dataclasses import replace
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from sonarhw.errors import InputError
from sonarhw.files import unfinished_file
from sonarhw_gui.scene.scene import Scene, room_name
from sonarhw_gui.scene.scene_memory import SceneMemory


class UnsavedRoom(BaseModel):
    """A scene as it was opened and as it was changed."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    room_name: str
    room_text: str  # as saving would write it
    opened: SceneMemory
    changed: SceneMemory
    when: float  # s since 1970

    def is_of(self, scene: Scene) -> bool:
        """Return whether `scene` has the same room: the same text, or another version with the same name."""
        named = (self.opened.room_file, self.room_name) == (scene.room_file, room_name(scene))
        return named or room_text(scene) in (self.room_text, self.opened.room_text)

    def is_shown_by(self, scene: Scene) -> bool:
        """Return whether `scene` contains all these changes."""
        board_as_it_was = self.changed.board_text in (self.opened.board_text, scene.board.text)
        return board_as_it_was and self.room_text == room_text(scene)

    def applied_to(self, here: Scene) -> Scene:
        """Return the scene `here` with the changes: the room, a moved sensor, a fitted board.

        Raises InputError if the stored scene is invalid.
        """
        restored = self.changed.scene()
        if restored.room is None or here.place is None:
            return restored
        moved = restored.written_room is not restored.room
        place = restored.place if moved else restored.room.places.get(here.place.name, here.place)
        board = restored.board if restored.board.name == here.board.name else here.board
        return replace(here, room=restored.room, place=place, board=board)


def is_changed(opened: Scene, now: Scene) -> bool:
    """Return whether there are unsaved changes of the room, the sensor's place or the fitted board.

    A board with another name is another choice and no change.
    """
    fitted = now.board.name == opened.board.name and now.board.text != opened.board.text
    return fitted or _is_moved(opened, now) or room_text(now) != room_text(opened)


def _is_moved(opened: Scene, now: Scene) -> bool:
    """Return whether the sensor was moved, so that the text differs: during a drag, none needs to be written."""
    if opened.room is None or opened.place is None or now.place is None:
        return False
    name = now.place.name
    before = opened.place if opened.place.name == name else opened.room.places.get(name)
    return before is None or before.position != now.place.position


def room_text(scene: Scene) -> str:
    """Return the text of the room as saving would write it; empty without a room."""
    room = scene.written_room
    return room.text if room else ""


def read_unsaved(path: Path) -> UnsavedRoom:
    """Read the file of an unsaved room. Raises InputError."""
    try:
        return UnsavedRoom.model_validate_json(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, ValidationError) as error:
        raise InputError(
            f"{path}: unsaved room cannot be read ({type(error).__name__}); the file is left unchanged"
        ) from error


def write_unsaved(path: Path, text: str) -> None:
    """Write a file completely or not at all, and create its folder if needed. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with unfinished_file(path) as fresh:
        with fresh.open("x", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        fresh.replace(path)
