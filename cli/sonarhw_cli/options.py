"""Options that several commands share, checks of their values, and printing of text that is made harmless."""

import csv
import logging
import math
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, TextIO, TypeVar

import typer
from sonarhw_sim.air import ROOM_TOLERANCE, EdgeStrength, Model, Receiver
from typer.core import TyperCommand, TyperGroup

from sonarhw.errors import InputError, harmless, json_text, number, shortened, smaller_unit, text_cell
from sonarhw.wire.limits import MOST_HEADINGS
from sonarhw_cli import word_kinds

if TYPE_CHECKING:
    from sonarhw.readings import ScanOrder

# Completion of the names of rooms, places and boards in shells. Names of files are completed by the shell.


def complete_room(incomplete: str) -> list[str]:
    """Return the shipped rooms that begin with a text."""
    from sonarhw_sim.files import SHIPPED_ROOMS

    return [name for name in SHIPPED_ROOMS.names() if name.startswith(incomplete)]


def complete_board(incomplete: str) -> list[str]:
    """Return the shipped board profiles that begin with a text."""
    from sonarhw_sim.files import SHIPPED_BOARDS

    return [name for name in SHIPPED_BOARDS.names() if name.startswith(incomplete)]


def complete_place(context: typer.Context, incomplete: str) -> list[str]:
    """Return the places of the room on the command line that begin with a text; none without a valid room."""
    from sonarhw.errors import SonarError

    # after an option without its value, the arguments before it are still in `args`
    given = [context.params.get("room_name"), *context.args]
    room = next((name for name in given if name), None)
    if room is None:
        return []
    from sonarhw_sim.room.room import load_room

    try:
        return [name for name in load_room(room).places if name.startswith(incomplete)]
    except SonarError:
        return []


# Format of numbers on the command line: 9 significant digits, and nothing for a missing value.


def written(value: float | int | str | None) -> str:
    """Return one CSV field; None and NaN are empty."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    return number(value) if isinstance(value, float) else text_cell(str(value))


def write_rows(out: TextIO, header: str, rows: Iterable[Iterable[float | int | str | None]]) -> None:
    """Write a header and rows as CSV; each line ends with a line feed."""
    out.write(header + "\n")
    csv.writer(out, lineterminator="\n").writerows(map(written, row) for row in rows)


# Lines that the commands print. Names from files and devices may contain anything, so each line is made harmless.
#
# Only this module prints text. A rule of ruff forbids `typer.echo` elsewhere. The global options --quiet and
# --verbose select the messages on standard error. Results and errors are always printed.


_MOST = 1000  # characters of a line on standard error


# the messages that are printed: none, so no warnings, progress bars and closing lines; the usual ones; also what a
# command has read and chosen, and the class of an error
_QUIET, NORMAL, VERBOSE = range(3)
_chosen = NORMAL


def choose_verbosity(*, quiet: bool, verbose: bool) -> None:
    """Select the messages of this run. --quiet wins."""
    global _chosen
    _chosen = _QUIET if quiet else VERBOSE if verbose else NORMAL
    logger = logging.getLogger("sonarhw")
    logger.setLevel(logging.INFO)
    logger.handlers = [_Details()]


def prints(level: int) -> bool:
    """Report whether messages of a level are printed."""
    return _chosen >= level


def print_line(text: str = "") -> None:
    """Print a line on standard output."""
    typer.echo(harmless(text))


def print_json(figures: object) -> None:
    """Print JSON on standard output, indented. JSON escapes control characters itself."""
    typer.echo(json_text(figures))


def print_result(as_json: bool, figures: Callable[[], object], lines: Callable[[], Iterable[str]]) -> None:
    """Print the figures of a result as JSON, or its lines."""
    if as_json:
        print_json(figures())
        return
    for line in lines():
        print_line(with_options(line))


def print_note(text: str) -> None:
    """Print text as one line on standard error, unless --quiet is given."""
    if prints(NORMAL):
        _print_on_stderr(text)


def warn(message: str) -> None:
    """Print a warning as one line on standard error, unless --quiet is given."""
    print_note(f"sonarhw: warning: {with_options(message)}")


def print_detail(text: str) -> None:
    """With --verbose, print on standard error what a command has read or chosen."""
    if prints(VERBOSE):
        _print_on_stderr(f"sonarhw: {text}")


class _Details(logging.Handler):
    """Prints what the library logs as details."""

    def emit(self, record: logging.LogRecord) -> None:
        print_detail(record.getMessage())


def print_error(message: str) -> None:
    """Print an error as one line on standard error."""
    _print_on_stderr(f"sonarhw: {message}")


# what the library, which names no option, says to people who do not use the command line
_OPTIONS = (
    (r"^(free|prior|fit|pings) (?=\S+: )", r"--\1 "),
    (r"^places: expected", "--place: expected"),
    (r"^(distance|direction) (?=\S+: expected)", r"--\1 "),
    (r"^distances: expected (.*)$", r"--distance: expected \1; repeat the option"),
    (r"^directions: expected", "--direction: expected"),
    (r"^(board|room) (?=.*: (has a ring of sensors; a plate|expected logs))", r"--\1 "),
    (
        r"; calibrate its reflectances, too$",
        "; add --room-out FILE.toml to calibrate it too, and to write the room with it",
    ),
    (r"; free it too, or", "; add it to --free, or"),
    (r"; give a room$", "; give one with --room"),
    (r"; give the right board$", "; give the right one with --board"),
    (r"; give the unit\. ", "; give it with --unit. "),
    (r"; give a place, or free the position$", "; give --place, or add position to --free"),
    (r"([;:]) give a place, or X,Y in metres;", r"\1 give --place NAME or --place X,Y in metres;"),
    (r"; give a place or a pose$", "; give --place or --pose"),
    (r"; give a pose, or a room and a place$", "; give --pose X,Y,DEG, or --room and --place"),
    (r"; give the room, or (?=more scans|scans from)", "; give the room with --room, or "),
    (r"; give more of its pose, or", "; give more of it in --poses, or"),
    (r"^(?=.*: gives no position or no heading of )", "--poses "),
    (r"or find them with the room$", "or add --out ROOM.toml or --next, which find them with the room"),
    (r"from the known heading, (.*) its standard deviation;", r"from --heading, \1 this --heading-sd;"),
)


def with_options(text: str) -> str:
    """Return a text of the library with the names of the options that the reader needs."""
    for words, option in _OPTIONS:
        text = re.sub(words, option, text)
    return text


def print_help(text: str) -> None:
    """Print a help text with its line breaks on standard error."""
    typer.echo(text, err=True)


def _print_on_stderr(text: str) -> None:
    """Print text as one line. Of a very long text only the begin and the end are printed."""
    typer.echo(shortened(harmless(" ".join(text.split())), _MOST), err=True)


# Options that several commands share, and checks of their values.


ROOM_NAME = "NAME|FILE.toml"
RoomName = Annotated[
    str,
    typer.Argument(help="Room: name of a shipped room, or file.", metavar="ROOM", autocompletion=complete_room),
]
PlaceName = Annotated[
    str | None,
    typer.Option(
        "--place",
        help="Place of the room file, or X,Y in metres and the heading in degrees; without it, 0.",
        metavar="NAME|X,Y[,DEG]",
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
FromDegrees = Annotated[float, typer.Option("--from", help="First heading in the room, degrees.")]
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

Height = Annotated[
    float | None,
    typer.Option(help="Height of the transducer, metres; the prediction then includes floor and ceiling.", metavar="M"),
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
    problem = f"--from {start:g}, --to {stop:g}: with a {sign} --step ({step:g}), --to must be {expected} than --from"
    other = "" if stop == start else f", or --step {-step:g}"
    return f"{problem}; give a {expected} --to, such as {same_heading:g}{other}"


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


def check_degrees(option: str, degrees: float, most: float | None = None) -> None:
    """Raise InputError if the angle of an option is not a number, or larger than `most` degrees to either side.

    By default, `most` is the largest angle of a message.
    """
    from sonarhw.wire.messages import MOST_DEGREES

    largest = MOST_DEGREES if most is None else most
    if not abs(degrees) <= largest:
        raise InputError(f"{option} {degrees:g}: expected degrees between -{largest:g} and {largest:g}")


def refuse_given(context: typer.Context, options: Mapping[str, str], reason: str) -> None:
    """Raise InputError with the reason if the command line contains one of the options, named by their parameters."""
    for parameter, option in options.items():
        source = context.get_parameter_source(parameter)
        if source is not None and source.name != "DEFAULT":
            raise InputError(f"{option}: {reason}")


def check_scan_values(board: str | None, max_range: float | None, temperature: float | None) -> None:
    """Raise InputError for an invalid --board, --max-range or --temperature of a scan."""
    from sonarhw_sim.board.profile import MOST_RANGE, load_board

    if board is not None:
        load_board(board)
    if max_range is not None and not 0 < max_range <= MOST_RANGE:
        raise InputError(f"--max-range {max_range:g}: expected metres above 0, at most {MOST_RANGE:g}")
    check_temperature(temperature)


_METRES = re.compile(r"\bmetres\b(?! per)")  # in the help of an option
_FARTHEST, _USUAL = 30.0, 11.0  # m; longer lengths of options are probably in another unit; the longest usual range


def warn_of_lengths(context: typer.Context) -> None:
    """Warn of options in metres whose numbers are probably centimetres or millimetres."""
    for parameter in context.command.params:
        given = context.params.get(parameter.name or "")
        in_metres = _METRES.search(getattr(parameter, "help", None) or "")
        for length in given if isinstance(given, list | tuple) else [given]:
            if in_metres and isinstance(length, float) and _FARTHEST < abs(length) <= 1000 * _USUAL:
                unit, count = smaller_unit(length, _USUAL)
                name = parameter.opts[0]
                warn(f"{name} is in metres: {length:g} m; if these are {unit}, write {name} {length / count:g}")


def check_temperature(temperature: float | None) -> None:
    """Raise InputError if --temperature is not between -40 and 60 °C."""
    if temperature is not None and not -40 <= temperature <= 60:
        raise InputError(f"--temperature {temperature:g}: expected -40 to 60 °C")


class Rule(NamedTuple):
    """What options of a command need, or exclude. The refusal is the text, after the option unless it names one.

    The text may contain `{value}`, that of the option, and `{other}`, that of the excluded option.
    """

    command: str
    options: str  # separated by spaces; empty: always
    text: str
    needs: str = ""  # one of these must be given
    excludes: str = ""  # none of these may be given


_TWO_SCANS = "--with --with-sweep"
_NOT_OF_TWO = ": not used with --with, which compares two scans without a prediction"
_PLATE_OR_ROOM = " and --room: expected one of them; a plate has a distance, a room has places"
_ALONE = "give only one of them"
_ALL_POSES = " {value}: contains the poses of all logs; leave out --place and --pose"
RULES = (
    Rule(
        "calibrate",
        "",
        "expected --distance of a plate, or --room with logs of scans of a known room",
        "--distance --room",
    ),
    Rule("calibrate", "--place --pose --room-out --plot", ": needs --room", "--room"),
    Rule("calibrate", "--distance --direction", _PLATE_OR_ROOM, excludes="--room"),
    Rule("compare", "--room --place --board --receiver --model --fit --explain", _NOT_OF_TWO, excludes=_TWO_SCANS),
    Rule("compare", "--pings --room-tolerance --find-missing --out", _NOT_OF_TWO, excludes=_TWO_SCANS),
    Rule("compare", "--with-sweep", ": without --with, give the other sweep of the log with --sweep", "--with --sweep"),
    Rule("compare", "--sweep --csv", ": needs --with LOG or --with-sweep N", _TWO_SCANS),
    Rule("compare", "--out", ": needs --find-missing; --plot writes a picture", "--find-missing"),
    Rule("compare", "--explain", ": needs --json; without both, a sentence explains every reading", "--json"),
    Rule("demo", "--force", ": needs --headless DIR; without it, the demo overwrites nothing", "--headless"),
    Rule("doctor", "--plate", ", --distance: give both or none", "--distance"),
    Rule("doctor", "--distance", "--plate, --distance: give both or none", "--plate"),
    Rule("doctor", "--plate", f", --no-turn: the plate needs the turntable; {_ALONE}", excludes="--no-turn"),
    Rule("fake", "--pty", f", --tcp: a scanner has one line; {_ALONE}", excludes="--tcp"),
    Rule("flash", "--force", ": also give --controller", "--controller"),
    Rule("info", "--watch", f", --json: {_ALONE}", excludes="--json"),
    Rule("map", "--poses", _ALL_POSES, excludes="--place --pose"),
    Rule("map", "--place", " and --pose: expected one of them, once for each log", excludes="--pose"),
    Rule("ports", "--ask", f", --guess: {_ALONE}", excludes="--guess"),
    Rule("replay", "--pty", f", --tcp: a scanner has one line; {_ALONE}", excludes="--tcp"),
    Rule(
        "serve",
        "",
        "give --foxglove: it is the only protocol that is served; `sonarhw replay` serves a log as a scanner",
        "--foxglove",
    ),
    Rule("serve", "--out", ": give the number of sweeps, too: --sweeps N", "--sweeps"),
    Rule("simulate", "--pings --room-tolerance", " {value:g}: needs --probability", "--probability"),
    Rule("simulate", "--probability", ": needs --model ray-following; {other} states no probability", "", "--model"),
    Rule(
        "simulate",
        "--probability",
        ": expected neither --traces nor --noise; the board profile states the spreads",
        excludes="--traces --noise",
    ),
    Rule("simulate", "--own-body", ": has no effect with --probability; leave one of them out", "", "--probability"),
    Rule("simulate", "--rate", " {value:g}: needs --traces rf, sampled, envelope", "--traces"),
    Rule("study", "--workers", f", --scheduler: a cluster has its own workers; {_ALONE}", excludes="--scheduler"),
    Rule("turn", "--jog", f", --zero-here: {_ALONE}", excludes="--zero-here"),
)


def check_rules(context: typer.Context, rules: Iterable[Rule], facts: Iterable[str] = (), **names: object) -> None:
    """Raise InputError if an option lacks what it needs, or excludes another one.

    An option is given if it has another value than by default. `facts` count as given options.
    """
    given: dict[str, object] = dict.fromkeys(facts)
    for parameter in context.command.params:
        value = context.params.get(parameter.name or "")
        if not (value is None or value == "" or value == () or value == parameter.default):
            given |= dict.fromkeys(parameter.opts if value is not False else parameter.secondary_opts, value)
    for rule in rules:
        excluded = [option for option in rule.excludes.split() if option in given]
        if not excluded and (not rule.needs or not given.keys().isdisjoint(rule.needs.split())):
            continue
        for option in rule.options.split() or [""]:
            if not option or option in given:
                names |= {"value": given.get(option), "other": given[excluded[0]] if excluded else None}
                refusal = rule.text.format(**names)
                raise InputError(refusal if refusal.startswith("--") else option + refusal)


# The help of a command, with arguments and values as users type them: `LOG...`, not `{LOG}...` and `<list[Path]>`.
#
# In lists of commands, each has its whole first sentence; Typer cuts it on narrow terminals.


_Function = TypeVar("_Function", bound=Callable[..., Any])
_WHOLE_SENTENCE = 1000  # characters


class CommandList(typer.Typer):
    """Commands whose help shows no Python types."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(cls=_PlainGroup, **settings)

    def command(self, name: str | None = None, **settings: Any) -> Callable[[_Function], _Function]:
        """Return the decorator that adds a command, as `Typer.command` does."""
        return super().command(name, cls=_PlainCommand, **settings)


def _first_sentence(command: Any, limit: int = _WHOLE_SENTENCE) -> str:
    """Return the first sentence of the help of a command or group."""
    return str(super(type(command), command).get_short_help_str(max(limit, _WHOLE_SENTENCE)))


class _PlainGroup(TyperGroup):
    get_short_help_str = _first_sentence

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        shown = {name: command for name in self.list_commands(ctx) if not (command := self.commands[name]).hidden}
        width = max(len(name) for name in shown)
        headings: dict[str, list[tuple[str, str]]] = {}
        for name, command in shown.items():
            heading = getattr(command, "rich_help_panel", None) or "Commands"
            headings.setdefault(heading, []).append((name.ljust(width), command.get_short_help_str()))
        for heading, rows in headings.items():
            with formatter.section(heading):
                formatter.write_dl(rows)


class _PlainCommand(TyperCommand):
    get_short_help_str = _first_sentence

    def invoke(self, ctx: Any) -> Any:
        word_kinds.check_kinds(ctx)
        check_rules(ctx, [rule for rule in RULES if rule.command == self.name])
        warn_of_lengths(ctx)
        return super().invoke(ctx)

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        return [piece.replace("{", "").replace("}", "") for piece in super().collect_usage_pieces(ctx)]

    def format_options(self, ctx: Any, formatter: Any) -> None:
        for title, kind in (("Arguments", "argument"), ("Options", "option")):
            parameters = [parameter for parameter in self.get_params(ctx) if parameter.param_type_name == kind]
            rows = [(parameter, parameter.get_help_record(ctx)) for parameter in parameters]
            if shown := [(word_kinds.plain(parameter, row[0]), row[1]) for parameter, row in rows if row is not None]:
                with formatter.section(title):
                    formatter.write_dl(shown)
