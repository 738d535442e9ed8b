"""Open a scanner at any URL: `open_scanner` of `sonarhw`.

To add a scheme for a device that speaks the wire protocol, add a line to SCHEMES: the function that makes the scanner
of a URL available. For any other device, write a plug-in (`sonarhw.plugins.device_plugin`).
"""

import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import TypeAlias

from sonarhw.device.replayed_log import ReplayDevice
from sonarhw.device.served import serve
from sonarhw.errors import InputError
from sonarhw.host.scanner import Scanner
from sonarhw.host.session import PATIENCE, RECONNECT, Recorder
from sonarhw.link import PortFinder
from sonarhw.log import read_log
from sonarhw.plugins.device_plugin import is_plugin, make_plugin
from sonarhw.plugins.plugin_scanner import PluginScanner
from sonarhw_compare.scanners.fake_url import LOOPBACK, SCHEME, serve_fake

Find: TypeAlias = Callable[[], str]  # returns the URL to open with pyserial now
Warn: TypeAlias = Callable[[str], None]

# by scheme: makes a scanner available until the end of the block; other URLs are opened by pyserial
SCHEMES: dict[str, Callable[[str, Warn], AbstractContextManager[Find]]] = {SCHEME: serve_fake}


def _emit(message: str) -> None:
    """Emit a Python warning."""
    warnings.warn(message, stacklevel=2)


def open_scanner(
    url: str,
    *,
    recorder: Recorder | None = None,
    patience: float = PATIENCE,
    reconnect: float = RECONNECT,
    warn: Warn = _emit,
) -> Scanner | PluginScanner:
    """Open the scanner at a URL. Close it after use, or use it as a context manager.

    The URL is a serial port (`/dev/ttyUSB0`, `COM3`), another URL that pyserial opens (`socket://HOST:PORT`), a fake
    scanner in this process (`fake:laboratory?place=bench&seed=1`), a log (`scan.mcap`), which is replayed, or a device
    that prints text (`lines:/dev/ttyUSB0?baud=9600&preset=arduino-radar`). Installed plug-ins add other schemes; their
    devices and those that print text are a `PluginScanner`. The scanner must answer within `patience` s. If it is lost
    later and comes back within `reconnect` s, its job continues. `warn` receives warnings about the room or log; by
    default they are Python warnings. Raises InputError for an invalid URL, and what `Scanner.open` raises.
    """
    if is_plugin(url):
        return PluginScanner(make_plugin(url), recorder, patience, reconnect)
    with ExitStack() as stack:
        find = stack.enter_context(resolve(url, warn))
        return Scanner.open(url, recorder, patience, reconnect, find, on_close=stack.pop_all().close)


@contextmanager
def resolve(url: str, warn: Warn = _emit) -> Iterator[Find]:
    """Yield a function that returns the URL to open with pyserial now.

    This process serves `fake:` URLs and logs until the block ends. Call the function before each opening, because a
    device may return under another name. Raises InputError for the URL of a plug-in.
    """
    if is_plugin(url):
        raise InputError(f"{url}: this device does not speak the wire protocol; `sonarhw scan` records its readings")
    available = SCHEMES.get(url.partition(":")[0])
    if available is not None:
        with available(url, warn) as find:
            yield find
    elif Path(url).suffix == ".mcap":
        with _replay(Path(url), warn) as find:
            yield find
    else:
        yield PortFinder(url)


@contextmanager
def _replay(path: Path, warn: Warn) -> Iterator[Find]:
    log = read_log(path)
    for doubt in log.doubts:
        warn(f"{path}: {doubt}")
    with serve(ReplayDevice(log), tcp=LOOPBACK) as endpoint:
        yield lambda: endpoint.url
