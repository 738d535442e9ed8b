"""Which scanner is used, and which ports there are to choose from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from PySide6.QtCore import QObject, Signal, Slot

from sonarhw.errors import SonarError
from sonarhw_gui.live.errands import ScannerOpener
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.store.recent_names import with_newest
from sonarhw_gui.work.port_book import PortBook, PortRow


@dataclass(frozen=True)
class ScannerWay:
    """How to get at a scanner."""

    url: str
    opener: ScannerOpener
    scene: Scene | None = None  # the room that a fake one hears


WayFinder = Callable[[str], ScannerWay]  # raises SonarError for a URL that leads nowhere


class ScannerChoice(QObject):
    """At most one scanner, and the ports that were looked up last."""

    chosen = Signal(object)  # ScannerWay
    ports_changed = Signal(object)  # tuple of PortRow
    failed = Signal(str)

    def __init__(self, find_way: WayFinder | None, parent: QObject, book: Callable[[], PortBook] = PortBook) -> None:
        super().__init__(parent)
        self.url = ""
        self.urls: tuple[str, ...] = ()  # used before, the newest first
        self._find_way = find_way
        self._make_book = book
        self._book: PortBook | None = None

    @property
    def possible(self) -> bool:
        """Whether a URL can be followed at all."""
        return self._find_way is not None

    @property
    def rows(self) -> Sequence[PortRow]:
        """The ports that were looked up last."""
        return self._book.rows if self._book else ()

    @Slot(str)
    def choose(self, url: str) -> None:
        """Ask to use the scanner at `url`; an invalid URL emits `failed`."""
        if self._find_way is None:
            return
        try:
            way = self._find_way(url)
        except SonarError as error:
            self.failed.emit(str(error))
        else:
            self.chosen.emit(way)

    def remember(self, way: ScannerWay) -> None:
        """Book that this scanner is used now."""
        self.url, self.urls = way.url, with_newest(self.urls, way.url)

    @Slot()
    def look(self) -> None:
        """Look up the ports of this machine."""
        if self._book is None:
            self._book = self._make_book()
        self._book.look(self.url)

    @Slot()
    def ask_all(self) -> None:
        """Ask at every port who answers."""
        if self._book is not None:
            self._book.ask_all()

    def tick(self) -> None:
        """Tell what has been found out."""
        if self._book is None:
            return
        if self._book.take():
            self.ports_changed.emit(self._book.rows)
        for message in self._book.failures:
            self.failed.emit(message)
        self._book.failures.clear()

    def close(self) -> None:
        """End the thread that asks."""
        if self._book is not None:
            self._book.close()
