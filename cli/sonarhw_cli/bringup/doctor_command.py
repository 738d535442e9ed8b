"""`sonarhw doctor`: check a new scanner step by step."""

import math
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import ExitStatus, InputError, SonarError, counted
from sonarhw_cli.console.connect import ScannerUrl, connect_turntable
from sonarhw_cli.console.lines import print_line, print_note

if TYPE_CHECKING:
    from sonarhw.bringup import Diagnosis, Plate

_WIDTH = 14  # characters of the name of a check


WithTurning = Annotated[
    bool, typer.Option("--turn/--no-turn", help="Also check motor and home switches; the table turns.")
]
PlateAngle = Annotated[
    float | None, typer.Option(help="Turntable angle of a plate, degrees, counter-clockwise.", metavar="DEG")
]
PlateDistance = Annotated[float | None, typer.Option(help="Distance of this plate from the transducer, metres.")]


def doctor(
    url: ScannerUrl,
    turn: WithTurning = True,
    plate: PlateAngle = None,
    distance: PlateDistance = None,
) -> None:
    """Check a new scanner step by step.

    The steps are line, firmware, ranging board, turntable, and a first plate. Each check is a line: pass, FAIL or skip,
    what was found, and what to do. Exit status 1 if any check fails.
    """
    from sonarhw.bringup import examine

    wanted = _plate(plate, distance, turn)
    made: list[Diagnosis] = []
    try:
        with connect_turntable(url) as scanner:
            for diagnosis in examine(scanner, turn, wanted):
                made.append(diagnosis)
                _print(diagnosis)
    except InputError:
        raise
    except SonarError as error:
        from sonarhw.bringup import failed

        made.append(failed("line", str(error), "check port, cable and supply; `sonarhw ports` lists the ports"))
        _print(made[-1])
    failures = sum(diagnosis.verdict == "FAIL" for diagnosis in made)
    print_note(f"{url}: {counted(failures, 'check')} failed" if failures else f"{url}: no check failed")
    raise typer.Exit(ExitStatus.FAILED if failures else ExitStatus.DONE)


def _plate(heading: float | None, distance: float | None, turn: bool) -> "Plate | None":
    from sonarhw.bringup import BESIDE, Plate

    if (heading is None) != (distance is None):
        raise InputError("--plate, --distance: give both or none")
    if heading is None or distance is None:
        return None
    if not turn:
        raise InputError("--plate, --no-turn: the plate needs the turntable; give only one of them")
    if not 10 <= abs(heading) <= math.degrees(BESIDE):
        raise InputError(f"--plate {heading:g}: expected 10 to {math.degrees(BESIDE):g} degrees on one side of zero")
    if not distance > 0:
        raise InputError(f"--distance {distance:g}: expected metres above 0")
    return Plate(math.radians(heading), distance)


def _print(diagnosis: "Diagnosis") -> None:
    print_line(f"{diagnosis.verdict}  {diagnosis.check:<{_WIDTH}}{diagnosis.text}")
    if diagnosis.advice:
        print_line(f"{'':{_WIDTH + 6}}→ {diagnosis.advice}")
