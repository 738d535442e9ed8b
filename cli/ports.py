"""`sonarhw ports`: the serial ports of this machine, and behind which of them a scanner answers."""

from typing import Annotated

import typer

from cli.interruption import sigterm_raises
from sonarhw.errors import SonarError

# who makes the USB ends of boards that may be scanners
KNOWN_USB_VENDORS = {
    0x0403: "FTDI",
    0x10C4: "Silicon Labs",
    0x16C0: "PJRC",
    0x1A86: "WCH",
    0x2341: "Arduino",
    0x2A03: "Arduino",
    0x2E8A: "Raspberry Pi",
}
_PATIENCE = 2.5  # s; a board that its opened port has reset needs some


def ports(
    ask: Annotated[bool, typer.Option("--ask", help="Ask every port, not only those with known USB ids.")] = False,
) -> None:
    """List serial ports and whether a scanner answers there."""
    from serial.tools.list_ports import comports

    found = sorted(comports())
    if not found:
        typer.echo("no serial ports", err=True)
    with sigterm_raises():
        for port in found:
            answer = _answer(port.device) if ask or port.vid in KNOWN_USB_VENDORS else "not asked"
            typer.echo(f"{port.device}  {port.description}  {answer}")


def _answer(device: str) -> str:
    from sonarhw.scanner import Scanner

    try:
        with Scanner.open(device, patience=_PATIENCE) as scanner:
            return f"scanner {scanner.info.serial}, {scanner.info.firmware}"
    except SonarError as error:
        return f"no scanner: {str(error).removeprefix(f'{device}: ')}"
