"""The scans that are drawn over the one shown, and the two whose differences are shown."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from PySide6.QtCore import QObject, Signal, Slot

from sonarhw.errors import InputError
from sonarhw.log import read_log
from sonarhw.readings import Reading
from sonarhw_gui.jobs.jobs import Jobs
from sonarhw_gui.model.look import OVERLAYS
from sonarhw_gui.model.scene import Scene, scene_of_log
from sonarhw_gui.model.shown import SHOWN, OverlaidScan, ScanPair, Shown, overlaid

_MOST = 8  # scans


@dataclass(frozen=True)
class _Made:
    """A scan, and where it was made."""

    name: str
    readings: tuple[Reading, ...]
    scene: Scene
    drawn_in: Scene | None = None  # if its own place is unknown


def _read_scan(path: Path, scene: Scene) -> _Made:
    """Read a log; one that names no place is drawn at that of `scene`. Raises InputError."""
    log = read_log(path)
    if not log.readings:
        raise InputError(f"{path.name}: contains no readings")
    return _Made(path.stem, log.readings, scene_of_log(log.metadata), scene)


class ScanList(QObject):
    """Up to eight scans."""

    changed = Signal(object, object)  # tuple of OverlaidScan, ScanPair or None
    failed = Signal(str)

    def __init__(self, shown: Callable[[], Shown], log_file: Callable[[], str], jobs: Jobs, parent: QObject) -> None:
        """`shown`, `log_file`: return what the window shows, and the file of its readings or ""."""
        super().__init__(parent)
        self._shown, self._log_file, self._jobs = shown, log_file, jobs
        self.scans: tuple[OverlaidScan, ...] = ()
        self.pair: ScanPair | None = None

    @Slot(str)
    def open(self, path: str) -> None:
        """Add the scan in a log."""
        self._jobs.run("add scans", _read_scan, Path(path), self._shown().scene, then=self._add_one)

    @Slot()
    def keep(self) -> None:
        """Add the readings shown, as they are now."""
        shown = self._shown()
        if shown.readings:
            self._add([_Made(self._name, shown.readings, shown.scene)])

    @Slot()
    def keep_sweeps(self) -> None:
        """Add each sweep of the readings shown; the first and the last are compared."""
        name, readings, scene = self._name, self._shown().readings, self._shown().scene
        sweeps = sorted({reading.sweep for reading in readings})
        if len(sweeps) < 2:
            self.failed.emit(
                "these readings have one sweep only; scan with several, or keep this scan and make another"
            )
            return
        before = len(self.scans)
        chosen = sweeps[: max(1, _MOST - before)]
        parts = [tuple(one for one in readings if one.sweep == sweep) for sweep in chosen]
        self._add([_Made(f"{name}, sweep {sweep + 1}", part, scene) for sweep, part in zip(chosen, parts, strict=True)])
        if len(self.scans) > before + 1:
            self.compare(before, len(self.scans) - 1)

    @Slot(int)
    def remove(self, row: int) -> None:
        """Remove a scan."""
        if 0 <= row < len(self.scans):
            self.scans = self.scans[:row] + self.scans[row + 1 :]
            self._set(ScanPair(len(self.scans) - 1, SHOWN) if self.scans else None)

    @Slot(int, bool)
    def switch(self, row: int, visible: bool) -> None:
        """Show or hide a scan."""
        if self.scans[row].visible is not visible:
            scans = list(self.scans)
            scans[row] = replace(scans[row], visible=visible)
            self.scans = tuple(scans)
            self._set(self.pair)

    @Slot(int, int)
    def compare(self, first: int, second: int) -> None:
        """Choose the two scans whose differences are shown."""
        self._set(ScanPair(first, second))

    @property
    def _name(self) -> str:
        return Path(self._log_file()).stem or f"scan {len(self.scans) + 1}"

    def _add_one(self, made: _Made) -> None:
        self._add([made])

    def _add(self, scans: Iterable[_Made]) -> None:
        for made in scans:
            if len(self.scans) == _MOST:
                self.failed.emit(f"{made.name}: {_MOST} scans are in the list; remove one")
                break
            used = {scan.style for scan in self.scans}
            style = next((k for k in range(len(OVERLAYS)) if k not in used), len(self.scans) % len(OVERLAYS))
            self.scans = (*self.scans, overlaid(made.name, made.readings, made.scene, style, made.drawn_in))
        self._set(ScanPair(len(self.scans) - 1, SHOWN))

    def _set(self, pair: ScanPair | None) -> None:
        self.pair = pair
        self.changed.emit(self.scans, pair)
