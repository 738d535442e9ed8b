"""The class to write for a device that does not speak the wire protocol of this project.

A package offers its class as an entry point of the group `sonarhw.devices`. The name of the entry point is the scheme
of its URLs:

    [project.entry-points."sonarhw.devices"]
    mysonar = "mysonar:MySonar"

Every command, the window and `sonarhw.open_scanner` then open `mysonar:...`. Threads, reconnection, logs, sweeps,
Stop and the state of the connection come from `Scanner`.
"""

import ctypes
import math
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import weakref
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from itertools import islice
from queue import Empty, SimpleQueue
from typing import Any, BinaryIO, ClassVar, Self, TypeVar

from sonarhw.errors import CommandRefused, DeviceError, InputError, LinkError, MissingExtra, NoAnswer, SonarError
from sonarhw.link import KNOWN_SCHEMES, WITH_HOST
from sonarhw.readings import ScanOrder
from sonarhw.wire.limits import MAX_TEXT
from sonarhw.wire.messages import MOST_DEGREES

MOST_ANGLE = math.radians(MOST_DEGREES)
LEAST_TEMPERATURE, MOST_TEMPERATURE = -100.0, 327.0  # °C; of air, and of what a frame can hold
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
        if not LEAST_TEMPERATURE <= (item.temperature_c or 0.0) <= MOST_TEMPERATURE:
            limits = f"{LEAST_TEMPERATURE:g} to {MOST_TEMPERATURE:g} °C"
            return f"measurements with a temperature outside {limits}, or not finite"
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
    """A device at a URL, in a process of its own. `open`, `begin`, `read`, `end` and `close` are called in turn.

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
        raise _defect(url, origin, error) from error


def _defect(url: str, origin: str, error: BaseException) -> DeviceError:
    return DeviceError(f"{url}: the plug-in {origin} has a defect: {_described(error)}; report it to its author")


def _described(error: BaseException) -> str:
    return f"{type(error).__name__}: {_text_of(error)}".partition("\n")[0]


def _text_of(error: BaseException) -> str:
    try:
        return str(error)
    except Exception:  # noqa: BLE001 - the text of an error is code of the plug-in too
        return ""


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
        try:
            with self._guarded():
                return tuple(map(str, self._plugin.notes))
        except SonarError as error:  # the readings are whole without these notes
            return (f"unknown notes ({error})",)

    @property
    def diagnosis(self) -> str:
        """Clause for the error if no measurement arrives: what arrived instead."""
        if skipped := ", ".join(f"{kind} ({count})" for kind, count in self._skipped.items()):
            return f"the plug-in {self._origin} returns {skipped}"
        with self._guarded():
            return str(self._plugin.diagnosis)

    def no_reading(self, when: str) -> NoAnswer:
        """Return the error for a device that sends no measurement, with what arrived instead."""
        return NoAnswer(f"{self.url}: no reading {when}; {self.diagnosis}")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """End the process of the plug-in, if it has one. A second call does nothing."""
        if isinstance(self._plugin, _PluginApart):
            self._plugin.stop()

    def _guarded(self) -> AbstractContextManager[None]:
        return guarded(self.url, self._origin)


def start_of(text: str, most: int) -> str:
    """Return the start of a text, up to `most` bytes."""
    return text.encode()[:most].decode(errors="ignore")


# Plug-ins of other packages run in processes of their own. Native code that does not return, or crashes, then cannot
# hold this process and its recording.


_RUN = "import sys; sys.path[:], sys.argv[:] = {!r}, {!r}; from {} import serve_plugin; serve_plugin()"
_END_WITHIN = 0.4  # s for the end of a process, once its plug-in is closed
_HANGS = 1.0  # s; a longer call is stated in the diagnosis
_PR_SET_PDEATHSIG = 1  # of Linux


@dataclass(frozen=True)
class _Stated:
    """What a plug-in states of itself after a call, or the errors that this raises."""

    takes_orders: bool
    identity: DeviceIdentity | SonarError
    ignored: dict[str, int] | SonarError
    notes: tuple[str, ...] | SonarError
    diagnosis: str | SonarError


_Call = tuple[int, str, tuple[Any, ...]]  # number, name and arguments
_Answer = tuple[int, Any, _Stated | None]  # number, result or error, what is stated


class _PluginApart(DevicePlugin):
    """A plug-in in a process of its own. One thread calls it at a time; what it states of itself is never awaited."""

    def __init__(self, url: str, value: str, origin: str) -> None:
        """Load the class at the entry point `value`. Raises what `_loaded` raises."""
        super().__init__(url)
        self._making, self._origin = (url, value, origin), origin
        self._number = 0  # of the newest call
        self._stated: _Stated
        self._calling: tuple[str, float] | None = None  # name of the call that runs, and when it began, s
        self._start()

    def _start(self) -> None:
        self._answers = SimpleQueue[_Answer | None]()
        started = SimpleQueue["subprocess.Popen[bytes] | OSError"]()
        threading.Thread(target=_listen, args=(started, self._answers), name=f"plug-in {self.url}", daemon=True).start()
        process = started.get()
        if isinstance(process, OSError):
            raise LinkError(f"{self.url}: no process for the plug-in {self._origin}: {process}") from process
        self._process = process
        self._end = weakref.finalize(self, _end, process)
        try:
            self._call("make", *self._making)
        except BaseException:
            self.stop()
            raise

    def _call(self, name: str, *arguments: Any, within: float | None = None) -> Any:
        """Return what a method of the plug-in returns. Raises what it raises, and DeviceError if its process ends.

        Raises Empty without an answer `within` s.
        """
        self._number += 1
        self._calling = name, time.monotonic()
        assert self._process.stdin is not None
        with suppress(OSError, ValueError):  # it has ended, or is stopped
            pickle.dump((self._number, name, arguments), self._process.stdin)
            self._process.stdin.flush()
        answer = self._answers.get(timeout=within)
        while answer is not None and answer[0] != self._number:  # of a call whose caller was interrupted
            answer = self._answers.get(timeout=within)
        if answer is None:
            self._answers.put(None)
            raise DeviceError(f"{self.url}: the plug-in {self._origin} ended its process during {name!r}")
        self._calling = None
        _, result, stated = answer
        if stated is not None:
            self._stated = stated
        return _result(result)

    def open(self) -> None:
        """Open the link, in a new process if the last one has ended."""
        if self._process.poll() is not None:
            self.stop()
            self._start()
        self._call("open")

    def read(self) -> list[Measurement]:
        """Return the new measurements."""
        data, measurements = self._call("read")
        if data:
            self.on_bytes(data)
        return list(measurements)

    def begin(self, order: ScanOrder) -> bool:
        """Begin a scan."""
        return bool(self._call("begin", order))

    def end(self) -> None:
        """End the scan."""
        self._call("end")

    def close(self) -> None:
        """Close the link. If the caller of another call was interrupted, this one may not be answered."""
        if self._calling is None:
            self._call("close")
        else:
            with suppress(DeviceError, Empty):
                self._call("close", within=_HANGS)

    def stop(self) -> None:
        """End the process."""
        self._end()

    @property
    def takes_orders(self) -> bool:  # type: ignore[override]  # of the class there, of the object here
        """Whether it measures at ordered angles."""
        return self._stated.takes_orders

    @property
    def identity(self) -> DeviceIdentity:
        """The identity after the newest `open`."""
        return _result(self._stated.identity)

    @property
    def ignored(self) -> Mapping[str, int]:
        """What was no measurement."""
        return _result(self._stated.ignored)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed."""
        return _result(self._stated.notes)

    @property
    def diagnosis(self) -> str:
        """What arrived instead of measurements, or which call does not return."""
        calling = self._calling
        if calling and time.monotonic() - calling[1] > _HANGS:
            return f"the plug-in {self._origin} does not return from {calling[0]!r}"
        return _result(self._stated.diagnosis)


T = TypeVar("T")


def _result(result: T | SonarError) -> T:
    if isinstance(result, SonarError):
        raise result
    return result


def _listen(started: "SimpleQueue[subprocess.Popen[bytes] | OSError]", answers: "SimpleQueue[_Answer | None]") -> None:
    """Start the process of a plug-in, and pass its answers on; None is the last one.

    Linux kills the process when the thread that started it ends, which this one therefore does last.
    """
    hidden: dict[str, Any] = {"start_new_session": True}  # Ctrl-C in a terminal reaches this process only
    if sys.platform == "win32":
        hidden = {"creationflags": subprocess.CREATE_NO_WINDOW}
    code = _RUN.format(sys.path, sys.argv, __name__)
    pipe = subprocess.PIPE
    try:
        process = subprocess.Popen([sys.executable, "-c", code], stdin=pipe, stdout=pipe, **hidden)
    except OSError as error:
        started.put(error)
        return
    started.put(process)
    assert process.stdout is not None
    with process.stdout, suppress(EOFError, OSError, pickle.UnpicklingError):
        while True:
            answers.put(pickle.load(process.stdout))
    process.wait()
    answers.put(None)


def _end(process: "subprocess.Popen[bytes]") -> None:
    assert process.stdin is not None
    with suppress(OSError):
        process.stdin.close()
    with suppress(subprocess.TimeoutExpired):
        process.wait(_END_WITHIN)
    if sys.platform == "win32":
        process.kill()
    else:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)  # what the plug-in has started too


def serve_plugin() -> None:
    """Answer the calls that arrive at standard input, in this process. What a plug-in prints goes to standard error."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    calls, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)
    received = SimpleQueue[_Call | None]()
    threading.Thread(target=_receive, args=(calls, received), daemon=True).start()
    with suppress(BrokenPipeError):  # the process that calls has ended
        _serve(received, answers)


def _serve(received: "SimpleQueue[_Call | None]", answers: BinaryIO) -> None:
    plugin: CheckedPlugin | None = None
    stated: _Stated | None = None
    url = origin = ""
    while call := received.get():
        (number, name, arguments), result = call, None
        try:
            if name == "make":
                url, _, origin = arguments
                plugin = _loaded(*arguments)
            else:
                result = getattr(plugin, name)(*arguments)
        except BaseException as error:  # noqa: BLE001 - raised again by the process that calls
            result = _plain(error, url, origin)
        before = stated
        if plugin is not None:
            stated = _statements(plugin, origin, before.identity if before and name != "open" else None)
        pickle.dump((number, result, None if stated == before else stated), answers)
        answers.flush()


def _statements(plugin: CheckedPlugin, origin: str, identity: DeviceIdentity | SonarError | None) -> _Stated:
    """Return what a plug-in states, with this identity unless it is None."""

    def stated(name: str) -> Any:
        try:
            return getattr(plugin, name)
        except BaseException as error:  # noqa: BLE001 - raised again where it is used
            return _plain(error, plugin.url, origin)

    identity = stated("identity") if identity is None else identity
    return _Stated(plugin.takes_orders, identity, stated("ignored"), stated("notes"), stated("diagnosis"))


def _plain(error: BaseException, url: str, origin: str) -> SonarError:
    """Return an error of this package with the text of an error: the process that calls has no other classes."""
    if not isinstance(error, SonarError):
        return _defect(url, origin, error)
    kinds = (kind for kind in type(error).__mro__ if issubclass(kind, SonarError))
    # these two take more than a text
    plain = next(k for k in kinds if k.__module__ == SonarError.__module__ and k not in (CommandRefused, MissingExtra))
    return plain(_text_of(error))


def _receive(calls: BinaryIO, received: "SimpleQueue[_Call | None]") -> None:
    """Pass calls on. End this process at their end, also if the plug-in does not return."""
    with suppress(EOFError):
        while True:
            received.put(pickle.load(calls))
    received.put(None)
    time.sleep(_END_WITHIN)
    os._exit(0)


# the installed plug-ins, by the scheme of their URLs


GROUP = "sonarhw.devices"
# also found if the source folder is used without an installation, which has no entry points
OWN = (EntryPoint("lines", "sonarhw.text_device:TextDevice", GROUP),)
_RESERVED = ("fake", *WITH_HOST, *KNOWN_SCHEMES)  # schemes of this package that are no plug-ins


def is_plugin(url: str) -> bool:
    """Return whether a plug-in opens this URL. Raises InputError if more than one package claims its scheme."""
    scheme = url.partition(":")[0]
    if (points := installed_plugins().get(scheme)) is None:
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
    point = installed_plugins()[url.partition(":")[0]][0]
    origin = _origin_of(point)
    if point.value == OWN[0].value:
        return _loaded(url, point.value, origin)
    return CheckedPlugin(_PluginApart(url, point.value, origin), origin)


def _loaded(url: str, value: str, origin: str) -> CheckedPlugin:
    """Return the device of the class at the entry point `value`."""
    try:
        plugin = EntryPoint("", value, GROUP).load()
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
    if not is_plugin(url):
        return True
    with make_plugin(url) as plugin:
        return plugin.takes_orders


@cache
def installed_plugins() -> dict[str, tuple[EntryPoint, ...]]:
    """Return the plug-ins that claim each scheme. A letter is none: it is a drive of Windows."""
    points = {(point.name, point.value): point for point in (*OWN, *entry_points(group=GROUP))}
    found: dict[str, tuple[EntryPoint, ...]] = {}
    for (name, _), point in points.items():
        if len(name) > 1:
            found[name] = (*found.get(name, ()), point)
    return found
