"""The file that keeps one changed and unsaved room: its content, and how it is read and written."""

import os
from dataclasses import replace
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from sonarhw.errors import InputError
from sonarhw_gui.scene.scene import Scene, room_name
from sonarhw_gui.session.scene_memory import SceneMemory


class UnsavedRoom(BaseModel):
    """A scene as it was opened, and what became of it."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    room_name: str
    room_text: str  # as it would be saved
    opened: SceneMemory
    changed: SceneMemory
    when: float  # s since 1970

    def is_of(self, scene: Scene) -> bool:
        """Whether `scene` is in the same room: the same text, or another version of the same name."""
        named = (self.opened.room_file, self.room_name) == (scene.room_file, room_name(scene))
        return named or room_text(scene) in (self.room_text, self.opened.room_text)

    def is_shown_by(self, scene: Scene) -> bool:
        """Whether nothing of it is missing in `scene`."""
        board_as_it_was = self.changed.board_text in (self.opened.board_text, scene.board.text)
        return board_as_it_was and self.room_text == room_text(scene)

    def onto(self, here: Scene) -> Scene:
        """`here` with what was changed: the room, the sensor where it was moved, the board where it was fitted.

        Raises InputError where it cannot be understood.
        """
        then = self.changed.scene()
        if then.room is None or here.place is None:
            return then
        moved = then.written_room is not then.room
        place = then.place if moved else then.room.places.get(here.place.name, here.place)
        board = then.board if then.board.name == here.board.name else here.board
        return replace(here, room=then.room, place=place, board=board)


def is_changed(opened: Scene, now: Scene) -> bool:
    """Whether something would be missed: of the room, the sensor in it, or what a fit has found of the board.

    A board of another name was only chosen, and is found again by its name.
    """
    fitted = now.board.name == opened.board.name and now.board.text != opened.board.text
    return fitted or room_text(now) != room_text(opened)


def room_text(scene: Scene) -> str:
    """Return the text of the room as it would be saved; empty if there is none."""
    room = scene.written_room
    return room.text if room else ""


def read_unsaved(path: Path) -> UnsavedRoom:
    """Read such a file. Raises InputError."""
    try:
        return UnsavedRoom.model_validate_json(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, ValidationError) as error:
        raise InputError(
            f"{path}: a room that was not saved cannot be read ({type(error).__name__}); what it says stands there"
        ) from error


def write_unsaved(path: Path, text: str) -> None:
    """Write a file, all of it or nothing, in a folder that need not exist yet. Raises OSError."""
    fresh = path.with_suffix(".new")
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh.write_text(text, encoding="utf-8")
    os.replace(fresh, path)
