"""Rooms with unsaved changes: each is stored in a file of its own until it is saved or discarded."""

import time
from dataclasses import dataclass
from pathlib import Path

from sonarhw.errors import InputError, OutputError
from sonarhw_gui.scene.scene import Scene, room_name
from sonarhw_gui.scene.scene_memory import SceneMemory
from sonarhw_gui.session.unsaved_file import UnsavedRoom, is_changed, read_unsaved, room_text, write_unsaved
from sonarhw_gui.shown.notices import Notice
from sonarhw_gui.store.new_recording import free_name

_SOON = 1.0  # s from a change until it is written; a crash loses this much


@dataclass(frozen=True)
class RestoreRoom:
    """Request to restore an unsaved room."""

    path: Path


@dataclass(frozen=True)
class DiscardRoom:
    """Request to discard an unsaved room."""

    path: Path


class UnsavedRooms:
    """Stores the changes of the scene that is shown."""

    def __init__(self, folder: Path | None) -> None:
        """`folder`: of the files; None: nothing is stored."""
        self.notices: list[Notice] = []  # questions about unsaved rooms
        self.messages: list[str] = []
        self._folder = folder
        self._opened: Scene | None = None
        self._now: Scene | None = None
        self._file: Path | None = None  # with the changes of this scene
        self._text = ""  # its content
        self._stored: SceneMemory | None = None  # the changed scene in it
        self._due: float | None = None

    def open(self, scene: Scene, source: Path | None = None) -> None:
        """Follow this scene from now on, and ask about other unsaved changes of its room.

        `source`: the file that the scene was restored from. A file is also updated if the scene contains its changes.
        """
        self.write()
        self._opened = self._now = scene
        self._forget_file()
        self.notices.clear()
        if scene.room is None:
            return
        for path, unsaved in self._unsaved():
            if path == source or unsaved.is_shown_by(scene):
                self._continue(path, unsaved)
            elif unsaved.is_of(scene):
                self.notices.append(_question(path, unsaved, scene))

    @property
    def changed(self) -> bool:
        """Whether the scene differs from the one that was opened or saved."""
        return self._opened is not None and self._now is not None and is_changed(self._opened, self._now)

    def change(self, scene: Scene, now: float) -> None:
        """Store a changed scene soon; `now` and the times of `tick` are of one clock, s."""
        self._now = scene
        if self._due is None:
            self._due = now + _SOON

    def tick(self, now: float) -> None:
        """Write changes that are older than a second."""
        if self._due is not None and now >= self._due:
            self.write()

    def write(self) -> None:
        """Write the changes; if all of them were undone, remove the file."""
        self._due = None
        if self._folder is None or self._opened is None or self._now is None or self._opened.room is None:
            return
        try:
            if is_changed(self._opened, self._now):
                self._store(self._folder, self._opened, self._now)
            else:
                self._remove()
        except OSError as error:
            self.messages.append(
                f"{self._folder}: cannot be written: {error.strerror}; save the room or lose its changes"
            )

    def saved(self, scene: Scene) -> None:
        """Note that the room was saved as a file; changes that a room file cannot contain stay stored."""
        if self._opened is not None:
            self._opened = Scene(scene.written_room, scene.place, self._opened.board, scene.room_file, scene.options)
            self._now = scene
            self.write()

    def restored(self, request: RestoreRoom, here: Scene) -> Scene:
        """Return the scene `here` with the unsaved changes. Raises InputError if their file is missing or invalid."""
        return read_unsaved(request.path).applied_to(here)

    def discard(self, request: DiscardRoom) -> None:
        """Remove the file of an unsaved room. Raises OutputError."""
        try:
            request.path.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(
                f"{request.path}: cannot be removed: {error.strerror}; the window will ask again"
            ) from error

    def _unsaved(self) -> list[tuple[Path, UnsavedRoom]]:
        """Return all unsaved rooms with their files, newest first."""
        found: list[tuple[Path, UnsavedRoom]] = []
        for path in self._folder.glob("*.json") if self._folder is not None else ():
            try:
                found.append((path, read_unsaved(path)))
            except InputError as error:
                self.messages.append(str(error))
        return sorted(found, key=lambda one: -one[1].when)

    def _continue(self, path: Path, unsaved: UnsavedRoom) -> None:
        self._opened = unsaved.opened.scene()
        self._file, self._text, self._stored = path, unsaved.model_dump_json(indent=1), unsaved.changed

    def _store(self, folder: Path, opened: Scene, now: Scene) -> None:
        changed = SceneMemory.of(now)
        if changed == self._stored:
            return
        unsaved = UnsavedRoom(
            room_name=room_name(opened),
            room_text=room_text(now),
            opened=SceneMemory.of(opened),
            changed=changed,
            when=time.time(),
        )
        if self._file is None or not self._is_ours(self._file):
            self._file = free_name(folder, Path(opened.room_file or "room").stem, ".json")
        text = unsaved.model_dump_json(indent=1)
        write_unsaved(self._file, text)
        self._text, self._stored = text, changed

    def _remove(self) -> None:
        if self._file is not None and self._is_ours(self._file):
            self._file.unlink()
        self._forget_file()

    def _forget_file(self) -> None:
        self._file, self._text, self._stored = None, "", None

    def _is_ours(self, file: Path) -> bool:
        """Return whether the file is unchanged: another window may have continued it."""
        return file.exists() and file.read_text(encoding="utf-8", errors="replace") == self._text


def _question(path: Path, unsaved: UnsavedRoom, scene: Scene) -> Notice:
    name = unsaved.opened.room_file or unsaved.room_name
    when = time.strftime("%d %B at %H:%M", time.localtime(unsaved.when)).lstrip("0")
    text = f"{name} has unsaved changes, made in the window on {when}"
    if scene.room and scene.room.text != unsaved.opened.room_text:
        text += "; the file has changed since then"
    return Notice(text, "Restore", RestoreRoom(path), "Discard", DiscardRoom(path))
