"""The `sonarhw` command: the list of its subcommands, and the conversion of errors to exit statuses.

Each subcommand has its own file and imports heavy modules inside its function, so that `--help` stays fast.
"""

import difflib
import errno
import logging
import os
import re
import sys
import warnings
from collections.abc import Callable, Sequence
from typing import Annotated, Any, TextIO

import typer
from sonarhw_sim.compilation import watch_compilation

from sonarhw.errors import ExitStatus, SonarError
from sonarhw_cli import calibrate, compare, fit, logs, options, rooms, scan, scanner, simulate, window
from sonarhw_cli.outputs import ClosedOutput, CompilationProgress

# The wording of errors for people who type commands: with options, with what was expected, and with what to do.


# phrases in the messages of the option parser about numbers, and their replacements
_REWORDED = (
    ("Value error, ", ""),
    ("Input should be a valid integer, unable to parse string as an integer", "expected a whole number"),
    ("Input should be a valid number, unable to parse string as a number", "expected a number"),
    ("Input should be ", "expected a number "),
)


def parser_message(error: typer.TyperException, arguments: Sequence[str]) -> str:
    """Return an error of the option parser. Without a command, it is the help, which begins with `Usage:`."""
    return _with_argument_hint(_with_help(_reworded(error), error, arguments), arguments)


def _reworded(error: typer.TyperException) -> str:
    """Return the message of the option parser; about a value, as `--step x: expected a number`."""
    from pydantic import ValidationError

    message = error.format_message()
    for theirs, ours in _REWORDED:
        message = message.replace(theirs, ours)
    choice = re.fullmatch(r"Invalid value for '([^']+)': '(.*)' is not one of '(.*)'\.", message, re.DOTALL)
    if choice is not None:
        *others, last = choice[3].split("', '")
        return f"{choice[1]} {choice[2]}: expected {', '.join(others)} or {last}"
    rejected = re.match(r"Invalid value for '([^']+)': (expected .*)", message)
    if rejected is None or not isinstance(error.__cause__, ValidationError):
        return message
    return f"{rejected[1]} {error.__cause__.errors()[0]['input']}: {rejected[2]}"


# words that other programs use, and the commands that do this
_OTHER_WORDS = {
    "analyse": "compare",
    "analyze": "compare",
    "connect": "info",
    "convert": "import",
    "devices": "ports",
    "draw": "gui",
    "edit": "gui",
    "explain": "compare LOG --explain DEG",
    "find": "locate",
    "init": "room new",
    "list": "ports",
    "localise": "locate",
    "localize": "locate",
    "match": "compare",
    "measure": "scan",
    "open": "gui",
    "play": "replay",
    "plot": "compare LOG --plot PICTURE",
    "predict": "simulate",
    "read": "scan",
    "record": "scan",
    "run": "scan",
    "show": "gui",
    "simulator": "fake",
    "start": "scan",
    "test": "doctor",
    "upload": "flash",
    "version": "--version",
    "view": "gui",
}
_AIR = "the air stands in the room file, in the table [air]"
_DIRECTIONS = "the headings of a scan are --from, --to and --step, in degrees"
_FILE = "the name of a file stands without an option before it"
_POSE = "the place of the sensor is --place NAME or --place X,Y,DEG"
_PICTURE = "the ending of --out chooses a picture, such as --out FILE.png"
_SCANNER = "the URL of the scanner stands without an option before it, such as /dev/ttyUSB0 or COM3"
# words that other programs use for options, and what the command expects instead
_OTHER_OPTIONS = {
    "angles": _DIRECTIONS,
    "baud": "the rate stands in the URL, such as `lines:/dev/ttyUSB0?baud=9600&preset=NAME`",
    "device": _SCANNER,
    "file": _FILE,
    "format": "the ending of --out chooses the format",
    "headings": _DIRECTIONS,
    "humidity": _AIR,
    "input": _FILE,
    "log": _FILE,
    "param": "the quantities to fit are --free, such as --free heading",
    "parameter": "the quantities to fit are --free, such as --free heading",
    "port": _SCANNER,
    "place": "the pose is searched; to search near a known position, give --near X,Y",
    "plot": _PICTURE,
    "pos": _POSE,
    "pose": _POSE,
    "position": _POSE,
    "start": _DIRECTIONS,
    "stop": _DIRECTIONS,
    "temperature": _AIR,
    "url": _SCANNER,
}
_ALIKE = 0.75  # similarity of an option that is proposed; below, it is another word
_GLOBAL = ("--quiet", "-q", "--verbose")
_OF_A_FILE = {"log": "info", "profile": "check", "room": "check"}  # the command of a group that describes a file


def _with_help(message: str, error: typer.TyperException, arguments: Sequence[str]) -> str:
    """Return the message with what to write instead, or with the command that lists arguments and options."""
    context = getattr(error, "ctx", None)
    if context is None:
        return message
    if message.startswith("No such option: "):
        return _about_option(message, context, arguments)
    if meant := _meant(message, context, arguments):
        # an unknown command may be followed by the names of similar ones
        return f"{message.partition('. Did you mean')[0].rstrip('.')}; did you mean `{meant}`?"
    if message.startswith("Missing "):
        return f"{message.rstrip('.')}; expected `{_usage(context)}`; see `{context.command_path} --help`"
    if message.endswith("?") or not message.startswith(("No such ", "Got unexpected ")):
        return message
    return f"{message.rstrip('.')}; see `{context.command_path} --help`"


def _about_option(message: str, context: typer.Context, arguments: Sequence[str]) -> str:
    """Return the message about an unknown option, with the one that it probably means or what to write instead."""
    names = sorted({name for parameter in context.command.params for name in parameter.opts})
    word = message.removeprefix("No such option: ").partition(" (")[0]
    # -room is read as the option -r
    written = next((f"-{argument}" for argument in arguments if f"-{argument}" in names), "")
    similar = [written] if written else difflib.get_close_matches(word, names, cutoff=_ALIKE)
    if word in _GLOBAL:
        name = context.command_path.partition(" ")[2]
        return f"No such option: {word}; it stands before the command: `sonarhw {word} {name}`"
    instead = _OTHER_OPTIONS.get(word.lstrip("-"), "")
    if instead and all(option in names for option in re.findall(r"--[a-z]+", instead)):
        return f"No such option: {word}; {instead}; see `{context.command_path} --help`"
    if similar:
        return f"No such option: {word}; did you mean {' or '.join(f'`{name}`' for name in similar)}?"
    return f"No such option: {word}; see `{context.command_path} --help`"


def _meant(message: str, context: typer.Context, arguments: Sequence[str]) -> str:
    """Return the command that an unknown one probably means, or an empty text."""
    unknown = re.match(r"No such command '([^']*)'", message)
    if unknown is None:
        return ""
    word, path = unknown[1], context.command_path
    if word == "help":
        return " ".join([path, *arguments[arguments.index(word) + 1 :], "--help"])
    groups: dict[str, Any] = getattr(context.command, "commands", {})
    if group := next((name for name, group in groups.items() if word in getattr(group, "commands", {})), ""):
        return f"{path} {group} {word}"
    if context.parent is None:
        return f"{path} {_OTHER_WORDS[word]}" if word in _OTHER_WORDS else ""
    describes = _OF_A_FILE.get(context.info_name or "")
    return f"{path} {describes} {word}" if describes and "Did you mean" not in message else ""


def _usage(context: typer.Context) -> str:
    """Return a command with its arguments and required options, as `sonarhw scan URL --out LOG.mcap`."""
    pieces = [piece for piece in context.command.collect_usage_pieces(context) if piece != "[OPTIONS]"]
    for option in context.command.params:
        if option.param_type_name == "option" and option.required:
            names, _ = option.get_help_record(context) or ("", "")
            pieces.append(options.plain(option, names))
    return " ".join([context.command_path, *pieces])


def _with_argument_hint(message: str, arguments: Sequence[str]) -> str:
    """Return the message with how to write X,Y, a room or a second log if there is an argument too many."""
    is_extra = message.startswith("Got unexpected extra argument")
    has_comma = any(argument.endswith(",") for argument in arguments)
    is_number = "--place" in arguments and re.search(r"\(-?[\d.]+\)", message) is not None
    if (is_extra and (has_comma or is_number)) or (message.startswith("--place: expected one for each") and has_comma):
        return f"{message}; write X,Y without a space"
    room = next((name for name in arguments if is_extra and _is_room(name)), "")
    if room and "--room" not in arguments and {"compare", "replay"} & set(arguments):
        return f"{message}; give the room with `--room {room}`"
    if is_extra and "compare" in arguments:
        return f"{message}; to compare two logs, use `sonarhw compare A.mcap --with B.mcap`"
    return message


def _is_room(name: str) -> bool:
    return name.endswith(".toml") or name in options.complete_room(name)


app = options.CommandList(
    name="sonarhw",
    help="Scan a room with an ultrasonic ranging board, and compare the scan with its prediction.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

# the headings of the help, each with its commands; rare ones are last
_COMMANDS: dict[str, dict[str, Callable[..., int | None] | typer.Typer]] = {
    "Scan": {
        "demo": window.demo,
        "scan": scan.scan,
        "gui": window.gui,
        "serve": scan.serve,
        "replay": scanner.replay,
        "fake": scanner.fake,
        "ping": scan.ping,
        "monitor": scanner.monitor,
    },
    "Predict": {
        "simulate": simulate.simulate,
        "study": fit.study,
        "paths": simulate.paths,
        "figures": simulate.figures,
    },
    "Compare": {
        "compare": compare.compare,
        "report": compare.report,
        "locate": fit.locate,
        "track": fit.track,
        "fit": fit.fit,
        "map": fit.map_logs,
        "calibrate": calibrate.calibrate,
    },
    "Files": {
        "import": logs.import_scan,
        "log": logs.app,
        "room": rooms.room_app,
        "profile": rooms.profile_app,
    },
    "Scanner set-up": {
        "ports": scanner.ports,
        "doctor": scanner.doctor,
        "info": scanner.info,
        "flash": scanner.flash,
        "wiring": scanner.wiring,
        "home": scanner.home,
        "turn": scanner.turn,
        "stop": scanner.stop,
    },
}
_NEGATIVE = {"turn": {"ignore_unknown_options": True}}  # -90 is an angle

for heading, commands in _COMMANDS.items():
    for name, command in commands.items():
        if isinstance(command, typer.Typer):
            app.add_typer(command, name=name, rich_help_panel=heading)
        else:
            app.command(name, rich_help_panel=heading, context_settings=_NEGATIVE.get(name))(command)
app.command("board", hidden=True)(scanner.board)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        options.print_line(f"sonarhw {version('sonarhw')}")
        raise typer.Exit


ShowVersion = Annotated[
    bool, typer.Option("--version", "-v", help="Print the version.", is_eager=True, callback=_show_version)
]
Quiet = Annotated[
    bool,
    typer.Option("--quiet", "-q", help="Print no warnings, progress or closing lines; only results and errors."),
]
Verbose = Annotated[
    bool,
    typer.Option("--verbose", help="Also print what is read and chosen, and the class of an error."),
]


@app.callback()
def sonarhw(
    show_version: ShowVersion = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Scan a room with an ultrasonic ranging board, and compare the scan with its prediction."""
    options.choose_verbosity(quiet=quiet, verbose=verbose)


_FIRST_STEPS = """\
Scan a room with an ultrasonic ranging board, and compare the scan with its prediction.

First steps:
  sonarhw demo                                     watch a fake scanner and the prediction of its scan
  sonarhw simulate laboratory --out predicted.png  predict a scan of a room, without a scanner
  sonarhw ports                                    find a scanner at a serial port

sonarhw --help lists all commands, and sonarhw COMMAND --help the options of one."""


def run(arguments: list[str] | None = None) -> int:
    """Run a command line and return its exit status, one of `ExitStatus`."""
    if sys.stdout is None:  # the shell closed it
        sys.stdout = ClosedOutput()
    watch_compilation(CompilationProgress())
    # matplotlib reports on its own cache of fonts, which is of no concern to the user
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("default", UserWarning)
            warnings.showwarning = _warn
            return _status(arguments)
    finally:
        _discard_unwritten()


def _warn(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning of the library about its arguments as the command prints its own."""
    options.warn(str(message))


def _status(arguments: list[str] | None) -> int:
    command = typer.main.get_command(app)
    given = sys.argv[1:] if arguments is None else arguments
    if "_SONARHW_COMPLETE" in os.environ:  # set by the script that --install-completion writes
        command.main(prog_name="sonarhw")
    try:
        # command.main() is not used: it gives Ctrl-C and a closed pipe other exit statuses
        with command.make_context("sonarhw", list(given)) as context:
            status = command.invoke(context)
        sys.stdout.flush()
        return status or ExitStatus.DONE
    except typer.Exit as exit_wanted:
        return exit_wanted.exit_code
    except SonarError as error:
        options.print_detail(
            f"this is {type(error).__name__}, exit status {error.exit_status}; see docs/reference/errors.md"
        )
        return _report(_with_argument_hint(options.with_options(str(error)), given), error.exit_status)
    except typer.TyperException as error:
        return _refuse(parser_message(error, given), error.exit_code)
    except KeyboardInterrupt:
        return ExitStatus.INTERRUPTED
    except BrokenPipeError:
        return ExitStatus.DONE
    except MemoryError:
        return _report("there is not enough free memory; close other programs", ExitStatus.FAILED)
    except OSError as error:
        # an error about a file contains its name; without a name, the full disk is that of standard output
        where = error.filename or ("standard output" if error.errno == errno.ENOSPC else "")
        return _report(f"{where}: {error.strerror or error}".removeprefix(": "), SonarError.exit_status)


def _refuse(message: str, status: int) -> int:
    # without a command, the message is the help
    if not message.startswith("Usage:"):
        return _report(message, status)
    options.print_help(_FIRST_STEPS if message.startswith("Usage: sonarhw [OPTIONS] COMMAND") else message)
    return status


def _report(message: str, status: int) -> int:
    options.print_error(message)
    return status


def _discard_unwritten() -> None:
    """Discard output that standard output does not accept. Python would flush it at exit, fail, and exit with 120."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
