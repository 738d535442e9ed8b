"""`sonarhw flash`: write the prebuilt firmware to a board."""

from typing import Annotated

import typer

from sonarhw.bringup import Combination, Controller, Ranging, Turning
from sonarhw.errors import InputError
from sonarhw_cli.console.lines import print_line, print_note

FlashedPort = Annotated[str, typer.Argument(help="Serial port of the board, such as /dev/ttyACM0.", metavar="PORT")]
ControllerChoice = Annotated[
    Controller | None, typer.Option(help="Controller of the board; default: the one that is recognised.")
]
RangingChoice = Annotated[
    Ranging | None, typer.Option(help=f"Ranging board; default: as the board answers, else {Ranging.POLAROID}.")
]
TurningChoice = Annotated[
    Turning | None, typer.Option(help=f"Turntable; default: as the board answers, else {Turning.STEP_DIR}.")
]
ForceUnknown = Annotated[
    bool, typer.Option("--force", help="Also flash a board that is not recognised; needs --controller.")
]


def flash(
    port: FlashedPort,
    controller: ControllerChoice = None,
    ranging: RangingChoice = None,
    turning: TurningChoice = None,
    force: ForceUnknown = False,
) -> None:
    """Write the firmware to a board, and verify it.

    avrdude writes the firmware that comes with sonarhw. Then the identity that the board answers is printed. A board is
    recognised by its USB identity, or by a scanner firmware that runs on it. No compiler is needed. A Nano with a new
    bootloader is flashed as an Uno.
    """
    from sonarhw import bringup

    if "://" in port or ":" in port.removeprefix("COM"):
        raise InputError(f"{port}: expected a serial port such as /dev/ttyACM0")
    if force and controller is None:
        raise InputError("--force: also give --controller")
    if controller and ranging and turning:
        Combination(controller, ranging, turning)  # refused before the port is opened
    bringup.find_avrdude()
    found = bringup.find_board(port)
    wanted = Combination(
        controller if controller and force else _recognised(port, found.controller, controller),
        ranging or found.ranging(),
        turning or found.turning(),
    )
    print_note(f"{port}: writing the firmware {wanted.image}; this takes about 20 s")
    bringup.write_firmware(port, wanted)
    info = bringup.ask_identity(port, wanted)
    print_line(f"{port}: {info.firmware}, protocol {info.protocol[0]}.{info.protocol[1]}, {info.serial}")


def _recognised(port: str, found: Controller | None, wanted: Controller | None) -> Controller:
    """Return the controller to flash. Raises InputError if none is `found`, or not the `wanted` one."""
    from sonarhw.bringup import same_chip

    if found and wanted and same_chip(found, wanted):
        return wanted
    if found is None or wanted:
        what = "is not recognised" if found is None else f"has the controller {found}, not {wanted}"
        raise InputError(f"{port}: the board {what}; if you are sure, add --force and --controller")
    return found
