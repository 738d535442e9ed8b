"""`sonarhw ports`: list the serial ports of this computer, and the scanners that answer there."""

from typing import Annotated

import typer

from sonarhw_cli.console.interruption import sigterm_raises


def ports(
    ask: Annotated[
        bool, typer.Option("--ask", help="Check every port for a scanner, not only those with known USB ids.")
    ] = False,
) -> None:
    """List serial ports and check them for a scanner. The check may reset the device at a port."""
    from sonarhw.host.port_probe import probe_port
    from sonarhw.link.ports import serial_ports

    found = serial_ports()
    if not found:
        typer.echo("no serial ports", err=True)
    with sigterm_raises():
        for port in found:
            answer = probe_port(port.device)[1] if ask or port.known else "not checked; --ask checks all"
            typer.echo(f"{port.device}  {port.known or port.description}  {answer}")
