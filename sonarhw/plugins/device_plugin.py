"""The class to write for a device that does not speak the wire protocol of this project.

A package offers its class as an entry point of the group `sonarhw.devices`. The name of the entry point is the scheme
of its URLs:

    [project.entry-points."sonarhw.devices"]
    mysonar = "mysonar:MySonar"

Every command, the window and `sonarhw.open_scanner` then open `mysonar:...`. Threads, reconnection, logs, sweeps,
Stop and the state of the connection come from `Scanner`.
"""

import math
import threading
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from itertools import islice
from typing import ClassVar

from sonarhw.errors import DeviceError, InputError, NoAnswer, SonarError
from sonarhw.link import KNOWN_SCHEMES, WITH_HOST
from sonarhw.readings import ScanOrder
from sonarhw.wire.limits import MAX_TEXT
from sonarhw.wire.messages import MOST_DEGREES

MOST_ANGLE = math.radians(MOST_DEGREES)
MOST_TEMPERATURE = 327.0  # °C, either sign
_MOST_TIME = 1e13  # s


@dataclass(frozen=True)
class Measurement:
    """The result of one ping."""

    angle: float  # turntable angle, rad, counter-clockwise
    ranges: tuple[float, ...]  # m, of each echo, nearest first; empty: no echo
    time: float | None = None  # of the ping, s since the epoch; None: the time of its arrival
    temperature_c: float | None = None  # of the air at the device
    restarted: bool = False  # the device may have restarted since the measurement before


def _fault_of(item: object) -> str | None:
    """Return why a log cannot hold what a plug-in measured, as a kind to count; None if it can."""
    if not isinstance(item, Measurement):
        return f"objects of the type {type(item).__name__} instead of Measurement"
    try:
        if not abs(item.angle) <= MOST_ANGLE:
            return f"measurements with an angle beyond {MOST_DEGREES} degrees, or not finite"
        if not all(map(math.isfinite, item.ranges)):
            return "measurements with a range that is not finite"
        if not abs(item.temperature_c or 0.0) <= MOST_TEMPERATURE:
            return f"measurements with a temperature beyond {MOST_TEMPERATURE:g} °C, or not finite"
        if not abs(item.time or 0.0) <= _MOST_TIME:
            return "measurements with an impossible time"
        _as_numbers(item)
    except (TypeError, ValueError, OverflowError):
        return "measurements with something else than numbers"
    return None


def _as_numbers(item: Measurement) -> Measurement:
    """Return a measurement of floats: a plug-in may use the numbers of any library. Raises TypeError, ValueError."""
    return Measurement(
        float(item.angle),
        tuple(map(float, item.ranges)),
        None if item.time is None else float(item.time),
        None if item.temperature_c is None else float(item.temperature_c),
        bool(item.restarted),
    )


@dataclass(frozen=True)
class DeviceIdentity:
    """What the device is."""

    name: str  # of the device or its firmware, for people
    serial: str = ""
    board: str = ""  # name of the board profile that suits it; empty if unknown


def _ignore(data: bytes) -> None:
    """The default of `on_bytes`, which does nothing."""


class DevicePlugin(ABC):
    """A device at a URL. One thread calls `open`, `begin`, `read`, `end` and `close`.

    `DevicePlugin(url)` checks the URL, raises InputError if it is invalid, and opens nothing.
    """

    takes_orders: ClassVar[bool] = False
    """False: the device turns by itself, and its sweeps are recognised where the angle turns back. True: it measures at
    the angles of the order that `begin` receives, and returns one measurement for each ping of the order."""

    def __init__(self, url: str) -> None:
        self.url = url
        self.on_bytes: Callable[[bytes], None] = _ignore
        """Call this in `read` with all bytes as received: they are stored in the log."""

    @property
    @abstractmethod
    def identity(self) -> DeviceIdentity:
        """The identity of the device."""

    @abstractmethod
    def open(self) -> None:
        """Open the link to the device. Also called after a loss. Raises LinkError."""

    @abstractmethod
    def read(self) -> list[Measurement]:
        """Return the new measurements. Wait for at most 0.1 s. Raises LinkLost."""

    @abstractmethod
    def close(self) -> None:
        """Close the link. Must not raise. A second call does nothing."""

    def begin(self, order: ScanOrder) -> bool:
        """Prepare for a scan. Return whether measurements of the last two seconds may belong to it."""
        return not self.takes_orders

    def end(self) -> None:
        """Handle the end of a scan, also of a stopped one."""
        return

    @property
    def ignored(self) -> Mapping[str, int]:
        """How much of the received data was no measurement, by kind, since the first `open`."""
        return {}

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed about the measurements, such as a unit, in sentences."""
        return ()

    @property
    def diagnosis(self) -> str:
        """Clause for the error if no measurement arrives: what arrived instead, and what to do."""
        return "check that the device is powered and sends measurements"


_MOST_AT_ONCE = 100_000  # measurements of one read


@contextmanager
def guarded(url: str, origin: str) -> Iterator[None]:
    """Raise DeviceError for any error that a plug-in must not raise. `origin` names the plug-in and its package."""
    try:
        yield
    except SonarError:
        raise
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt) and threading.current_thread() is threading.main_thread():
            raise
        raise DeviceError(
            f"{url}: the plug-in {origin} has a defect: {_described(error)}; report it to its author"
        ) from error


def _described(error: BaseException) -> str:
    try:
        return f"{type(error).__name__}: {error}".partition("\n")[0]
    except Exception:  # noqa: BLE001 - the text of an error is code of the plug-in too
        return type(error).__name__


class CheckedPlugin:
    """Calls a plug-in and checks what it returns. An error that a plug-in must not raise becomes a DeviceError.

    A measurement that a log cannot hold is skipped, and counted in `ignored`.
    """

    def __init__(self, plugin: DevicePlugin, origin: str | None = None) -> None:
        """`origin` names the plug-in and its package."""
        self.url = plugin.url
        self.takes_orders = bool(plugin.takes_orders)
        self._plugin = plugin
        self._origin = origin or f"{type(plugin).__module__}:{type(plugin).__qualname__}"
        self._skipped = Counter[str]()  # measurements, by kind
        self._bytes = bytearray()  # of the present read
        plugin.on_bytes = self._bytes.extend

    def open(self) -> None:
        """Open the link of the device. Raises LinkError."""
        with self._guarded():
            self._plugin.open()

    def close(self) -> None:
        """Close the link."""
        with self._guarded():
            self._plugin.close()

    def read(self) -> tuple[bytes, tuple[Measurement, ...]]:
        """Return new bytes and measurements. Raises LinkLost."""
        with self._guarded():
            items = [*islice(self._plugin.read(), _MOST_AT_ONCE + 1)]
            if len(items) > _MOST_AT_ONCE:
                raise ValueError(f"a read of more than {_MOST_AT_ONCE} measurements")
        data = bytes(self._bytes)
        self._bytes.clear()
        faults = [_fault_of(item) for item in items]
        self._skipped.update(fault for fault in faults if fault is not None)
        return data, tuple(_as_numbers(item) for item, fault in zip(items, faults, strict=True) if fault is None)

    def begin(self, order: ScanOrder) -> bool:
        """Begin a scan. Return whether measurements of the last two seconds may belong to it."""
        with self._guarded():
            return bool(self._plugin.begin(order))

    def end(self) -> None:
        """End the scan."""
        with self._guarded():
            self._plugin.end()

    @property
    def identity(self) -> DeviceIdentity:
        """Identity of the device, with texts that fit into Info."""
        with self._guarded():
            stated = self._plugin.identity
            return DeviceIdentity(*(start_of(text, MAX_TEXT) for text in (stated.name, stated.serial, stated.board)))

    @property
    def ignored(self) -> dict[str, int]:
        """How much of the received data was no measurement, by kind."""
        counts = dict(self._skipped)
        try:
            with self._guarded():
                counts |= {str(kind): int(count) for kind, count in self._plugin.ignored.items()}
        except SonarError as error:  # the readings are whole without these counts
            counts[f"unknown ({error})"] = 1
        return counts

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed about the measurements."""
        with self._guarded():
            return tuple(map(str, self._plugin.notes))

    def no_reading(self, when: str) -> NoAnswer:
        """Return the error for a device that sends no measurement, with what arrived instead."""
        skipped = ", ".join(f"{kind} ({count})" for kind, count in self._skipped.items())
        if skipped:
            return NoAnswer(f"{self.url}: no reading {when}; the plug-in {self._origin} returns {skipped}")
        with self._guarded():
            return NoAnswer(f"{self.url}: no reading {when}; {self._plugin.diagnosis}")

    def _guarded(self) -> AbstractContextManager[None]:
        return guarded(self.url, self._origin)


def start_of(text: str, most: int) -> str:
    """Return the start of a text, up to `most` bytes."""
    return text.encode()[:most].decode(errors="ignore")


# the installed plug-ins, by the scheme of their URLs


GROUP = "sonarhw.devices"
# also found if the source folder is used without an installation, which has no entry points
_OWN = (EntryPoint("lines", "sonarhw.text_device:TextDevice", GROUP),)
_RESERVED = ("fake", *WITH_HOST, *KNOWN_SCHEMES)  # schemes of this package that are no plug-ins


def is_plugin(url: str) -> bool:
    """Return whether a plug-in opens this URL. Raises InputError if more than one package claims its scheme."""
    scheme = url.partition(":")[0]
    if (points := _installed().get(scheme)) is None:
        return False
    claims = [_origin_of(point) for point in points]
    if scheme in _RESERVED:
        claims.insert(0, "sonarhw itself")
    if len(claims) > 1:
        raise InputError(
            f"{url}: the scheme {scheme!r} is claimed by {' and by '.join(claims)}; uninstall the package that is not "
            "wanted"
        )
    return True


def make_plugin(url: str) -> CheckedPlugin:
    """Return the device at a URL, not yet opened. Raises InputError for an invalid URL or a plug-in without a class."""
    point = _installed()[url.partition(":")[0]][0]
    origin = _origin_of(point)
    try:
        plugin = point.load()
    except (Exception, SystemExit) as error:  # a module may raise anything when it is imported
        raise InputError(
            f"{url}: the plug-in {origin} cannot be loaded: {_described(error)}; install it again"
        ) from error
    if not (isinstance(plugin, type) and issubclass(plugin, DevicePlugin)):
        raise InputError(f"{url}: the plug-in {origin} is not a subclass of sonarhw.DevicePlugin")
    with guarded(url, origin):
        return CheckedPlugin(plugin(url), origin)


def _origin_of(point: EntryPoint) -> str:
    """Return the name of a plug-in and its package."""
    package = point.dist
    return point.value if package is None else f"{point.value} of the package {package.name} {package.version}"


def takes_orders(url: str) -> bool:
    """Return whether a scan at this URL may choose its angles, as all scanners do but devices that turn by themselves.

    Raises InputError for an invalid URL of a plug-in.
    """
    return not is_plugin(url) or make_plugin(url).takes_orders


@cache
def _installed() -> dict[str, tuple[EntryPoint, ...]]:
    """Return the plug-ins that claim each scheme. A letter is none: it is a drive of Windows."""
    points = {(point.name, point.value): point for point in (*_OWN, *entry_points(group=GROUP))}
    found: dict[str, tuple[EntryPoint, ...]] = {}
    for (name, _), point in points.items():
        if len(name) > 1:
            found[name] = (*found.get(name, ()), point)
    return found
