"""`sonarhw wiring`: the levels of the inputs of a scanner, what is inverted, and its switches."""

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import InputError
from sonarhw_cli.console.connect import ScannerUrl, connect_turntable
from sonarhw_cli.console.lines import print_line

if TYPE_CHECKING:
    from collections.abc import Iterable

    from sonarhw.wire.messages import Wiring


class WiredPart(StrEnum):
    """A part that can be inverted."""

    MARK = "mark"
    CAM = "cam"
    MOTOR = "motor"


Inverted = Annotated[
    list[WiredPart] | None, typer.Option(help="Invert this switch or the direction of the motor; repeatable.")
]
NotInverted = Annotated[list[WiredPart] | None, typer.Option(help="Do not invert this part any more; repeatable.")]
OneSwitch = Annotated[
    bool | None,
    typer.Option(
        "--one-switch/--no-one-switch",
        help="Home by the mark alone, without a cam. The table then turns less than half a turn from zero. Put it "
        "within 45 degrees of zero, with the cable in its middle, before the first home.",
    ),
]


def wiring(
    url: ScannerUrl,
    invert: Inverted = None,
    normal: NotInverted = None,
    one_switch: OneSwitch = None,
) -> None:
    """Print the levels of the inputs and what is inverted. The scanner keeps what the options set.

    After a change, the next home searches the zero again.
    """
    from sonarhw.wire.messages import Input, Wiring

    wanted, plain = _wiring(invert or ()), _wiring(normal or ())
    if wanted & plain:
        raise InputError("--invert, --normal: the same part is in both; name it once")
    if one_switch is not None:
        wanted |= Wiring.ONE_SWITCH if one_switch else Wiring(0)
        plain |= Wiring.ONE_SWITCH & ~wanted
    with connect_turntable(url) as scanner:
        inverted = scanner.configure_wiring(wanted | plain, wanted)
        levels = scanner.inputs()
    for item in Input:
        level = "unknown" if levels is None else "high" if item in levels else "low"
        print_line(f"{str(item.name).lower():<10}{level}")
    names = ", ".join(part.value for part in WiredPart if _wiring([part]) in inverted)
    print_line(f"{'inverted':<10}{names or 'nothing'}")
    if Wiring.ONE_SWITCH in inverted:
        print_line(f"{'homes by':<10}mark")


def _wiring(parts: "Iterable[WiredPart]") -> "Wiring":
    from sonarhw.wire.messages import Wiring

    return Wiring(sum(Wiring[part.name] for part in {*parts}))
