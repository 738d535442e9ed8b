"""What the window remembers from one start to the next: what was open, how it looked, what was used last.

Takes values; hands on a file in the person's own folder, and the values in it again. A file that cannot be understood
is refused like any other input.
"""

import os
from pathlib import Path

from platformdirs import user_data_path
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from sonarhw_sim.board.profile import parse_board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.model import Place, parse_room

from sonarhw.errors import InputError, OutputError
from sonarhw_gui.live.errands import ScanWish
from sonarhw_gui.look.appearance import LengthUnit, Look
from sonarhw_gui.look.palette import DARK, LIGHT
from sonarhw_gui.scene.scene import Scene

_PALETTES = {palette.name: palette for palette in (LIGHT, DARK)}


def memory_file() -> Path:
    """The file on this system; it may not exist yet."""
    return user_data_path("sonarhw", appauthor=False) / "window.json"


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class SceneMemory(_Part):
    """A scene, with its room and board as the text of their files."""

    room_text: str
    room_file: str
    place: Place | None
    board_text: str
    options: PredictionOptions

    @staticmethod
    def of(scene: Scene) -> "SceneMemory":
        """What is to be remembered of a scene."""
        text = scene.room.text if scene.room else ""
        return SceneMemory(
            room_text=text,
            room_file=scene.room_file,
            place=scene.place,
            board_text=scene.board.text,
            options=scene.options,
        )

    def scene(self) -> Scene:
        """The scene again. Raises InputError."""
        board = parse_board(self.board_text, "the board of the last session")
        room = parse_room(self.room_text, "the room of the last session") if self.room_text else None
        return Scene(room, self.place if room else None, board, self.room_file, self.options)


class LookMemory(_Part):
    """How it looked."""

    palette: str = LIGHT.name
    unit: str = LengthUnit.M.name
    scale: float = 1.0

    @staticmethod
    def of(look: Look) -> "LookMemory":
        """What is to be remembered of a look."""
        return LookMemory(palette=look.palette.name, unit=look.unit.name, scale=look.scale)

    def look(self) -> Look:
        """The look again; what is not known is as usual."""
        unit = LengthUnit.__members__.get(self.unit, LengthUnit.M)
        return Look(_PALETTES.get(self.palette, LIGHT), unit).scaled(self.scale)


class LayoutMemory(_Part):
    """Where everything was: Qt's own words for it, in base 64."""

    geometry: str = ""
    docks: str = ""
    splitters: dict[str, str] = Field(default_factory=dict)
    view: int = 0


class Memory(_Part):
    """Everything."""

    scene: SceneMemory | None = None
    log: str = ""  # whose readings were shown
    url: str = ""  # of the scanner
    wish: ScanWish | None = None  # what to scan
    recent: tuple[str, ...] = ()
    urls: tuple[str, ...] = ()
    look: LookMemory = LookMemory()
    layout: LayoutMemory = LayoutMemory()


def read_memory(path: Path) -> Memory:
    """What was remembered; nothing where there is no file yet. Raises InputError where it cannot be understood."""
    try:
        return Memory.model_validate_json(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return Memory()
    except (OSError, UnicodeDecodeError, ValidationError) as error:
        raise InputError(
            f"{path}: what the window remembered cannot be read ({type(error).__name__}); it begins anew"
        ) from error


def write_memory(path: Path, memory: Memory) -> None:
    """Remember it: the whole file, or the one before. Raises OutputError."""
    try:
        write_whole(path, memory.model_dump_json(indent=1))
    except OSError as error:
        raise OutputError(
            f"{path}: cannot be written: {error.strerror}; the window will not open as it was left"
        ) from error


def write_whole(path: Path, text: str) -> None:
    """Write a file, all of it or nothing, in a folder that need not exist yet. Raises OSError."""
    fresh = path.with_suffix(".new")
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh.write_text(text, encoding="utf-8")
    os.replace(fresh, path)
