"""Requests to save pictures, data and reports; each file is written completely or not at all."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import BinaryIO, Protocol

from sonarhw_compare.film_file import FILMS, write_film
from sonarhw_compare.scans import ReadingNote, placed_notes
from sonarhw_compare.sound import PlayedPing

from sonarhw.errors import InputError, json_text
from sonarhw.export import export_format, export_suffixes
from sonarhw.log import Log, read_log
from sonarhw_gui.parts.pixels import Pixels
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import room_and_place
from sonarhw_gui.store.svg_strokes import with_own_coordinates

JSON, HTML, PNG, SVG = ".json", ".html", ".png", ".svg"


class Content(Protocol):
    """The content of a file to save."""

    @property
    def endings(self) -> Sequence[str]:
        """The file name extensions that are possible."""

    def write(self, file: BinaryIO, ending: str) -> None:
        """Write the content; runs in a thread. Raises SonarError."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture of a view, as pixels or as SVG."""

    pixels: Pixels | None
    svg: str = ""
    endings: Sequence[str] = (PNG, SVG)

    def write(self, file: BinaryIO, ending: str) -> None:
        """Write the picture as PNG or SVG."""
        if self.pixels is None:
            file.write(with_own_coordinates(self.svg).encode())
            return
        from matplotlib.image import imsave  # takes half a second; only the first picture needs it

        imsave(file, self.pixels, format="png")


@dataclass(frozen=True)
class Data:
    """The readings of a log as from `sonarhw log export`, or the summary of `sonarhw compare --json`."""

    recorded: Log | Path
    scene: Scene
    endings: Sequence[str] = (*export_suffixes(), JSON)
    notes: Sequence[ReadingNote] = ()

    def write(self, file: BinaryIO, ending: str) -> None:
        """Write the readings or the summary."""
        log = _log_of(self.recorded)
        if ending == JSON:
            file.write(_summary(log, self.scene).encode())
        else:
            export_format(ending).write(log, file, _notes_in(log, self.notes))


@dataclass(frozen=True)
class ReportPage:
    """The report about a log in a scene."""

    name: str
    recorded: Log | Path
    scene: Scene
    link: Sequence[tuple[str, str]] = ()
    notes: Sequence[ReadingNote] = ()
    endings: Sequence[str] = (HTML,)

    def write(self, file: BinaryIO, ending: str) -> None:
        """Compute the report, which takes some seconds, and write it."""
        from sonarhw_compare.report import report_html, report_of
        from sonarhw_compare.scans import GivenScan

        log, scene = _log_of(self.recorded), self.scene
        room, place = room_and_place(scene)
        report = report_of(
            GivenScan(self.name, log.readings, log),
            room,
            place,
            scene.board,
            scene.options,
            link=tuple(self.link),
            notes=_notes_in(log, self.notes),
        )
        file.write(report_html(report).encode())


@dataclass(frozen=True)
class FilmOfSound:
    """A film of one ping, as `sonarhw simulate --out FILE.gif` writes it."""

    ping: PlayedPing
    endings: Sequence[str] = FILMS

    def write(self, file: BinaryIO, ending: str) -> None:
        """Draw and write the film, which takes some seconds. Raises MissingExtra for a video without PyAV."""
        from sonarhw_compare.film import FilmTiming  # loads matplotlib, which the window does not need

        write_film(self.ping, FilmTiming(), file, ending)


@dataclass(frozen=True)
class SaveRequest:
    """Save content to a file."""

    content: Content
    path: Path
    overwrite: bool

    def answer(self) -> Path:
        """Write the file. Raises InputError, OutputError; then no file is written."""
        from sonarhw.files import atomic_file

        endings, path = self.content.endings, self.path
        if path.suffix.lower() not in endings:
            raise InputError(f"{path.name}: expected a name ending in {' or '.join(endings)}")
        if path.is_symlink() and path.resolve().suffix.lower() not in endings:
            raise InputError(f"{path}: is a link to {path.resolve()}; choose another name")
        if path.exists() and not self.overwrite:
            raise InputError(f"{path}: exists already; choose another name")
        with atomic_file(path, "name", overwrite=self.overwrite) as file:
            self.content.write(file, path.suffix.lower())
        return path


def _log_of(recorded: Log | Path) -> Log:
    return read_log(recorded) if isinstance(recorded, Path) else recorded


def _notes_in(log: Log, notes: Sequence[ReadingNote]) -> dict[int, str]:
    """Return notes by the place of their reading in the log: those of a live scan may be in another order there."""
    return placed_notes(notes, log.readings, Path(), Path()).texts


def _summary(log: Log, scene: Scene) -> str:
    from sonarhw_compare.match import compare_readings

    room, _ = room_and_place(scene)
    compared = compare_readings(log.readings, room, scene.pose, scene.board, scene.options)
    return json_text(asdict(replace(compared, origin=log.origin).summary())) + "\n"
