"""What the next start restores: settings, unsaved rooms, and notes."""

import hashlib
import os
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

from platformdirs import user_data_path
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError
from PySide6.QtCore import QByteArray, QSettings
from sonarhw_compare.scans import ReadingNote, note_on, notes_of_log, notes_path, placed_notes, read_notes, save_notes

from sonarhw.errors import InputError, OutputError, SonarError
from sonarhw.files import open_input, replace_regular, unfinished_file
from sonarhw.readings import Reading
from sonarhw_gui.jobs.files import free_name
from sonarhw_gui.model.look import DARK, LIGHT, UNITS, LengthUnit, Look
from sonarhw_gui.model.scene import NO_NOTES, NoteTexts, Scene, SceneMemory, room_name
from sonarhw_gui.session.notices import Notice, NoticeButton, Notices
from sonarhw_gui.session.scanner import ScanSettings

# The state that the window restores at the next start, in a settings file of Qt (INI).


_MOST_BYTES = 64_000_000  # of a file
_PALETTES = {palette.name: palette for palette in (LIGHT, DARK)}
_UNITS = {unit.name: unit for unit in UNITS}
T = TypeVar("T")


@dataclass(frozen=True)
class Memory:
    """The stored state of the window."""

    scene: SceneMemory | None = None
    log: str = ""  # path of the log that was shown
    url: str = ""  # of the scanner
    scan_settings: ScanSettings | None = None  # of the next scan
    recent: tuple[str, ...] = ()  # files
    urls: tuple[str, ...] = ()
    look: Look = field(default_factory=Look)
    view: int = 0  # index of the large view
    layout: Mapping[str, QByteArray] = field(default_factory=dict)  # as saved by Qt, by name of the part
    layouts: Mapping[str, tuple[QByteArray, QByteArray]] = field(default_factory=dict)  # panels and views, by name
    introduced: bool = False  # whether the hint of the first start has ended
    pictures: Mapping[str, QByteArray] = field(default_factory=dict)  # PNG of the plan, by recent file


def memory_file() -> Path:
    """Return the settings file on this system; it may not exist yet."""
    return user_data_path("sonarhw", appauthor=False) / "window.ini"


def read_memory(path: Path) -> Memory:
    """Return the stored state; the default if there is no file yet. Raises InputError if the file is damaged."""
    if not path.exists():
        return Memory()
    try:
        open_input(path, _MOST_BYTES).close()
    except OSError as error:
        raise _damaged(path, error.strerror or type(error).__name__) from error
    file = QSettings(str(path), QSettings.Format.IniFormat)
    names = file.allKeys()  # reads the whole file; only then its status reports damage
    if file.status() is not QSettings.Status.NoError:
        raise _damaged(path, file.status().name)
    try:
        return Memory(
            scene=_value(file, "scene", SceneMemory),
            log=_text(file, "log"),
            url=_text(file, "scanner"),
            scan_settings=_value(file, "scan", ScanSettings),
            recent=_texts(file, "recent/files"),
            pictures={name: picture for name, (picture,) in _arrays(file, "pictures", "file", ("plan",)).items()},
            urls=_texts(file, "recent/scanners"),
            look=_look(file),
            view=TypeAdapter(int).validate_python(file.value("view", 0)),
            layout={
                name.removeprefix("layout/"): QByteArray(data)
                for name in names
                if name.startswith("layout/") and isinstance(data := file.value(name), QByteArray)
            },
            layouts={
                name: (panels, views)
                for name, (panels, views) in _arrays(file, "layouts", "name", ("panels", "views")).items()
            },
            introduced=_text(file, "introduced") == "true",
        )
    except ValidationError as error:
        raise _damaged(path, type(error).__name__) from error


def write_memory(path: Path, memory: Memory) -> None:
    """Write the file completely, or leave the old one. Raises OutputError."""
    if path.exists() and not path.is_file():  # Qt would replace a device
        raise OutputError(f"{path}: is not a regular file, and is not replaced; the next start uses the defaults")
    file = QSettings(str(path), QSettings.Format.IniFormat)
    file.clear()
    for name, value in (("scene", memory.scene), ("scan", memory.scan_settings)):
        if value is not None:
            file.setValue(name, TypeAdapter(type(value)).dump_json(value).decode())
    file.setValue("log", memory.log)
    file.setValue("scanner", memory.url)
    file.setValue("recent/files", [*memory.recent])
    file.setValue("recent/scanners", [*memory.urls])
    file.setValue("look/palette", memory.look.palette.name)
    file.setValue("look/unit", memory.look.unit.name)
    file.setValue("look/scale", memory.look.scale)
    file.setValue("view", memory.view)
    for name, data in memory.layout.items():
        file.setValue(f"layout/{name}", data)
    layouts = {name: {"panels": panels, "views": views} for name, (panels, views) in sorted(memory.layouts.items())}
    _write_arrays(file, "layouts", "name", layouts)
    _write_arrays(file, "pictures", "file", {name: {"plan": picture} for name, picture in memory.pictures.items()})
    file.setValue("introduced", "true" if memory.introduced else "false")
    file.sync()
    if file.status() is not QSettings.Status.NoError:
        raise OutputError(f"{path}: cannot be written; the next start uses older settings")


def _arrays(file: QSettings, array: str, name: str, keys: Sequence[str]) -> dict[str, list[QByteArray]]:
    """Return the values of `keys` by the value of `name`; an entry that is incomplete is left out."""
    entries = {}
    for number in range(file.beginReadArray(array)):
        file.setArrayIndex(number)
        values = [value for key in keys if isinstance(value := file.value(key), QByteArray)]
        if len(values) == len(keys):
            entries[_text(file, name)] = values
    file.endArray()
    return entries


def _write_arrays(file: QSettings, array: str, name: str, entries: Mapping[str, Mapping[str, QByteArray]]) -> None:
    file.beginWriteArray(array, len(entries))
    for number, (entry, values) in enumerate(entries.items()):
        file.setArrayIndex(number)
        for key, value in ((name, entry), *values.items()):
            file.setValue(key, value)
    file.endArray()


def _damaged(path: Path, why: str) -> InputError:
    return InputError(f"{path}: the window settings cannot be read ({why}); defaults are used")


def _value(file: QSettings, name: str, kind: type[T]) -> T | None:
    text = _text(file, name)
    return TypeAdapter(kind).validate_json(text) if text else None


def _text(file: QSettings, name: str) -> str:
    return str(file.value(name) or "")


def _texts(file: QSettings, name: str) -> tuple[str, ...]:
    # Qt returns a list with one item as this item, and an empty list as None
    value = file.value(name)
    return tuple(map(str, value)) if isinstance(value, list) else (str(value),) if value else ()


def _look(file: QSettings) -> Look:
    """Return the look; an unknown palette or unit is replaced by the default."""
    unit = _UNITS.get(_text(file, "look/unit"), LengthUnit.M)
    scale = TypeAdapter(float).validate_python(file.value("look/scale", 1.0))
    return Look(_PALETTES.get(_text(file, "look/palette"), LIGHT), unit).scaled(scale)


# The file of one room with unsaved changes: its content, reading and writing.


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

    @property
    def is_only_moved(self) -> bool:
        """Whether the sensor alone has moved."""
        opened, changed = self.opened, self.changed
        return (changed.room_text, changed.board_text) == (opened.room_text, opened.board_text)

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
        with open_input(path, _MOST_BYTES) as file:
            return UnsavedRoom.model_validate_json(file.read())
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
        replace_regular(fresh, path)


# Rooms with unsaved changes: each is stored in a file of its own until it is saved or discarded.


_SOON = 1.0  # s from a change until it is written; a crash loses this much
_EVERY = 2.0  # s between two looks for changes of the state of the window


class UnsavedRooms:
    """Stores the changes of the scene that is shown."""

    def __init__(self, folder: Path | None, notices: Notices, restore: Callable[[Path], object]) -> None:
        """`folder`: of the files; None: nothing is stored. `restore` is called with the file of a room to restore."""
        self._folder, self._notices, self._restore = folder, notices, restore
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
        self._notices.end("scene replaced")
        if scene.room is None:
            return
        for path, unsaved in self._unsaved():
            if path == source or unsaved.is_shown_by(scene):
                self._continue(path, unsaved)
            elif unsaved.is_of(scene):
                self._ask(path, unsaved, scene)

    @property
    def changed(self) -> bool:
        """Whether the scene differs from the one that was opened or saved."""
        return self._opened is not None and self._now is not None and is_changed(self._opened, self._now)

    @property
    def file_text(self) -> str:
        """The content of the room file when it was opened or saved last; empty without a room."""
        return "" if self._opened is None or self._opened.room is None else self._opened.room.text

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
            self._notices.warn(
                f"{self._folder}: cannot be written: {error.strerror}; save the room or lose its changes"
            )

    def saved(self, scene: Scene) -> None:
        """Note that the room was saved as a file; changes that a room file cannot contain stay stored."""
        if self._opened is not None:
            self._opened = Scene(scene.written_room, scene.place, self._opened.board, scene.room_file, scene.options)
            self._now = scene
            self.write()

    def _discard(self, path: Path) -> None:
        """Remove the file of an unsaved room. Raises OutputError."""
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise OutputError(f"{path}: cannot be removed: {error.strerror}; the window will ask again") from error

    def _ask(self, path: Path, unsaved: UnsavedRoom, scene: Scene) -> None:
        """Ask whether to restore the changes in a file."""
        name = unsaved.opened.room_file or unsaved.room_name
        when = time.strftime("%d %B at %H:%M", time.localtime(unsaved.when)).lstrip("0")
        changes = ": the sensor was moved" if unsaved.is_only_moved else " has unsaved changes, made"
        text = f"{name}{changes} in the window on {when}"
        if scene.room and scene.room.text != unsaved.opened.room_text:
            text += "; the file has changed since then"
        restore, discard = NoticeButton("Restore", self._restore, path), NoticeButton("Discard", self._discard, path)
        self._notices.add(Notice(text, restore, discard, until="scene replaced"))

    def _unsaved(self) -> list[tuple[Path, UnsavedRoom]]:
        """Return all unsaved rooms with their files, newest first."""
        rooms: list[tuple[Path, UnsavedRoom]] = []
        for path in self._folder.glob("*.json") if self._folder is not None else ():
            try:
                rooms.append((path, read_unsaved(path)))
            except InputError as error:
                self._notices.warn(str(error))
        return sorted(rooms, key=lambda room: -room[1].when)

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
        try:
            with open_input(file, _MOST_BYTES) as stored:
                return stored.read().decode(errors="replace") == self._text
        except OSError:
            return False


# Keeps the notes on readings beside their log. If its folder cannot be written, in a folder of the window.


class NoteStore:
    """The notes of one log at a time. Notes are written at once; of a scan without a log they are kept in memory."""

    def __init__(self, folder: Path | None, notices: Notices) -> None:
        """`folder`: for notes that cannot be written beside their log; None: they are kept in memory."""
        self._folder, self._notices = folder, notices
        self._stored = NO_NOTES
        self._aside = False  # whether the user knows that notes are not beside the log

    def open(self, log: Path | None, readings: Sequence[Reading]) -> NoteTexts:
        """Return the notes on the readings of a log; None: it has no file yet."""
        self._stored, self._aside = NO_NOTES, False
        if log is None:
            return NO_NOTES
        beside = notes_of_log(log, readings)
        for doubt in beside.doubts:
            self._notices.warn(doubt)
        aside = placed_notes(self._kept_aside(log), readings, notes_path(log), log)
        self._stored = NoteTexts(dict(sorted({**beside.texts, **aside.texts}.items())))
        return self._stored

    def save(self, notes: NoteTexts, readings: Sequence[Reading], log: Path | None) -> None:
        """Write the notes that have changed since the last call."""
        places = notes.changed_since(self._stored)
        if not places:
            return
        if log is None:
            self._warn_of_no_log()
            return
        changes = [note_on(readings[place], notes.of(place)) for place in places if place < len(readings)]
        others = [note for note in self._kept_aside(log) if not any(map(note.is_on_reading_of, changes))]
        try:
            save_notes(notes_path(log), [*others, *changes])
            aside = self._aside_path(log)
            if aside is not None:
                aside.unlink(missing_ok=True)
        except (SonarError, OSError) as error:
            if self._keep_aside(log, changes, str(error)):
                self._stored = notes
        else:
            self._stored, self._aside = notes, False

    def _warn_of_no_log(self) -> None:
        if not self._aside:
            self._notices.warn(
                "this scan has no log, and its notes are lost when the window closes; Copy CSV above the table of "
                "readings includes them"
            )
        self._aside = True

    def _keep_aside(self, log: Path, changes: Sequence[ReadingNote], problem: str) -> bool:
        """Keep notes in the folder of the window; return whether they are on the disk. One message a log."""
        where = "the notes are lost when the window closes"
        path = self._aside_path(log)
        kept = False
        if path is not None:
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                save_notes(path, changes)
                where, kept = f"this window keeps the notes in {path.parent} meanwhile", True
            except (SonarError, OSError):
                kept = False
        if not (self._aside and kept):
            self._notices.warn(f"{problem}; {where}")
        self._aside = kept
        return kept

    def _kept_aside(self, log: Path) -> tuple[ReadingNote, ...]:
        path = self._aside_path(log)
        try:
            return () if path is None else read_notes(path).notes
        except InputError as error:
            self._notices.warn(str(error))
            return ()

    def _aside_path(self, log: Path) -> Path | None:
        if self._folder is None:
            return None
        name = str(log.absolute()).encode(errors="surrogateescape")
        return self._folder / f"{log.stem}-{hashlib.sha256(name).hexdigest()[:12]}.notes.csv"


class Kept:
    """The one store of what the next start restores: the state of the window, unsaved rooms, and some notes."""

    def __init__(self, file: Path | None, notices: Notices, restore: Callable[[Path], object]) -> None:
        """`file`: of the state of the window, beside the folder of the rest; None: nothing is stored.

        `restore` is called with the file of an unsaved room that the user wants back.
        """
        folder = None if file is None else file.parent / "unsaved"
        self.rooms, self.notes = UnsavedRooms(folder, notices, restore), NoteStore(folder, notices)
        self.state: Callable[[], Memory] | None = None  # returns the state of the window
        self._file = file
        self._written: Memory | None = None
        self._look_at = 0.0  # time of the next look for changes of the state

    def tick(self, now: float) -> None:
        """Store rooms a second after a change, and the state of the window two seconds after it."""
        self.rooms.tick(now)
        if now >= self._look_at:
            self._look_at = now + _EVERY
            self.write()

    def write(self) -> None:
        """Store the state of the window now, if it has changed."""
        memory = None if self._file is None or self.state is None else self.state()
        if self._file is not None and memory is not None and memory != self._written:
            with suppress(OutputError):  # the next window opens with older settings
                write_memory(self._file, memory)
                self._written = memory
