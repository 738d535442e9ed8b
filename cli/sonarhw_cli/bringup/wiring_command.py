"""`sonarhw wiring`: the levels of the inputs of a scanner, and what is inverted."""

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


def wiring(
    url: ScannerUrl,
    invert: Annotated[
        list[WiredPart] | None, typer.Option(help="Invert this switch or the direction of the motor; repeatable.")
    ] = None,
    normal: Annotated[
        list[WiredPart] | None, typer.Option(help="Do not invert this part any more; repeatable.")
    ] = None,
) -> None:
    """Print the levels of the inputs and what is inverted. The scanner keeps what --invert and --normal set.

    After a change, the next home searches the zero again.
    """
    from sonarhw.wire.messages import Input, Wiring

    wanted, plain = _wiring(invert or ()), _wiring(normal or ())
    if wanted & plain:
        raise InputError("--invert, --normal: the same part is in both; name it once")
    with connect_turntable(url) as scanner:
        inverted = scanner.configure_wiring(wanted | plain, wanted)
        levels = scanner.inputs()
    for item in Input:
        level = "unknown" if levels is None else "high" if item in levels else "low"
        print_line(f"{str(item.name).lower():<10}{level}")
    names = ", ".join(str(part.name).lower() for part in Wiring if part in inverted)
    print_line(f"{'inverted':<10}{names or 'nothing'}")


def _wiring(parts: "Iterable[WiredPart]") -> "Wiring":
    from sonarhw.wire.messages import Wiring

    return Wiring(sum(Wiring[part.name] for part in {*parts}))
