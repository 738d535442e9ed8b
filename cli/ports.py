"""`sonarhw ports`: the serial ports of this machine, and behind which of them a scanner answers."""

from typing import Annotated

import typer

from cli.interruption import sigterm_raises
from sonarhw.errors import SonarError

_PATIENCE = 2.5  # s; a board that its opened port has reset needs some


def ports(
    ask: Annotated[bool, typer.Option("--ask", help="Ask every port, not only those with known USB ids.")] = False,
) -> None:
    """List serial ports and whether a scanner answers there; asking may reset whatever hangs on a port."""
    from sonarhw.ports import serial_ports

    found = serial_ports()
    if not found:
        typer.echo("no serial ports", err=True)
    with sigterm_raises():
        for port in found:
            answer = _answer(port.device) if ask or port.known else "not asked; --ask asks all"
            typer.echo(f"{port.device}  {port.known or port.description}  {answer}")


def _answer(device: str) -> str:
    from sonarhw.scanner import Scanner

    try:
        with Scanner.open(device, patience=_PATIENCE) as scanner:
            return f"scanner {scanner.info.serial}, {scanner.info.firmware}"
    except SonarError as error:
        return f"no scanner: {str(error).removeprefix(f'{device}: ')}"
