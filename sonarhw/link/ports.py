"""The serial ports of this machine, the USB devices behind them, and the processes that use them.

The functions do not open ports.
"""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from serial.tools.list_ports import comports

from sonarhw.errors import LinkError

# by vendor and product: USB adapters and boards that scanners use
KNOWN_USB_IDS = {
    (0x2341, 0x0010): "Arduino Mega 2560",
    (0x2341, 0x0042): "Arduino Mega 2560",
    (0x2341, 0x0242): "Arduino Mega 2560",
    (0x2A03, 0x0010): "Arduino Mega 2560",
    (0x2A03, 0x0042): "Arduino Mega 2560",
    (0x2341, 0x0001): "Arduino Uno",
    (0x2341, 0x0043): "Arduino Uno",
    (0x2341, 0x0243): "Arduino Uno",
    (0x2A03, 0x0043): "Arduino Uno",
    (0x1A86, 0x7523): "WCH CH340",
    (0x1A86, 0x55D4): "WCH CH9102",
    (0x0403, 0x6001): "FTDI FT232R",
    (0x0403, 0x6015): "FTDI FT231X",
    (0x10C4, 0xEA60): "Silicon Labs CP210x",
    (0x16C0, 0x0483): "PJRC Teensy",
    (0x2E8A, 0x000A): "Raspberry Pi Pico",
}
_PROCESSES = Path("/proc")
_TERMINALS = "/dev/pts/"


@dataclass(frozen=True)
class Usb:
    """The identity of a USB serial device, independent of the name of its port."""

    vendor: int
    product: int
    serial_number: str | None
    location: str | None  # USB socket


@dataclass(frozen=True)
class Port:
    """A serial port."""

    device: str
    description: str
    usb: Usb | None = None  # None: not a USB device

    @property
    def known(self) -> str | None:
        """Name of the USB adapter or board, if scanners use this type; otherwise None."""
        return KNOWN_USB_IDS.get((self.usb.vendor, self.usb.product)) if self.usb else None


def serial_ports() -> list[Port]:
    """Return all serial ports, sorted by name."""
    return [
        Port(
            port.device,
            port.description,
            None if port.vid is None else Usb(port.vid, port.pid, port.serial_number, port.location),
        )
        for port in sorted(comports())
    ]


class PortFinder:
    """Finds the current port of a USB device, also after the name of its port has changed."""

    def __init__(self, url: str) -> None:
        """Remember the device at `url`. A URL with a scheme, such as `socket://`, never changes."""
        self._url = url
        self._usb: Usb | None = None
        self._created: int | None = None  # ns since the epoch, of a pseudo-terminal

    def __call__(self) -> str:
        """Return the present URL of the device. Raises LinkError if another program now has the pseudo-terminal."""
        if "://" in self._url:
            return self._url
        self._check_same_terminal()
        ports = serial_ports()
        here = _usb_of(self._url, ports)
        if here or os.path.exists(self._url) or not self._usb:
            self._usb = here or self._usb
            return self._url
        return find_port(self._usb, ports) or self._url

    def _check_same_terminal(self) -> None:
        """The system gives the number of a closed pseudo-terminal to the next program that opens one."""
        if not self._url.startswith(_TERMINALS):
            return
        try:
            created = os.stat(self._url).st_ctime_ns
        except FileNotFoundError:
            return
        if self._created not in (None, created):
            raise LinkError(f"{self._url}: the pseudo-terminal is gone, and another program has its number now")
        self._created = created


def _usb_of(device: str, ports: list[Port]) -> Usb | None:
    """Return the USB device behind the name of a port or a symbolic link to it. None if there is none."""
    real = os.path.realpath(device)
    return next((port.usb for port in ports if os.path.realpath(port.device) == real), None)


def find_port(usb: Usb, ports: list[Port]) -> str | None:
    """Return the current port of a USB device, or None.

    A device without a serial number is identified by vendor, product and USB socket.
    """
    alike = [port for port in ports if port.usb and (port.usb.vendor, port.usb.product) == (usb.vendor, usb.product)]
    if usb.serial_number:
        alike = [port for port in alike if port.usb and port.usb.serial_number == usb.serial_number]
    else:
        alike = [port for port in alike if port.usb and port.usb.location == usb.location] or alike
    # None for several candidates, because one of them may be another scanner
    return alike[0].device if len(alike) == 1 else None


def holders(device: str) -> list[str]:
    """Return name and number of each process that has a port open, if the system shows them.

    If this process is the only one, the list contains "this program".
    """
    real = os.path.realpath(device)
    processes = {process for process, path in _open_files() if path == real}
    others = sorted(_named(process) for process in processes if int(process.name) != os.getpid())
    return others or ["this program"] * bool(processes)


def _open_files() -> Iterator[tuple[Path, str]]:
    if not _PROCESSES.is_dir():
        return
    for process in _PROCESSES.iterdir():
        if process.name.isdecimal():
            yield from ((process, path) for path in _opened_by(process))


def _opened_by(process: Path) -> list[str]:
    paths = []
    try:
        for descriptor in (process / "fd").iterdir():
            paths.append(os.readlink(descriptor))  # noqa: PERF401 - paths read before an error are kept
    except OSError:  # the process has ended, or belongs to another user
        pass
    return paths


def _named(process: Path) -> str:
    try:
        name = (process / "comm").read_text().strip()
    except OSError:
        name = "a process"
    return f"{name} ({process.name})"
