"""Rooms that were changed and not saved: each is kept in a file of its own until it is saved or thrown away."""

import time
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from sonarhw.errors import InputError, OutputError
from sonarhw_gui.scene.scene import Scene, room_name
from sonarhw_gui.session.scene_memory import SceneMemory
from sonarhw_gui.session.unsaved_file import UnsavedRoom, is_changed, read_unsaved, room_text, write_unsaved
from sonarhw_gui.shown.notices import Notice

_SOON = 1.0  # s from a change to the file: what a crash may cost


@dataclass(frozen=True)
class RestoreRoom:
    """Somebody wants to go on with a room that was not saved."""

    path: Path


@dataclass(frozen=True)
class DiscardRoom:
    """Nobody wants it any more."""

    path: Path


class UnsavedRooms:
    """Follows the scene that is shown, and keeps what is changed in it."""

    def __init__(self, folder: Path | None) -> None:
        """`folder`: where they lie; None: nowhere."""
        self.notices: list[Notice] = []  # rooms that are asked about
        self.messages: list[str] = []
        self._folder = folder
        self._opened: Scene | None = None
        self._now: Scene | None = None
        self._file: Path | None = None  # holds what was changed in this scene
        self._text = ""  # what stands in it
        self._kept: SceneMemory | None = None  # the scene in it
        self._due: float | None = None

    def open(self, scene: Scene, left_in: Path | None = None) -> None:
        """Follow this scene from now on. Others of its room that were not saved are asked about.

        `left_in`: the file that it was brought back from; that of the same scene is gone on with in any case.
        """
        self.write()
        self._opened = self._now = scene
        self._forget_file()
        self.notices.clear()
        if scene.room is None:
            return
        for path, unsaved in self._left():
            if path == left_in or unsaved.is_shown_by(scene):
                self._go_on_with(path, unsaved)
            elif unsaved.is_of(scene):
                self.notices.append(_question(path, unsaved, scene))

    def change(self, scene: Scene, now: float) -> None:
        """The scene has been changed; `now` and the times of `tick` are of one clock, s."""
        self._now = scene
        if self._due is None:
            self._due = now + _SOON

    def tick(self, now: float) -> None:
        """Keep what has been changed a moment ago."""
        if self._due is not None and now >= self._due:
            self.write()

    def write(self) -> None:
        """Keep what has been changed; where all of it was taken back there is nothing to keep."""
        self._due = None
        if self._folder is None or self._opened is None or self._now is None or self._opened.room is None:
            return
        try:
            if is_changed(self._opened, self._now):
                self._keep(self._folder, self._opened, self._now)
            else:
                self._remove()
        except OSError as error:
            self.messages.append(f"{self._folder}: cannot be written: {error.strerror}; save the room or it is lost")

    def saved(self, scene: Scene) -> None:
        """The room of the scene now stands in a file; what no room file holds is kept on."""
        if self._opened is not None:
            self._opened = Scene(scene.written_room, scene.place, self._opened.board, scene.room_file, scene.options)
            self._now = scene
            self.write()

    def restored(self, wanted: RestoreRoom, here: Scene) -> Scene:
        """`here` with what was not saved. Raises InputError where that is gone or cannot be understood."""
        return read_unsaved(wanted.path).onto(here)

    def discard(self, unwanted: DiscardRoom) -> None:
        """Forget that one. Raises OutputError."""
        try:
            unwanted.path.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(
                f"{unwanted.path}: cannot be removed: {error.strerror}; it will be asked about"
            ) from error

    def _left(self) -> list[tuple[Path, UnsavedRoom]]:
        """All there are, the newest first."""
        found: list[tuple[Path, UnsavedRoom]] = []
        for path in self._folder.glob("*.json") if self._folder is not None else ():
            try:
                found.append((path, read_unsaved(path)))
            except InputError as error:
                self.messages.append(str(error))
        return sorted(found, key=lambda one: -one[1].when)

    def _go_on_with(self, path: Path, unsaved: UnsavedRoom) -> None:
        self._opened = unsaved.opened.scene()
        self._file, self._text, self._kept = path, unsaved.model_dump_json(indent=1), unsaved.changed

    def _keep(self, folder: Path, opened: Scene, now: Scene) -> None:
        changed = SceneMemory.of(now)
        if changed == self._kept:
            return
        unsaved = UnsavedRoom(
            room_name=room_name(opened),
            room_text=room_text(now),
            opened=SceneMemory.of(opened),
            changed=changed,
            when=time.time(),
        )
        if self._file is None or not self._is_ours(self._file):
            self._file = _free_name(folder, Path(opened.room_file or "room").stem)
        text = unsaved.model_dump_json(indent=1)
        write_unsaved(self._file, text)
        self._text, self._kept = text, changed

    def _remove(self) -> None:
        if self._file is not None and self._is_ours(self._file):
            self._file.unlink()
        self._forget_file()

    def _forget_file(self) -> None:
        self._file, self._text, self._kept = None, "", None

    def _is_ours(self, file: Path) -> bool:
        """Whether the file is as it was written here: another window may have gone on with it."""
        return file.exists() and file.read_text(encoding="utf-8", errors="replace") == self._text


def _question(path: Path, unsaved: UnsavedRoom, scene: Scene) -> Notice:
    name = unsaved.opened.room_file or unsaved.room_name
    when = time.strftime("%d %B at %H:%M", time.localtime(unsaved.when)).lstrip("0")
    said = f"{name} was changed in the window on {when} and not saved"
    if scene.room and scene.room.text != unsaved.opened.room_text:
        said += "; the file was another one then"
    return Notice(said, "Bring back", RestoreRoom(path), "Throw away", DiscardRoom(path))


def _free_name(folder: Path, stem: str) -> Path:
    names = (folder / f"{stem}{'' if k == 1 else f'_{k}'}.json" for k in count(1))
    return next(name for name in names if not name.exists())
