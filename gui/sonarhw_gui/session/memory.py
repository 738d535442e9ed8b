"""The state that the window restores at the next start, in a settings file of Qt (INI)."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from platformdirs import user_data_path
from pydantic import TypeAdapter, ValidationError
from PySide6.QtCore import QByteArray, QSettings

from sonarhw.errors import InputError, OutputError
from sonarhw_gui.live.scanner_jobs import ScanSettings
from sonarhw_gui.look.appearance import LengthUnit, Look
from sonarhw_gui.look.palette import DARK, LIGHT
from sonarhw_gui.scene.scene_memory import SceneMemory

_PALETTES = {palette.name: palette for palette in (LIGHT, DARK)}
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


def memory_file() -> Path:
    """Return the settings file on this system; it may not exist yet."""
    return user_data_path("sonarhw", appauthor=False) / "window.ini"


def read_memory(path: Path) -> Memory:
    """Return the stored state; the default if there is no file yet. Raises InputError if the file is damaged."""
    if not path.exists():
        return Memory()
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
            urls=_texts(file, "recent/scanners"),
            look=_look(file),
            view=TypeAdapter(int).validate_python(file.value("view", 0)),
            layout={
                name.removeprefix("layout/"): QByteArray(data)
                for name in names
                if name.startswith("layout/") and isinstance(data := file.value(name), QByteArray)
            },
            layouts=_layouts(file),
            introduced=_text(file, "introduced") == "true",
        )
    except ValidationError as error:
        raise _damaged(path, type(error).__name__) from error


def write_memory(path: Path, memory: Memory) -> None:
    """Write the file completely, or leave the old one. Raises OutputError."""
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
    file.beginWriteArray("layouts", len(memory.layouts))
    for number, (name, (panels, views)) in enumerate(sorted(memory.layouts.items())):
        file.setArrayIndex(number)
        file.setValue("name", name)
        file.setValue("panels", panels)
        file.setValue("views", views)
    file.endArray()
    file.setValue("introduced", "true" if memory.introduced else "false")
    file.sync()
    if file.status() is not QSettings.Status.NoError:
        raise OutputError(f"{path}: cannot be written; the next start uses older settings")


def _layouts(file: QSettings) -> dict[str, tuple[QByteArray, QByteArray]]:
    """Return the named layouts; one that is incomplete is left out."""
    found = {}
    for number in range(file.beginReadArray("layouts")):
        file.setArrayIndex(number)
        panels, views = file.value("panels"), file.value("views")
        if isinstance(panels, QByteArray) and isinstance(views, QByteArray):
            found[_text(file, "name")] = panels, views
    file.endArray()
    return found


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
    unit = LengthUnit.__members__.get(_text(file, "look/unit"), LengthUnit.M)
    scale = TypeAdapter(float).validate_python(file.value("look/scale", 1.0))
    return Look(_PALETTES.get(_text(file, "look/palette"), LIGHT), unit).scaled(scale)
