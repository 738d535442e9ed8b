"""Options that several commands share, and their conversion from degrees and names to SI values and objects."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from sonarhw_sim.choices import EdgeStrength, Model, Receiver

from sonarhw.atomic_file import is_special
from sonarhw.errors import InputError
from sonarhw.readings import ScanOrder, headings_between
from sonarhw_cli.console.warning_line import warn

if TYPE_CHECKING:
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.model import Place, Room

RoomFile = Annotated[Path, typer.Argument(help="Room file (*.toml).", metavar="ROOM")]
PlaceName = Annotated[
    str | None, typer.Option("--place", help="Place of the room file, or X,Y in metres.", metavar="NAME|X,Y")
]
RoomOfLog = Annotated[
    Path | None, typer.Option("--room", help="Room file; default: the room inside the log.", metavar="ROOM")
]
BoardName = Annotated[str, typer.Option("--board", help="Board profile: name or file.", metavar="NAME|FILE.toml")]
BoardOfLog = Annotated[
    str | None,
    typer.Option("--board", help="Board profile: name or file; default: the log's.", metavar="NAME|FILE.toml"),
]
FromDegrees = Annotated[float, typer.Option("--from", help="First heading, degrees.")]
ToDegrees = Annotated[float, typer.Option("--to", help="End of the headings, degrees; excluded.")]
StepDegrees = Annotated[float, typer.Option("--step", help="Step from one heading to the next, degrees.")]
FromAngle = Annotated[float, typer.Option("--from", help="First turntable angle, degrees.")]
ToAngle = Annotated[float, typer.Option("--to", help="End of the turntable angles, degrees; itself excluded.")]
StepAngle = Annotated[float, typer.Option("--step", help="Step from one turntable angle to the next, degrees.")]

EdgeStrengthChoice = Annotated[
    EdgeStrength,
    typer.Option(
        "--edge-strength",
        help="Diffraction at edges. paper: equal in all directions; keller: depends on the angles to the edge's faces.",
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
ModelChoice = Annotated[Model, typer.Option("--model", help="Prediction model.")]
PtyLink = Annotated[
    Path | None, typer.Option("--pty", help="Serve on a pseudo-terminal; LINK becomes a link to it.", metavar="LINK")
]
TcpAddress = Annotated[
    str | None, typer.Option("--tcp", help="Serve on TCP; port 0 selects a free port.", metavar="HOST:PORT")
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")]
STDOUT = "-"
LOG = ".mcap"
MOST_DEGREES = 2147.0  # largest angle that fits into a frame
MOST_HEADINGS = 65535  # largest number that fits into the scan command


def order_in_degrees(start: float, stop: float, step: float, sweeps: int = 1, pings: int = 1) -> ScanOrder:
    """Return the scan from `start` to `stop`, degrees; `stop` is excluded. Raises InputError if it has no heading."""
    for option, degrees in (("--from", start), ("--to", stop), ("--step", step)):
        if not abs(degrees) <= MOST_DEGREES:
            raise InputError(f"{option} {degrees:g}: expected degrees between -{MOST_DEGREES:g} and {MOST_DEGREES:g}")
    try:
        headings = headings_between(start, stop, step)
    except ValueError as error:
        raise InputError(
            f"--from, --to, --step: {error} degrees; give a --step other than 0 that leads from --from to --to"
        ) from error
    if headings > MOST_HEADINGS:
        raise InputError(
            f"--step {step:g}: a sweep has {headings:.6g} headings, at most {MOST_HEADINGS} are possible; "
            "give a larger step"
        )
    return ScanOrder(math.radians(start), math.radians(step), headings, sweeps, pings)


def chosen_place(room: "Room", wanted: str | None) -> "Place":
    """Return the place of a room that --place names, with a warning if it is outside. Raises InputError."""
    place = room.place(wanted)
    if room.is_outside(place.position) or room.is_far_from(place.position):
        x, y = place.position
        warn(f"place {place.name!r} at {x:g}, {y:g} m is outside room {room.name!r}")
    return place


def chosen_receiver(name: Receiver | None, board: "Board") -> Receiver:
    """Return the receiver that --receiver names, else that of the board profile."""
    return board.receiver if name is None else name


def check_one_line(pty: Path | None, tcp: str | None) -> None:
    """Raise InputError if both --pty and --tcp are given."""
    if pty is not None and tcp is not None:
        raise InputError("--pty, --tcp: a scanner has one line; give only one of them")


def check_temperature(temperature: float | None) -> None:
    """Raise InputError if --temperature is not between -40 and 60 °C."""
    if temperature is not None and not -40 <= temperature <= 60:
        raise InputError(f"--temperature {temperature:g}: expected -40 to 60 °C")


def checked_out(
    out: str | Path, suffixes: Sequence[str], force: bool, *inputs: str | Path | None, option: str = "--out"
) -> str:
    """Return the suffix of the name `out`, one of `suffixes`. If `-` is one of them, it means standard output.

    Returns the first suffix for a device or a pipe. Raises InputError if the name has another suffix, is a folder, an
    existing file (without `force`) or one of the `inputs`, or if its folder does not exist.
    """
    if str(out) == STDOUT and STDOUT in suffixes:
        return STDOUT
    path = Path(out)
    if is_special(path):
        return suffixes[0]
    suffix = path.suffix.lower()
    if suffix not in suffixes:
        *others, last = [name for name in suffixes if name != STDOUT]
        wanted = f"{', '.join(others)} or {last}" if others else last
        stdout = f", or {STDOUT} for standard output" if STDOUT in suffixes else ""
        raise InputError(f"{option} {out}: expected a name ending in {wanted}{stdout}")
    refuse_existing(path, force, option)
    refuse_overwriting(path, *inputs, option=option)
    return suffix


def refuse_existing(path: Path, force: bool, option: str = "--out") -> None:
    """Raise InputError if `path` exists and may not be overwritten, or if its folder is missing."""
    if path.is_dir():
        raise InputError(f"{option} {path}: is a folder; give the name of a file in it")
    if path.exists() and not force:
        raise InputError(f"{path}: exists already; choose another {option} or add --force")
    if not path.parent.is_dir():
        raise InputError(f"{path}: no such folder: {path.parent}; create it first")


def refuse_overwriting(out: Path, *inputs: str | Path | None, option: str = "--out") -> None:
    """Raise InputError if `out` is one of the files that the command reads, perhaps under another name.

    Inputs that are not files are ignored: None, URLs, and names of shipped profiles.
    """
    for given in inputs:
        text = "" if given is None else str(given)
        # a URL fake:ROOM?place=NAME makes the command read the file ROOM
        read = Path(text.removeprefix("fake:").partition("?")[0] if text.startswith("fake:") else text)
        if text and read.exists() and out.exists() and out.samefile(read):
            raise InputError(f"{option} {out}: is the input file {read}; choose another name")
