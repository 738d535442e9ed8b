"""Options that several commands share, and checks of their values."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from sonarhw_sim.air import ROOM_TOLERANCE, EdgeStrength, Model, Receiver

from sonarhw.errors import InputError
from sonarhw.wire.messages import MOST_DEGREES
from sonarhw_cli.console.completions import complete_board, complete_place, complete_room
from sonarhw_cli.console.lines import warn

if TYPE_CHECKING:
    from sonarhw.readings import ScanOrder

ROOM_NAME = "NAME|FILE.toml"
RoomName = Annotated[
    str,
    typer.Argument(help="Room: name of a shipped room, or file.", metavar="ROOM", autocompletion=complete_room),
]
PlaceName = Annotated[
    str | None,
    typer.Option(
        "--place",
        help="Place of the room file, or X,Y in metres.",
        metavar="NAME|X,Y",
        autocompletion=complete_place,
    ),
]
RoomToStore = Annotated[
    str | None,
    typer.Option(
        "--room", help="Room: name or file; stored in the log.", metavar=ROOM_NAME, autocompletion=complete_room
    ),
]
RoomOfLog = Annotated[
    str | None,
    typer.Option(
        "--room",
        help="Room: name or file; default: the room inside the log.",
        metavar=ROOM_NAME,
        autocompletion=complete_room,
    ),
]
BoardName = Annotated[
    str,
    typer.Option(
        "--board", help="Board profile: name or file.", metavar="NAME|FILE.toml", autocompletion=complete_board
    ),
]
Profile = Annotated[
    str,
    typer.Argument(help="Board profile: name or file.", metavar="PROFILE", autocompletion=complete_board),
]
BoardOfLog = Annotated[
    str | None,
    typer.Option(
        "--board",
        help="Board profile: name or file; default: the log's.",
        metavar="NAME|FILE.toml",
        autocompletion=complete_board,
    ),
]
BoardToStore = Annotated[
    str | None,
    typer.Option(
        "--board",
        help="Board profile: name or file; stored in the log.",
        metavar="NAME|FILE.toml",
        autocompletion=complete_board,
    ),
]
BoardOfScanner = Annotated[
    str | None, typer.Option("--board", help="Board profile; default: the scanner's.", metavar="NAME|FILE.toml")
]
MaxRange = Annotated[float | None, typer.Option(help="Largest range, metres; default: the board's.")]
PingsPerHeading = Annotated[int, typer.Option(help="Pings at each heading.", min=1, max=255)]
Temperature = Annotated[
    float | None, typer.Option(help="Temperature of the air, °C; default: the scanner's thermometer, else 20.")
]
TemperatureInRoom = Annotated[
    float | None,
    typer.Option(help="Temperature of the air, °C; default: the scanner's thermometer, else the room's, else 20."),
]
FromDegrees = Annotated[float, typer.Option("--from", help="First heading, degrees.")]
ToDegrees = Annotated[float, typer.Option("--to", help="End of the headings, degrees; excluded.")]
StepDegrees = Annotated[float, typer.Option("--step", help="Step from one heading to the next, degrees.")]
FromAngle = Annotated[float, typer.Option("--from", help="First turntable angle, degrees.")]
ToAngle = Annotated[float, typer.Option("--to", help="End of the turntable angles, degrees; itself excluded.")]
StepAngle = Annotated[float, typer.Option("--step", help="Step from one turntable angle to the next, degrees.")]

ZeroHere = Annotated[
    bool,
    typer.Option(
        "--zero-here", help="Zero is where the turntable is now: do not home, and do not expect the zero mark."
    ),
]

PingsOfMedian = Annotated[
    int | None,
    typer.Option(
        "--pings",
        help="A reading is the median of this odd number of pings. Default: 1.",
        min=1,
        max=99,
        show_default=False,
    ),
]
RoomTolerance = Annotated[
    float | None,
    typer.Option(
        "--room-tolerance",
        help=f"Standard deviation of the position of each wall, m. Default: {ROOM_TOLERANCE:g}, an assumption.",
        min=0.0,
        max=1.0,
        show_default=False,
    ),
]

EdgeStrengthChoice = Annotated[
    EdgeStrength | None,
    typer.Option(
        "--edge-strength",
        help="Diffraction at edges. uniform: by angles, distances and reflectances, continuous with reflection; "
        "keller: by the angles to the edge's faces; paper: equal in all directions. Default: the board profile's, "
        "else uniform.",
        show_default=False,
    ),
]

ReceiverChoice = Annotated[
    Receiver | None,
    typer.Option(
        "--receiver",
        help="first-echo: the paper's receiver; board: the ranging board's own. Default: the board profile's, "
        "else first-echo.",
        show_default=False,
    ),
]
FitOption = Annotated[
    str,
    typer.Option(
        "--fit",
        help="Quantities to fit before the comparison, on a grid: heading in steps of 0.5°, offset within 6 cm in "
        "steps of 5 mm, position within 3 cm in steps of 1 cm. `sonarhw fit` is finer and adds credible intervals.",
        metavar="heading,offset,position",
    ),
]
ModelChoice = Annotated[Model, typer.Option("--model", help="Prediction model.")]
PtyLink = Annotated[
    Path | None, typer.Option("--pty", help="Serve on a pseudo-terminal; LINK becomes a link to it.", metavar="LINK")
]
TcpAddress = Annotated[
    str | None, typer.Option("--tcp", help="Serve on TCP; port 0 selects a free port.", metavar="HOST:PORT")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON; docs/reference/command_line.md lists the keys.")]
Force = Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")]
ForceFiles = Annotated[bool, typer.Option("--force", help="Overwrite files of these names.")]
PICTURE_FILE = "FILE.png|pdf|svg"
STDOUT = "-"
LOG = ".mcap"
MOST_HEADINGS = 65535  # largest number that fits into the scan command
_MOST_RADIANS = 10.0  # between --from and --to, if they may be in radians: a turn and a half
_ALIKE = 0.005  # between a multiple of π/2 and a number that stands for it


def order_in_degrees(start: float, stop: float, step: float, sweeps: int = 1, pings: int = 1) -> "ScanOrder":
    """Return the scan from `start` to `stop`, degrees; `stop` is excluded. Raises InputError if it has no heading."""
    from sonarhw.readings import ScanOrder, headings_between

    for option, degrees in (("--from", start), ("--to", stop), ("--step", step)):
        check_degrees(option, degrees)
    try:
        headings = headings_between(start, stop, step)
    except ValueError as error:
        raise InputError(_no_heading(start, stop, step)) from error
    if headings > MOST_HEADINGS:
        raise InputError(
            f"--step {step:g}: a sweep has {headings:.6g} headings, at most {MOST_HEADINGS} are possible; "
            "give a larger step"
        )
    return ScanOrder(math.radians(start), math.radians(step), headings, sweeps, pings)


def _no_heading(start: float, stop: float, step: float) -> str:
    """Return why there is no heading from `start` to `stop`, degrees."""
    if step == 0:
        return "--step 0: expected a step other than 0 degrees"
    if (stop > start) == (step > 0) and stop != start:
        return f"--step {step:g}: too many headings; give a larger step"
    expected, sign, turn = ("larger", "positive", 360) if step > 0 else ("smaller", "negative", -360)
    same_heading = stop + turn * (abs(start - stop) // 360 + 1)
    found = f"--from {start:g}, --to {stop:g}: with a {sign} --step ({step:g}), --to must be {expected} than --from"
    other = "" if stop == start else f", or --step {-step:g}"
    return f"{found}; give a {expected} --to, such as {same_heading:g}{other}"


def warn_of_radians(start: float, stop: float) -> None:
    """Warn if --from and --to, degrees, are probably in radians: a short sector with a multiple of π/2 at its end."""
    first, last = _from_radians(start), _from_radians(stop)
    if abs(stop - start) < _MOST_RADIANS and any(angle and angle % 90 == 0 for angle in (first, last)):
        warn(
            f"--from {start:g}, --to {stop:g}: taken as degrees; "
            f"if they are radians, give --from {first:g}, --to {last:g}"
        )


def _from_radians(angle: float) -> float:
    """Return an angle in degrees, as a multiple of 90 where it stands for one."""
    quarters = round(angle / (math.pi / 2))
    return 90 * quarters if abs(angle - quarters * math.pi / 2) < _ALIKE else math.degrees(angle)


def check_degrees(option: str, degrees: float, most: float = MOST_DEGREES) -> None:
    """Raise InputError if the angle of an option is not a number, or larger than `most` degrees to either side."""
    if not abs(degrees) <= most:
        raise InputError(f"{option} {degrees:g}: expected degrees between -{most:g} and {most:g}")


def refuse_given(context: typer.Context, options: Mapping[str, str], reason: str) -> None:
    """Raise InputError with the reason if the command line contains one of the options, named by their parameters."""
    for parameter, option in options.items():
        source = context.get_parameter_source(parameter)
        if source is not None and source.name != "DEFAULT":
            raise InputError(f"{option}: {reason}")


def check_one_line(pty: Path | None, tcp: str | None) -> None:
    """Raise InputError if both --pty and --tcp are given."""
    if pty is not None and tcp is not None:
        raise InputError("--pty, --tcp: a scanner has one line; give only one of them")


def check_scan_values(board: str | None, max_range: float | None, temperature: float | None) -> None:
    """Raise InputError for an invalid --board, --max-range or --temperature of a scan."""
    from sonarhw_sim.board.profile import MOST_RANGE, load_board

    if board is not None:
        load_board(board)
    if max_range is not None and not 0 < max_range <= MOST_RANGE:
        raise InputError(f"--max-range {max_range:g}: expected metres above 0, at most {MOST_RANGE:g}")
    check_temperature(temperature)


def check_temperature(temperature: float | None) -> None:
    """Raise InputError if --temperature is not between -40 and 60 °C."""
    if temperature is not None and not -40 <= temperature <= 60:
        raise InputError(f"--temperature {temperature:g}: expected -40 to 60 °C")
