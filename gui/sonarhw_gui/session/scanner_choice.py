"""The choice of the scanner, and the list of ports."""

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
    """A scanner to connect to."""

    url: str
    opener: ScannerOpener
    scene: Scene | None = None  # the scene of a fake scanner


ScannerFinder = Callable[[str], ScannerTarget]  # raises SonarError for an invalid URL


class ScannerChoice(QObject):
    """The chosen scanner, if any, and the ports that were found last."""

    chosen = Signal(object)  # ScannerTarget
    ports_changed = Signal(object)  # tuple of PortRow
    failed = Signal(str)

    def __init__(self, scanner: ScannerTarget | None, find_scanner: ScannerFinder | None, parent: QObject) -> None:
        """`scanner`: chosen at the start."""
        super().__init__(parent)
        self.url = scanner.url if scanner else ""
        self.opener = scanner.opener if scanner else None
        self.urls: tuple[str, ...] = ()  # used before, newest first
        self._find_scanner = find_scanner
        self._make_ports = PortList
        self._ports: PortList | None = None

    @property
    def possible(self) -> bool:
        """Whether a scanner can be chosen by its URL."""
        return self._find_scanner is not None

    @property
    def rows(self) -> Sequence[PortRow]:
        """The ports that were found last."""
        return self._ports.rows if self._ports else ()

    @Slot(str)
    def choose(self, url: str) -> None:
        """Choose the scanner at `url`: emits `chosen`, or `failed` for an invalid URL."""
        if (target := self.find(url)) is not None:
            self.chosen.emit(target)

    def find(self, url: str) -> ScannerTarget | None:
        """Return the scanner at `url`. Emits `failed` and returns None for an invalid URL."""
        try:
            return self._find_scanner(url) if self._find_scanner is not None else None
        except SonarError as error:
            self.failed.emit(str(error))
            return None

    def remember(self, target: ScannerTarget) -> None:
        """Store that this scanner is used now."""
        self.url, self.opener = target.url, target.opener
        self.urls = with_newest(self.urls, target.url)

    @Slot()
    def list_ports(self) -> None:
        """List the ports of this computer."""
        if self._ports is None:
            self._ports = self._make_ports()
        self._ports.list_ports(self.url)

    @Slot()
    def probe_all(self) -> None:
        """Probe every port: open it and check whether a scanner answers."""
        if self._ports is not None:
            self._ports.probe_all()

    @Slot(str)
    def listen(self, device: str) -> None:
        """Listen at a port for the text of a device that prints readings."""
        if self._ports is not None:
            self._ports.listen(device)
            self.ports_changed.emit(self._ports.rows)

    def tick(self) -> None:
        """Emit changes of the ports."""
        if self._ports is None:
            return
        if self._ports.take():
            self.ports_changed.emit(self._ports.rows)
        for message in self._ports.failures:
            self.failed.emit(message)
        self._ports.failures.clear()

    def close(self) -> None:
        """End the thread that probes the ports."""
        if self._ports is not None:
            self._ports.close()
