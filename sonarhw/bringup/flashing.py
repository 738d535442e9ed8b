"""Write the prebuilt firmware to a board with avrdude, and ask the board who it is afterwards.

`make -C firmware images` builds `images/*.hex`; a test compares them with a fresh build.
"""

import shutil
import subprocess
from dataclasses import dataclass
from importlib.resources import as_file, files
from typing import TypeVar

from sonarhw.bringup.controllers import Combination, Controller, Ranging, Turning
from sonarhw.errors import DeviceError, InputError, SonarError
from sonarhw.host.device_info import DeviceInfo
from sonarhw.host.scanner import Scanner
from sonarhw.link.ports import serial_ports

PATIENCE = 5.0  # s for the greeting of a board before it is flashed
_Part = TypeVar("_Part", Ranging, Turning)
_LINES = 3  # of avrdude's output that an error contains


@dataclass(frozen=True)
class _Target:
    """How avrdude reaches a controller, and how the controller is recognised."""

    usb_name: str | None  # in KNOWN_USB_IDS; None: the board has the USB chip of many others
    firmware: str  # begin of the name in Info
    part: str
    programmer: str
    baud: int


_TARGETS = {
    Controller.MEGA: _Target("Arduino Mega 2560", "sonarhw-mega", "atmega2560", "wiring", 115_200),
    Controller.UNO: _Target("Arduino Uno", "sonarhw-uno", "atmega328p", "arduino", 115_200),
    Controller.NANO: _Target(None, "sonarhw-uno", "atmega328p", "arduino", 57_600),  # its older bootloader
}
_PROFILES = {Ranging.POLAROID: "polaroid-6500", Ranging.HC_SR04: "hc-sr04"}


@dataclass(frozen=True)
class FoundBoard:
    """What a board says of itself before it is flashed."""

    controller: Controller | None  # None: not recognised
    profile: str  # name of its board profile; empty: unknown
    turntable: str  # what turns it; empty: unknown

    def ranging(self) -> Ranging:
        """Return its ranging board; a 6500 if unknown. Raises InputError if there is no firmware for it."""
        known = {profile: ranging for ranging, profile in _PROFILES.items()}
        return _part("`sonarhw flash PORT --ranging NAME`", self.profile, {"": Ranging.POLAROID, **known})

    def turning(self) -> Turning:
        """Return its turntable; step/direction if unknown. Raises InputError if there is no firmware for it."""
        return _part(
            "`sonarhw flash PORT --turning NAME`",
            self.turntable,
            {"": Turning.STEP_DIR, **{str(one): one for one in Turning}},
        )


def _part(command: str, said: str, known: dict[str, _Part]) -> _Part:
    if said not in known:
        raise InputError(
            f"no prebuilt firmware for {said!r}, for which the board is built; to change that, run {command}"
        )
    return known[said]


def find_board(port: str) -> FoundBoard:
    """Return what a board is: by its USB identity, and by the firmware that runs on it.

    Raises LinkError if the port cannot be opened.
    """
    info = _identity(port)
    known = next((one.known for one in serial_ports() if one.device == port), None)
    by_usb = (one for one, target in _TARGETS.items() if known is not None and known == target.usb_name)
    by_firmware = (one for one, target in _TARGETS.items() if info and info.firmware.startswith(target.firmware))
    return FoundBoard(
        next(by_usb, None) or next(by_firmware, None),
        info.board if info else "",
        info.capabilities.turning if info and info.capabilities else "",
    )


def same_chip(one: Controller, other: Controller) -> bool:
    """Return whether two controllers run the same images."""
    return _TARGETS[one].part == _TARGETS[other].part


def _identity(port: str) -> DeviceInfo | None:
    """Return the identity of the scanner at a port; None if none answers."""
    try:
        with Scanner.open(port, patience=PATIENCE) as scanner:
            return scanner.info
    except DeviceError:
        return None


def find_avrdude() -> str:
    """Return the path of avrdude. Raises InputError if it is not installed."""
    found = shutil.which("avrdude")
    if found is None:
        raise InputError(
            "avrdude: not found; install it: apt install avrdude (Debian, Ubuntu), brew install avrdude (macOS), "
            "winget install AVRDudes.AVRDUDE (Windows)"
        )
    return found


def write_firmware(port: str, combination: Combination) -> None:
    """Write the image of a combination to the flash memory of its controller and verify it. The EEPROM is unchanged.

    avrdude refuses a chip of another type. Raises InputError without avrdude, and SonarError with avrdude's last lines
    if it fails.
    """
    avrdude, target = find_avrdude(), _TARGETS[combination.controller]
    with as_file(files("sonarhw.bringup").joinpath(f"images/{combination.image}.hex")) as image:
        command = [avrdude, "-q", "-p", target.part, "-c", target.programmer, "-P", port, "-b", str(target.baud)]
        done = subprocess.run(
            [*command, "-D", "-U", f"flash:w:{image}:i"], stdin=subprocess.DEVNULL, capture_output=True, text=True
        )
    if done.returncode:
        raise SonarError(f"{port}: avrdude ends with exit status {done.returncode}: {_reason(done.stderr)}")


def _reason(printed: str) -> str:
    """Return the errors that avrdude printed, or else its last lines."""
    lines = [line.strip() for line in printed.splitlines() if line.strip()]
    errors = [line.partition("error: ")[2] for line in lines if "error: " in line and "OS error" not in line]
    return "; ".join(errors or lines[-_LINES:]) or "it prints nothing"


def ask_identity(port: str, combination: Combination) -> DeviceInfo:
    """Return the identity of a board after it was flashed. Raises DeviceError if another firmware answers."""
    with Scanner.open(port) as scanner:
        info = scanner.info
    firmware, parts = _TARGETS[combination.controller].firmware, (_PROFILES[combination.ranging], combination.turning)
    found = (info.board, info.capabilities.turning if info.capabilities else "")
    if not info.firmware.startswith(firmware) or found != parts:
        answers = f"the firmware {info.firmware!r} for {found[0]!r} and {found[1]!r} answers"
        raise DeviceError(f"{port}: {answers}; expected {firmware} for {parts[0]} and {parts[1]}; flash it again")
    return info
