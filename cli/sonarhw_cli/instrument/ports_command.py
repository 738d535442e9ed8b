"""`sonarhw ports`: the serial ports of this machine, and behind which of them a scanner answers."""

from typing import Annotated

import typer

from sonarhw_cli.console.interruption import sigterm_raises


def ports(
    ask: Annotated[bool, typer.Option("--ask", help="Ask every port, not only those with known USB ids.")] = False,
) -> None:
    """List serial ports and whether a scanner answers there; asking may reset whatever hangs on a port."""
    from sonarhw.host.port_probe import probe_port
    from sonarhw.link.ports import serial_ports

    found = serial_ports()
    if not found:
        typer.echo("no serial ports", err=True)
    with sigterm_raises():
        for port in found:
            answer = probe_port(port.device)[1] if ask or port.known else "not asked; --ask asks all"
            typer.echo(f"{port.device}  {port.known or port.description}  {answer}")
