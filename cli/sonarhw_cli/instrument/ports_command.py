"""`sonarhw ports`: list the serial ports of this computer, and the scanners that answer there."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from sonarhw.errors import InputError
from sonarhw_cli.console.lines import print_json, print_line, print_note
from sonarhw_cli.console.options import AsJson

if TYPE_CHECKING:
    from sonarhw.link import Port


AskAll = Annotated[
    bool, typer.Option("--ask", help="Check every port for a scanner, not only those with known USB ids.")
]
Guess = Annotated[
    bool,
    typer.Option("--guess", help="Listen for text, and propose the URL of a device that prints readings."),
]


def ports(
    port: Annotated[list[str] | None, typer.Argument(help="Only these ports; default: all.", metavar="PORT")] = None,
    ask: AskAll = False,
    guess: Guess = False,
    as_json: AsJson = False,
) -> None:
    """List serial ports and check them for a scanner. The check may reset the device at a port."""
    from sonarhw.link import Port, serial_ports

    if ask and guess:
        raise InputError("--ask, --guess: give only one of them")
    known = {found.device: found for found in serial_ports()}
    chosen = [known.get(name, Port(name, "")) for name in port] if port else [*known.values()]
    if not chosen:
        print_note("no serial ports")
    listed = []
    for one in chosen:
        wanted = bool(ask or port or one.known)
        listed.append(_described(one) | (_guessed(one, wanted) if guess else _probed(one, wanted)))
        if not as_json:
            answer = listed[-1]["answer"] or f"not checked; {'name the port' if guess else '--ask checks all'}"
            print_line("  ".join(filter(None, (one.device, one.known or one.description, answer))))
    if as_json:
        print_json({"ports": listed})


def _described(port: "Port") -> dict[str, Any]:
    """Return a port under the keys of `ports --json`."""
    usb = port.usb
    return {
        "url": port.device,
        "description": port.description,
        "known_as": port.known,
        "usb_id": None if usb is None else f"{usb.vendor:04x}:{usb.product:04x}",
        "usb_serial": None if usb is None else usb.serial_number,
    }


def _probed(port: "Port", wanted: bool) -> dict[str, Any]:
    """Return whether a scanner answers at a port, and its answer; None if it was not checked."""
    from sonarhw.host.scanner import probe_port

    scanner, answer = probe_port(port.device) if wanted else (None, None)
    return {"scanner": scanner, "answer": answer}


def _guessed(port: "Port", wanted: bool) -> dict[str, Any]:
    """Return what the device at a port prints; None if it was not checked."""
    from sonarhw.errors import LinkError
    from sonarhw.text_device import guess_lines

    if not wanted:
        return {"answer": None, "proposed_url": None, "preset": None, "baud": None}
    try:
        found = guess_lines(port.device)
    except LinkError as error:
        answer = str(error).removeprefix(f"{port.device}: ")
        return {"answer": answer, "proposed_url": None, "preset": None, "baud": None}
    return {"answer": found.text, "proposed_url": found.url, "preset": found.preset, "baud": found.baud}
