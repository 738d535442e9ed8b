"""Which scanner is used, and which ports there are to choose from."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from PySide6.QtCore import QObject, Signal, Slot

from sonarhw.errors import SonarError
from sonarhw_gui.live.scanner_jobs import ScannerOpener
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.store.recent_names import with_newest
from sonarhw_gui.work.port_list import PortList, PortRow


@dataclass(frozen=True)
class ScannerTarget:
    """How to get at a scanner."""

    url: str
    opener: ScannerOpener
    scene: Scene | None = None  # the room that a fake one hears


ScannerFinder = Callable[[str], ScannerTarget]  # raises SonarError for a URL that leads nowhere


class ScannerChoice(QObject):
    """At most one scanner, and the ports that were looked up last."""

    chosen = Signal(object)  # ScannerTarget
    ports_changed = Signal(object)  # tuple of PortRow
    failed = Signal(str)

    def __init__(
        self, find_scanner: ScannerFinder | None, parent: QObject, make_ports: Callable[[], PortList] = PortList
    ) -> None:
        super().__init__(parent)
        self.url = ""
        self.urls: tuple[str, ...] = ()  # used before, the newest first
        self._find_scanner = find_scanner
        self._make_ports = make_ports
        self._ports: PortList | None = None

    @property
    def possible(self) -> bool:
        """Whether a URL can be followed at all."""
        return self._find_scanner is not None

    @property
    def rows(self) -> Sequence[PortRow]:
        """The ports that were looked up last."""
        return self._ports.rows if self._ports else ()

    @Slot(str)
    def choose(self, url: str) -> None:
        """Ask to use the scanner at `url`; an invalid URL emits `failed`."""
        if self._find_scanner is None:
            return
        try:
            way = self._find_scanner(url)
        except SonarError as error:
            self.failed.emit(str(error))
        else:
            self.chosen.emit(way)

    def remember(self, way: ScannerTarget) -> None:
        """Book that this scanner is used now."""
        self.url, self.urls = way.url, with_newest(self.urls, way.url)

    @Slot()
    def look(self) -> None:
        """Look up the ports of this machine."""
        if self._ports is None:
            self._ports = self._make_ports()
        self._ports.look(self.url)

    @Slot()
    def ask_all(self) -> None:
        """Ask at every port who answers."""
        if self._ports is not None:
            self._ports.ask_all()

    def tick(self) -> None:
        """Tell what has been found out."""
        if self._ports is None:
            return
        if self._ports.take():
            self.ports_changed.emit(self._ports.rows)
        for message in self._ports.failures:
            self.failed.emit(message)
        self._ports.failures.clear()

    def close(self) -> None:
        """End the thread that asks."""
        if self._ports is not None:
            self._ports.close()
