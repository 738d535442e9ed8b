"""The class to write for a device that does not speak the wire protocol of this project.

A package offers its class as an entry point of the group `sonarhw.devices`. The name of the entry point is the scheme
of its URLs:

    [project.entry-points."sonarhw.devices"]
    mysonar = "mysonar:MySonar"

Every command, the window and `sonarhw.open_scanner` then open `mysonar:...`. Threads, reconnection, logs, sweeps,
Stop and the state of the connection come from `Scanner`.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import ClassVar

from sonarhw.errors import DeviceError, InputError, NoAnswer, SonarError
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

    @property
    def is_possible(self) -> bool:
        """Whether all numbers are finite and fit into the frames of a log."""
        time, temperature = self.time or 0.0, self.temperature_c or 0.0
        fits = abs(self.angle) <= MOST_ANGLE and abs(temperature) <= MOST_TEMPERATURE and abs(time) <= _MOST_TIME
        return fits and all(map(math.isfinite, self.ranges))


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
    def diagnosis(self) -> str:
        """Clause for the error if no measurement arrives: what arrived instead, and what to do."""
        return "check that the device is powered and sends measurements"


@contextmanager
def guarded(url: str) -> Iterator[None]:
    """Raise DeviceError for any error that a plug-in must not raise."""
    try:
        yield
    except SonarError:
        raise
    except (Exception, SystemExit) as error:
        what = f"{type(error).__name__}: {error}"
        raise DeviceError(f"{url}: the plug-in has a defect: {what}; report it to its author") from error


class CheckedPlugin:
    """Calls a plug-in and checks what it returns. An error that a plug-in must not raise becomes a DeviceError."""

    def __init__(self, plugin: DevicePlugin) -> None:
        self.url = plugin.url
        self.takes_orders = bool(plugin.takes_orders)
        self._plugin = plugin
        self._bytes = bytearray()  # of the present read
        plugin.on_bytes = self._bytes.extend

    def open(self) -> None:
        """Open the link of the device. Raises LinkError."""
        with guarded(self.url):
            self._plugin.open()

    def close(self) -> None:
        """Close the link."""
        with guarded(self.url):
            self._plugin.close()

    def read(self) -> tuple[bytes, tuple[Measurement, ...]]:
        """Return new bytes and measurements. Raises LinkLost."""
        with guarded(self.url):
            measurements = tuple(self._plugin.read())
            if not all(isinstance(item, Measurement) and item.is_possible for item in measurements):
                limits = f"an angle within {MOST_ANGLE:g} rad and a temperature within {MOST_TEMPERATURE:g} °C"
                raise ValueError(f"{[*measurements]}: expected finite numbers, {limits}")
        data = bytes(self._bytes)
        self._bytes.clear()
        return data, measurements

    def begin(self, order: ScanOrder) -> bool:
        """Begin a scan. Return whether measurements of the last two seconds may belong to it."""
        with guarded(self.url):
            return bool(self._plugin.begin(order))

    def end(self) -> None:
        """End the scan."""
        with guarded(self.url):
            self._plugin.end()

    @property
    def identity(self) -> DeviceIdentity:
        """Identity of the device, with texts that fit into Info."""
        with guarded(self.url):
            stated = self._plugin.identity
            return DeviceIdentity(*(start_of(text, MAX_TEXT) for text in (stated.name, stated.serial, stated.board)))

    @property
    def ignored(self) -> dict[str, int]:
        """How much of the received data was no measurement, by kind."""
        with guarded(self.url):
            return {str(kind): int(count) for kind, count in self._plugin.ignored.items()}

    def no_reading(self, when: str) -> NoAnswer:
        """Return the error for a device that sends no measurement, with what arrived instead."""
        with guarded(self.url):
            return NoAnswer(f"{self.url}: no reading {when}; {self._plugin.diagnosis}")


def start_of(text: str, most: int) -> str:
    """Return the start of a text, up to `most` bytes."""
    return text.encode()[:most].decode(errors="ignore")


# the installed plug-ins, by the scheme of their URLs


GROUP = "sonarhw.devices"
# also found if the source folder is used without an installation, which has no entry points
_OWN = (EntryPoint("lines", "sonarhw.text_device:TextDevice", GROUP),)


def is_plugin(url: str) -> bool:
    """Return whether a plug-in opens this URL."""
    return url.partition(":")[0] in _installed()


def make_plugin(url: str) -> CheckedPlugin:
    """Return the device at a URL, not yet opened. Raises InputError for an invalid URL or a plug-in without a class."""
    point = _installed()[url.partition(":")[0]]
    try:
        plugin = point.load()
    except (ImportError, AttributeError) as error:
        raise InputError(f"{url}: the plug-in {point.value} cannot be loaded: {error}; install it again") from error
    if not (isinstance(plugin, type) and issubclass(plugin, DevicePlugin)):
        raise InputError(f"{url}: the plug-in {point.value} is not a subclass of sonarhw.DevicePlugin")
    with guarded(url):
        return CheckedPlugin(plugin(url))


def takes_orders(url: str) -> bool:
    """Return whether a scan at this URL may choose its angles, as all scanners do but devices that turn by themselves.

    Raises InputError for an invalid URL of a plug-in.
    """
    return not is_plugin(url) or make_plugin(url).takes_orders


@cache
def _installed() -> dict[str, EntryPoint]:
    # a package must not replace the schemes of this one
    return {point.name: point for point in (*entry_points(group=GROUP), *_OWN)}
