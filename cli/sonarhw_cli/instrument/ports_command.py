"""`sonarhw ports`: list the serial ports of this computer, and the scanners that answer there."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from sonarhw_cli.console.lines import print_json, print_line, print_note
from sonarhw_cli.console.options import AsJson

if TYPE_CHECKING:
    from sonarhw.link.ports import Port


def ports(
    ask: Annotated[
        bool, typer.Option("--ask", help="Check every port for a scanner, not only those with known USB ids.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """List serial ports and check them for a scanner. The check may reset the device at a port."""
    from sonarhw.link.ports import serial_ports

    found = serial_ports()
    if not found:
        print_note("no serial ports")
    listed = []
    for port in found:
        listed.append(_checked(port, ask))
        if not as_json:
            answer = listed[-1]["answer"] or "not checked; --ask checks all"
            print_line(f"{port.device}  {port.known or port.description}  {answer}")
    if as_json:
        print_json({"ports": listed})


def _checked(port: "Port", ask: bool) -> dict[str, Any]:
    """Return a port under the keys of `ports --json`; `scanner` and `answer` are None if it was not checked."""
    from sonarhw.host.port_probe import probe_port

    scanner, answer = probe_port(port.device) if ask or port.known else (None, None)
    usb = port.usb
    return {
        "url": port.device,
        "description": port.description,
        "known_as": port.known,
        "usb_id": None if usb is None else f"{usb.vendor:04x}:{usb.product:04x}",
        "usb_serial": None if usb is None else usb.serial_number,
        "scanner": scanner,
        "answer": answer,
    }
