"""Write the prebuilt firmware to a board with avrdude, and ask the board who it is afterwards.

`make -C firmware images` builds `images/*.hex`; a test compares them with a fresh build.
"""

import shutil
import subprocess
from dataclasses import dataclass
from importlib.resources import as_file, files

from sonarhw.bringup.controllers import Combination, Controller, Ranging
from sonarhw.errors import DeviceError, InputError, SonarError
from sonarhw.host.device_info import DeviceInfo
from sonarhw.host.scanner import Scanner
from sonarhw.link.ports import serial_ports

PATIENCE = 5.0  # s for the greeting of a board before it is flashed
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


def recognised(port: str) -> Controller | None:
    """Return the controller at a serial port, by its USB identity or else by the firmware that runs on it.

    None if it is neither a known board nor a scanner. Raises LinkError if the port cannot be opened.
    """
    known = next((one.known for one in serial_ports() if one.device == port), None)
    for controller, target in _TARGETS.items():
        if known is not None and known == target.usb_name:
            return controller
    firmware = _firmware(port)
    return next((one for one, target in _TARGETS.items() if firmware.startswith(target.firmware)), None)


def same_chip(one: Controller, other: Controller) -> bool:
    """Return whether two controllers run the same images."""
    return _TARGETS[one].part == _TARGETS[other].part


def _firmware(port: str) -> str:
    """Return the name of the firmware at a port; empty if it does not answer as a scanner."""
    try:
        with Scanner.open(port, patience=PATIENCE) as scanner:
            return scanner.info.firmware
    except DeviceError:
        return ""


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
