"""The `sonarhw` command: the list of its subcommands, and the conversion of errors to exit statuses.

Each subcommand has its own file and imports heavy modules inside its function, so that `--help` stays fast.
"""

import difflib
import errno
import functools
import logging
import os
import re
import shlex
import sys
import warnings
from collections.abc import Callable, Sequence
from itertools import islice, pairwise, takewhile
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TextIO

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
    return _with_help(_reworded(error), error, arguments)


def _reworded(error: typer.TyperException) -> str:
    """Return the message of the option parser; about a value, as `--step x: expected a number`."""
    from pydantic import ValidationError

    message = error.format_message()
    for theirs, ours in _REWORDED:
        message = message.replace(theirs, ours)
    choice = re.fullmatch(r"Invalid value for '([^']+)': '(.*)' is not one of '(.*)'\.", message, re.DOTALL)
    if choice is not None:
        *others, last = choice[3].split("', '")
        several = "; give the option once for each" if {*choice[2].split(",")} <= {*others, last} else ""
        return f"{choice[1]} {choice[2]}: expected {', '.join(others)} or {last}{several}"
    rejected = re.match(r"Invalid value for '([^']+)': (expected .*)", message)
    if rejected is None or not isinstance(error.__cause__, ValidationError):
        return message
    given = str(error.__cause__.errors()[0]["input"])
    unit = _UNIT.search(getattr(getattr(error, "param", None), "help", None) or "")
    if share := re.fullmatch(r"([\d.]*\d) ?%", given):
        return f"{rejected[1]} {given}: {rejected[2]} without %, such as {float(share[1]) / 100:g}"
    if getattr(getattr(error, "param", None), "multiple", False) and re.fullmatch(r"[\d.]+(,[\d.]+)+", given):
        repeated = " ".join(f"{rejected[1]} {part}" for part in given.split(","))
        return f"{rejected[1]} {given}: {rejected[2]}; repeat the option: {repeated}"
    if re.fullmatch(r"-?\d+,\d+", given):
        return f"{rejected[1]} {given}: {rejected[2]} with a decimal point, such as {given.replace(',', '.')}"
    ends = re.fullmatch(r"(-?[\d.]*\d)(?:\.\.+|[-:,;]|to)(-?[\d.]*\d).*", given)
    if ends and rejected[1] in ("--from", "--to", "--step"):
        return f"{rejected[1]} {given}: {rejected[2]}; write --from {ends[1]} --to {ends[2]} --step DEG"
    has_unit = re.match(r"-?[\d.]+ ?[^\d.,\s/+*e-]", given) is not None
    return f"{rejected[1]} {given}: {rejected[2]}{f', in {unit[1]} and without a unit' if unit and has_unit else ''}"


# words that other programs use, by the command that does this
_OTHER_WORDS = {
    "compare": "analyse analyze check-scan explain match why",
    "compare A.mcap --with B.mcap": "diff difference differences",
    "compare LOG --plot PICTURE": "plot overlay",
    "doctor": "diagnose selftest self-test test",
    "fake": "emulate emulator mock simulator virtual",
    "fit": "adjust optimise optimize",
    "flash": "build burn compile firmware install program update upgrade upload",
    "gui": "chart display draw edit graph live load open show view viewer visualise visualize window",
    "home": "reset zero",
    "import": "bag convert rosbag",
    "info": "connect settings status",
    "locate": "find localisation localise localization localize pose position",
    "log export": "csv dump extract save",
    "log info": "describe inspect statistics stats summary",
    "map": "combine find-room merge slam",
    "monitor": "debug echo listen minicom miniterm putty screen sniff tail terminal topic watch",
    "ports": "config configure detect devices discover list search serial setup",
    "ports --guess": "arduino guess identify radar sketch",
    "profile list": "boards profiles sensors",
    "replay": "play playback",
    "room list": "rooms",
    "room new": "init",
    "scan": "acquire capture collect get measure read record run start sweep",
    "serve": "broadcast foxglove publish ros stream websocket",
    "simulate": "predict raycast raytrace render",
    "stop": "abort halt",
    "track": "amcl mcl odometry",
    "turn": "move pan rotate",
    "--version": "version",
}
_ANY = ("get", "list", "new", "run", "show", "start")  # words that are joined with what is wanted
# the same within a group such as `sonarhw room`
_OTHER_WORDS_OF_GROUPS = {
    "check": "describe draw info print show validate view",
    "export": "convert csv dump save",
    "import": "convert",
    "info": "check describe print show stats view",
    "list": "ls",
    "new": "add create init make",
    "recover": "fix repair",
}


class _Instead(NamedTuple):
    """What to write in place of options of other programs."""

    text: str  # it applies to commands with the options that it names
    words: str
    argument: str = ""  # the command needs one whose name contains this
    option: str = ""  # as well as this option


_POSITION = "initial initial-pose location pos pose position start-pose xy"
_READ = "csv-file data file filename i in infile input log scan"
# the first that applies to the command is printed
_OTHER_OPTIONS = (
    _Instead("--guess tries the usual baud rates", "baud baudrate b rate speed", "PORT"),
    _Instead("without an option, `sonarhw ports` lists all", "a all l list", "PORT", option="--guess"),
    _Instead(
        "the rate stands in the URL: `lines:/dev/ttyUSB0?baud=9600&preset=NAME`", "baud baudrate b rate speed", "URL"
    ),
    _Instead(
        "its address is --tcp HOST:PORT; the URL of the scanner stands without an option before it",
        "address host listen p port",
        "URL",
    ),
    _Instead(
        "the URL of the scanner stands without an option before it, such as /dev/ttyUSB0 or COM3",
        "address com device host live p port serial tty url",
        "URL",
    ),
    _Instead(
        "the port of the controller stands without an option before it, such as /dev/ttyACM0 or COM3",
        "address com device p port serial tty url usb",
        "PORT",
    ),
    _Instead("the firmware is included", "file firmware hex image sketch", option="--ranging"),
    _Instead("the controller is --controller, such as --controller uno", "arduino board fqbn mcu target"),
    _Instead("its address is --tcp HOST:PORT", "address host listen p port url"),
    _Instead(
        "the unit of a file is an option of `sonarhw import`; that of a device stands in the URL: "
        "`lines:/dev/ttyUSB0?preset=NAME&unit=cm`",
        "unit units",
        "SCAN",
    ),
    _Instead("the preset stands in the URL: `lines:/dev/ttyUSB0?preset=NAME`", "format layout pattern preset", "URL"),
    _Instead("the noise of the receiver is --noise", "sd sigma std snr"),
    _Instead("the model is --model", "algorithm method mode"),
    _Instead(
        "the headings of a scan are --from, --to and --step, in degrees",
        "angle angles beams begin degrees delta end fov headings increment interval max-angle min-angle range rays "
        "resolution sector start stop width",
    ),
    _Instead("the angle between readings is --step, in degrees", "angle-step increment resolution"),
    _Instead("the number of pings is --count", "c n number pings repeat samples times"),
    _Instead(
        "the number of sweeps is --sweeps",
        "count duration loops minutes n number repeat repeats rounds scans seconds time times turns",
    ),
    _Instead("the air stands in the room file, in the table [air]", "air humidity temp temperature", "ROOM"),
    _Instead(
        "the log contains the speed of sound of its scan, and the room file the air, in the table [air]",
        "air humidity speed-of-sound temp temperature",
        "LOG",
        "--receiver",
    ),
    _Instead("the unit stands in the URL: `lines:/dev/ttyUSB0?preset=NAME&unit=cm`", "unit units", "URL"),
    _Instead("pings at each heading are --pings", "average averages mean repetitions samples shots"),
    _Instead("the farthest range is --max-range, in metres", "limit max-dist max-distance maximum"),
    _Instead("the time for reconnecting is --reconnect, in seconds", "timeout wait"),
    _Instead("the heading is the third number of --place X,Y,DEG", "dir direction heading orientation theta yaw"),
    _Instead("reflections are --max-bounces", "bounces order reflections"),
    _Instead("all reflections that the board can detect are followed", "bounces max-bounces order reflections", "ROOM"),
    _Instead("the other scan is --with LOG", "against baseline log2 other reference second"),
    _Instead("what --free does not name is fixed", "constant fix fixed hold keep"),
    _Instead("the speed is --speed, such as --speed 2", "factor fast pace rate"),
    _Instead("the speed is --pace, such as --pace 10 or --pace max", "factor fast rate realtime speed"),
    _Instead("the protocol is --foxglove", "protocol ros ros2 rosbridge websocket ws"),
    _Instead("it is served with --pty LINK or --tcp HOST:PORT", "com device link serial socket tty url"),
    _Instead("the direction of the angle 0 is --heading-zero", "angle-offset offset rotate rotation shift zero"),
    _Instead("the range that means no echo is --no-echo", "inf invalid max-range missing na nan none null"),
    _Instead("the speed of sound is --speed-of-sound", "air c sound-speed temp temperature"),
    _Instead("clockwise angles are --turn cw", "clockwise cw flip invert reverse"),
    _Instead(
        "the columns are --heading NAME and --range NAME",
        "angle angle-col angle-column angles column columns cols dist distance distances",
    ),
    _Instead(
        "the unit of the ranges is --unit, such as --unit cm", "cm ft in inches m mm range-unit", option="--scale"
    ),
    _Instead("the unit of the angles is --angle, such as --angle rad", "angle-unit angles-in deg degrees rad radians"),
    _Instead(
        "separators and lines before the header are recognised",
        "delimiter header sep separator skip skip-header skip-rows skiprows",
        option="--decimal-comma",
    ),
    _Instead(
        "the quantities to fit are --free, such as --free heading",
        "fit param params parameter parameters optimise optimize variables vary",
    ),
    _Instead(
        "the odometry is the poses in the log; `sonarhw import` reads them from a file",
        "odom odometry path poses trajectory",
        option="--start",
    ),
    _Instead(
        "the demo has a room and a place of its own; `sonarhw gui 'fake:ROOM?place=NAME'` shows another",
        "board pace place room scanner seed url",
        option="--headless",
    ),
    _Instead("the start is --start NAME or --start X,Y,DEG", f"at near place {_POSITION}"),
    _Instead("the place of the sensor is --place NAME or --place X,Y,DEG", f"at sensor-position x y {_POSITION}"),
    _Instead(
        "the whole room is searched; `sonarhw fit` starts from a known place",
        f"at guess place start {_POSITION}",
        option="--heading-sd",
    ),
    _Instead("the room stands without an option before it", "env environment map plan room world", "ROOM"),
    _Instead("the room is --room NAME or --room FILE.toml", "env environment map plan world"),
    _Instead("the board is --board NAME or --board FILE.toml", "device-profile profile sensor transducer"),
    _Instead(
        "the board profile contains it; --board FILE.toml",
        "aperture beam beamwidth blanking freq frequency gain max-dist max-distance max-range threshold",
    ),
    _Instead("its size is --size WxD in metres, such as --size 3.2x2.4", "depth dimensions height length width"),
    _Instead("a reading matches within 5 cm, which is fixed", "threshold tolerance within", option="--find-missing"),
    _Instead("the draws for the credible intervals are --samples", "chains draws iterations mcmc n steps"),
    _Instead("processes are --workers N", "cores j jobs n-jobs processes threads"),
    _Instead("an existing file is replaced with --force", "f overwrite replace y yes"),
    _Instead("`sonarhw gui` opens it in the window", "display show view", "LOG"),
    _Instead("a picture is --plot FILE.png", "o out output"),
    _Instead(
        "without a window, the files are written with --headless DIR", "gui no-gui nogui o out output save window"
    ),
    _Instead("the ending of --out chooses what is written", "format"),
    _Instead("the name of the file stands without an option before it", f"o out output save to {_READ}", "NAME.TOML"),
    _Instead("the name of the file stands without an option before it", _READ, "LOG"),
    _Instead("the name of the file stands without an option before it", _READ, "FILE"),
    _Instead("the file to write is --out", "file filename log o save save-as to write"),
)
_FORMATS = (
    "csv",
    "gif",
    "html",
    "jpg",
    "json",
    "mat",
    "mcap",
    "mp4",
    "npz",
    "pdf",
    "png",
    "svg",
    "txt",
    "xlsx",
    "yaml",
)
_SHORTENED = 3  # letters of a command at least, such as `sim`
_ALIKE = 0.75  # similarity of an option that is proposed; below, it is another word
_OPTION_ALIKE = 0.8  # the same for options of this command
_VERY_ALIKE = 0.85  # the same for options of other commands
_VAGUE = ("file", "name", "path", "the")  # parts of words such as --room-file
_SAVE = ("o", "out", "output", "outfile", "save", "to")
_PICTURES = ("draw", "figure", "image", "picture", "plot", "save-plot")
# words for what the help of options calls otherwise
_WORDS_OF_HELP = {
    **dict.fromkeys(("sd", "sigma", "std", "stdev", "uncertainty"), "standard deviation"),
    **dict.fromkeys(("azimuth", "bearing", "theta", "yaw"), "heading"),
    **dict.fromkeys(("distance", "depth"), "range"),
    **dict.fromkeys(("animate", "animation", "movie", "video"), "film"),
    "scale": "unit",
    **dict.fromkeys(("clobber", "replace"), "overwrite"),
}
_MOST_FILES = 1000  # of a folder that are compared with a name
_MOST_LISTED = 6  # options of a command with few
_GLOBAL = {
    "debug": "--verbose",
    "quiet": "--quiet",
    "q": "-q",
    "silent": "--quiet",
    "v": "--verbose",
    "verbose": "--verbose",
}
# what a word without a command is given to, by its kind
_FIRST_COMMANDS = {
    "log": "gui {}",
    "room": "room check {}",
    "shipped room": "simulate {}",
    "board": "profile check {}",
    "study": "study {}",
    "drawing": "room import {}",
    "scan": "import {} --out LOG.mcap",
    "URL": "scan {} --out LOG.mcap",
}
_OF_A_FILE = {"log": "info", "profile": "check", "room": "check"}  # the command of a group that describes a file
_UNIT = re.compile(r"(degrees|metres|seconds|Hz|°C|m/s)\b")


def _with_help(message: str, error: typer.TyperException, arguments: Sequence[str]) -> str:
    """Return the message with what to write instead, or with the command that lists arguments and options."""
    if without := re.fullmatch(r"Option '([^']+)' requires an argument\.", message):
        return f"{without[1]}: expected a value, as in `{_written_of(without[1], arguments)}`"
    context = getattr(error, "ctx", None)
    if context is None:
        return message
    if message.startswith("No such option: "):
        return _about_option(message, context, arguments)
    if meant := _meant(message, context, arguments):
        # an unknown command may be followed by the names of similar ones
        return f"{message.partition('. Did you mean')[0].rstrip('.')}; did you mean `{meant}`?"
    if message.startswith("Got unexpected "):
        return _about_extra(message.rstrip("."), context, arguments)
    if message.startswith("Missing ") or getattr(getattr(error, "param", None), "param_type_name", "") == "argument":
        hint = "; `sonarhw ports` lists the scanners" if re.match("Missing argument '(URL|PORT)'", message) else ""
        value = message.partition(" ")[2].partition(": expected")[0]
        if options.kind_of(value) == "URL":
            hint = "; write them in this order"
        elif value.startswith("--"):
            hint = "; arguments stand without an option before them"
        elif message.startswith("Missing ") and re.search(r":.+\?\w+=", arguments[-1]):
            hint = "; write the URL in quotes, because the shell reads & as the end of the command"
        return f"{message.rstrip('.')}; expected `{_usage(context)}`{hint}; see `{context.command_path} --help`"
    if weak := re.search(r"^No such command '(.+)'(\. Did you mean '(.+)'\?)", message):
        is_alike = difflib.SequenceMatcher(None, weak[1], weak[3]).ratio() >= _ALIKE
        message = message if is_alike else message.replace(weak[2], ".")
    hidden = [name for name, command in getattr(context.command, "commands", {}).items() if command.hidden]
    message = next(
        (message.removesuffix(end) for name in hidden if message.endswith(end := f". Did you mean '{name}'?")), message
    )
    if message.endswith("?") or not message.startswith("No such "):
        return message
    commands = f"; its commands: {', '.join(context.command.commands)}" if context.parent is not None else ""
    return f"{message.rstrip('.')}{commands}; see `{context.command_path} --help`"


def _about_option(message: str, context: typer.Context, arguments: Sequence[str]) -> str:
    """Return the message about an unknown option, with the one that it probably means or what to write instead."""
    parameters = [parameter for parameter in context.command.params if parameter.param_type_name == "option"]
    names = sorted({name for parameter in parameters for name in parameter.opts})
    option = message.removeprefix("No such option: ").partition(" (")[0]
    word, message = option.lstrip("-"), f"No such option: {option}"
    # -room is read as the option -r
    written = [f"-{argument}" for argument in arguments if f"-{argument}" in names]
    if word in _GLOBAL and context.parent is not None:
        name = context.command_path.partition(" ")[2]
        return f"{message}; it stands before the command: `sonarhw {_GLOBAL[word]} {name}`"
    if same := next((name for name in names if name.casefold() == option.casefold()), ""):
        return f"{message}; did you mean `{same}`?"
    see = f"; see `{context.command_path} --help`"
    value = next((value for given, value in pairwise(arguments) if given == option), "")
    argument = next((p for p in context.command.params if p.param_type_name == "argument"), None)
    kinds = options.expected_of(argument, context.command)[0].split("|") if argument else []
    if options.kind_of(value) in kinds and (missing := _missing_argument(context, arguments)):
        return f"{message}; expected `{_usage(context)}`, where {missing} stands without an option before it{see}"
    others = {path: p.help for path, command in _all_commands(context) for p in command.params if option in p.opts}
    alike = [] if others else difflib.get_close_matches(option, names, cutoff=_ALIKE)
    close = [name for name in alike if _is_alike(option, name)]
    by_value = "" if close or f"--{word}" in names else _by_value(value, context)
    meant = [f"--{word.removesuffix('s')}", *(() if close else [f"--{value}"])] if len(word) > 1 else []
    if known := next((name for name in meant if name in names), by_value):
        return f"{message}; did you mean `{known}`?"
    ending = value if word in ("format", "type") else Path(value).suffix.removeprefix(".").lower()
    if word not in (*_SAVE, *_PICTURES, "format", "type", "record") or os.path.isfile(value):
        ending = ""
    if f"--{word}" not in names and (written_as := _about_format(ending, context) or _about_format(word, context)):
        return f"{message}; {written_as}{see}"
    if not written and f"--{word}" not in names:
        parts = [part for part in reversed(re.split("[-_]", word)) if len(part) > 1 and part not in _VAGUE]
        known = next((f"--{part}" for part in parts if f"--{part}" in names), "")
        if known and not _instead(word, context):
            return f"{message}; did you mean `{known}`?"
        if instead := next(
            filter(None, (_instead(part, context) for part in (word, word.removesuffix("s"), *parts))), ""
        ):
            return f"{message}; {instead}{see}"
    longer = [name for name in names if len(word) > 2 and name.startswith(option)]
    if len(word) == 1 and context.parent is not None:
        longer = [name for name in names if name.startswith(f"-{option}")][:_MOST_LISTED]
    if similar := written or longer or close:
        return f"{message}; did you mean {' or '.join(f'`{name}`' for name in similar)}?"
    command = getattr(context.find_root().command, "commands", {}).get(word)
    if command is not None and not command.hidden:
        return f"{message}; `sonarhw {word}` is a command of its own"
    later = next((name for name in arguments if name in getattr(context.command, "commands", {})), "")
    if later:
        return f"{message}; options of a command stand behind it: `sonarhw {later} ... {option}`"
    if context.parent is None and (opened := next(filter(None, map(_command_for, arguments)), "")):
        return f"{message}; did you mean `sonarhw {opened}`?"
    if missing := _missing_argument(context, arguments):
        return f"{message}; expected `{_usage(context)}`, where {missing} stands without an option before it{see}"
    path = context.command_path
    if word in _SAVE:
        return f"{message}; `{path} > FILE` writes its output to a file{see}"
    if others:
        does = (next(iter(others.values())) or "").partition(". ")[0].rstrip(".")
        about = _about_word(word, parameters, context)
        return f"{message}{about}; it is an option of `{'`, `'.join(islice(others, 3))}`: {does}{see}"
    if 0 < len(names) <= _MOST_LISTED:
        return f"{message}; its options: {', '.join(names)}"
    return f"{message}{_about_word(word, parameters, context)}{see}"


def _by_value(value: str, context: typer.Context) -> str:
    """Return the option that takes a value, by the values that its help lists; empty for an unknown value."""
    if re.fullmatch("[a-z][a-z0-9-]+", value):
        parameter: Any
        for parameter in context.command.params:
            written = _written_option(parameter, context) if parameter.param_type_name == "option" else ""
            if re.search(rf"([|:,]| or) ?{value}([|,.;]|$)", f"{written.replace(' ', '|')} {parameter.help}"):
                return f"{parameter.opts[0]} {value}"
    return ""


def _is_alike(word: str, name: str) -> bool:
    """Report whether an option is probably a misspelt `name`: of about the same length, or with the same start."""
    is_same_start = word[:6] == name[:6]  # with two hyphens
    ratio = difflib.SequenceMatcher(None, word, name).ratio()
    return word.startswith(name) or (ratio >= _OPTION_ALIKE and (is_same_start or abs(len(word) - len(name)) <= 1))


def _missing_argument(context: typer.Context, arguments: Sequence[str]) -> str:
    """Return the required argument of a command that is run with options alone, or an empty text."""
    words = [*context.command_path.split()[-1:], *arguments[len(context.command_path.split()) - 1 :]]
    flags = {name for p in context.command.params if getattr(p, "is_flag", False) for name in p.opts}
    given = [word for before, word in pairwise(words) if word[:1] != "-" and (before[:1] != "-" or before in flags)]
    required = next((p.metavar for p in context.command.params if p.param_type_name == "argument" and p.required), None)
    return "" if given or required is None else required


def _about_word(word: str, parameters: Sequence[Any], context: typer.Context) -> str:
    """Return options whose help contains a word, or the most similar option of another command, after a semicolon."""
    word = re.sub("^(no|not|with|without|enable|disable|use)-", "", word)
    stem = _WORDS_OF_HELP.get(word, re.sub("(ies|y|s)$", "", word.partition("-")[0]))
    if len(stem) > _SHORTENED and stem not in ("from", "with"):
        having = [p for p in parameters if re.search(rf"(?i)\b{re.escape(stem)}", p.help or "")][:2]
        if having:
            written = ", ".join(f"`{_written_option(p, context)}`" for p in having)
            return f"; options about {_WORDS_OF_HELP.get(word, word)}: {written}"
    if f"--{word}" in (
        by_option := {o: path for path, command in _all_commands(context) for p in command.params for o in p.opts}
    ):
        return ""
    near = difflib.get_close_matches(f"--{word}", by_option, n=1, cutoff=_VERY_ALIKE)
    return f"; `{near[0]}` is an option of `{by_option[near[0]]}`" if near else ""


def _about_format(word: str, context: typer.Context) -> str:
    """Return how a format of files is written: by an option of this command, or else of others on the same input."""
    word = "png" if word in _PICTURES else word
    if word not in _FORMATS:
        return ""
    if here := _writers(word, context.command, context):
        return f"{word.upper()} is written with `{here[0]}`"
    out: Any = next((p for p in context.command.params if "--out" in p.opts), None)
    endings = ", ".join(re.findall(r"\.\w+", out.help or "")) if out and out.metavar in (None, "FILE") else ""
    writes = f"this command writes `{_written_option(out, context)}`{endings and f': {endings}'}" if out else ""
    return "; ".join(filter(None, (writes, _written_elsewhere(word, context))))


def _written_elsewhere(word: str, context: typer.Context) -> str:
    """Return what else writes a format of files: a browser, or other commands on the same input."""
    if word == "pdf" and _writers("html", context.command, context):
        return "a browser prints HTML as PDF"
    argument = next((p.metavar for p in context.command.params if p.param_type_name == "argument"), None)
    if _writers("mcap", context.command, context):
        argument = "LOG"  # others read the log that it writes
    same = [(path, c) for path, c in _all_commands(context) if any(argument == p.metavar for p in c.params[:1])]
    others = [f"`{path} {argument} {option}`" for path, c in same for option in _writers(word, c, context)[:1]]
    if not argument or not others or _writers(word, context.command, context):
        return ""
    return f"{word.upper()} is written by {' or '.join(dict.fromkeys((others[0], others[-1])))}"


def _writers(word: str, command: Any, context: typer.Context) -> list[str]:
    """Return the options of a command that write a format of files, as `--out FILE.csv`."""
    found = []
    for parameter in command.params:
        option = _written_option(parameter, context) if {*parameter.opts} & {"--out", "--plot", "--json"} else ""
        name = option.partition(" ")[0]
        about = f"{option} {parameter.help} {command.help if name == '--out' and ' FILE' in option else ''}"
        if name == f"--{word}" or (option and re.search(rf"[|.]{word}\b", about)):
            found.append(name if name == f"--{word}" else f"{name} FILE.{word}")
    return found


def _instead(word: str, context: typer.Context) -> str:
    """Return what a command expects in place of an option of other programs, or an empty text."""
    parameters = context.command.params
    names = {name for parameter in parameters for name in parameter.opts}
    given = " ".join(str(p.metavar or p.name).upper() for p in parameters if p.param_type_name == "argument")
    for instead in _OTHER_OPTIONS:
        needed = {*re.findall(r"--[a-z-]+", instead.text), *filter(None, (instead.option,))}
        if word in instead.words.split() and instead.argument in given and needed <= names:
            return instead.text
    return ""


def _all_commands(context: typer.Context) -> list[tuple[str, Any]]:
    """Return all commands by how they are written, but the hidden ones."""
    root = context.find_root()
    waiting, known = [(root.command_path, root.command)], []
    for path, command in waiting:
        parts = getattr(command, "commands", None)
        if parts is None:
            known.append((path, command))
        else:
            waiting.extend((f"{path} {name}", part) for name, part in parts.items() if not part.hidden)
    return known


def _meant(message: str, context: typer.Context, arguments: Sequence[str]) -> str:
    """Return the command that an unknown one probably means, or an empty text."""
    # the parser writes odd characters of the word in another way
    word = next((argument for argument in arguments if message.startswith(f"No such command {argument!r}")), None)
    if word is None:
        return ""
    path = context.command_path
    groups: dict[str, Any] = getattr(context.command, "commands", {})
    if word in ("help", "man"):
        return " ".join([path, *arguments[arguments.index(word) + 1 :], "--help"])
    if context.parent is not None:
        return _meant_in_group(word, context, arguments, groups, "Did you mean" in message)
    if group := next((name for name, group in groups.items() if word in getattr(group, "commands", {})), ""):
        return f"{path} {group} {word}"
    later = next((name for name in arguments[arguments.index(word) + 1 :] if name in groups), "")
    if later and later == arguments[arguments.index(word) + 1] and not options.kind_of(word):
        return f"{path} {later}"
    longer = [name for name, command in groups.items() if name.startswith(word) and not command.hidden]
    if len(longer) == 1 and len(word) >= _SHORTENED:
        return f"{path} {longer[0]}"
    if opened := _command_for(word):
        return f"{path} {later} {word}" if later else f"{path} {opened}"
    every = ["profile" if part == "board" else part for part in re.split("[-_]", word)]
    for group in every:
        if member := next((part for part in every if part in getattr(groups.get(group), "commands", {})), ""):
            return f"{path} {group} {member}"
    words = _commands_by_word()
    if word in words:
        return f"{path} {words[word]}"
    parts = [part for part in re.split("[-_]", word) if part not in _ANY]
    shown = {name for name, command in groups.items() if not command.hidden}
    if parts != [word] and (known := [part for part in parts if part in words or part in shown]):
        return f"{path} {words.get(known[0], known[0])}"
    if difflib.get_close_matches(word, shown, n=1, cutoff=_ALIKE):
        return ""  # the message contains it
    similar = difflib.get_close_matches(word, words, n=1, cutoff=_ALIKE)
    meant = words[similar[0]] if similar else next(filter(None, map(_command_for, arguments)), "")
    return f"{path} {meant}" if meant else ""


def _commands_by_word() -> dict[str, str]:
    return {other: command for command, others in _OTHER_WORDS.items() for other in others.split()}


def _command_for(word: str) -> str:
    """Return the command for a file, a scanner or a room that is given without one; empty for other words."""
    guessed = "room" if word.endswith(".toml") else "URL" if re.match("[a-z0-9]+:", word) else ""
    kind = options.kind_of(word) or guessed
    return _FIRST_COMMANDS.get(kind, "").format(word)


def _meant_in_group(
    word: str, context: typer.Context, arguments: Sequence[str], commands: dict[str, Any], has_similar: bool
) -> str:
    """Return the command of a group that an unknown one probably means: another word for it, or a name of a file."""
    path = context.command_path
    if context.info_name == "room" and word in _OTHER_WORDS["gui"].split():
        return f"{context.find_root().command_path} gui"
    for name, others in _OTHER_WORDS_OF_GROUPS.items():
        if name in commands and word in others.split():
            return f"{path} {name}"
    later = next((argument for argument in arguments[arguments.index(word) + 1 :] if argument in commands), "")
    is_name = "." in word or "/" in word or _is_room(word)
    root = context.find_root()
    elsewhere = word if word in getattr(root.command, "commands", {}) else _commands_by_word().get(word)
    if elsewhere and word not in _ANY and not has_similar and not is_name:
        return f"{root.command_path} {elsewhere}"
    writes = "export" if "export" in commands and "--out" in arguments else ""
    describes = later or ((writes or _OF_A_FILE.get(context.info_name or "")) if is_name else "")
    return f"{path} {describes} {word}" if describes and not has_similar else ""


def _usage(context: typer.Context) -> str:
    """Return a command with its arguments and required options, as `sonarhw scan URL --out LOG.mcap`."""
    pieces = [piece for piece in context.command.collect_usage_pieces(context) if piece != "[OPTIONS]"]
    required = [option for option in context.command.params if option.param_type_name == "option" and option.required]
    return " ".join([context.command_path, *pieces, *(_written_option(option, context) for option in required)])


def _written_option(option: Any, context: typer.Context) -> str:
    """Return an option with its value, as `--out LOG.mcap`."""
    names, _ = option.get_help_record(context) or ("", "")
    return options.plain(option, names)


def _written_of(name: str, arguments: Sequence[str]) -> str:
    """Return an option of the command that is run with its value. The parser's error does not contain the command."""
    context = _context_of(arguments)
    return next((_written_option(option, context) for option in context.command.params if name in option.opts), name)


def _context_of(arguments: Sequence[str]) -> typer.Context:
    """Return the context of the command in the arguments, without its values."""
    context = typer.Context(typer.main.get_command(app), info_name="sonarhw")
    for argument in arguments:
        if command := getattr(context.command, "commands", {}).get(argument):
            context = typer.Context(command, info_name=argument, parent=context)
    return context


def _joined(word: str, context: typer.Context, arguments: Sequence[str]) -> str:
    """Return how to write a list or several values of an option whose values are separated by spaces."""
    at = next((k for k in range(2, len(arguments)) if arguments[k] == word and arguments[k - 2].startswith("--")), 0)
    taken: Any = next((p for p in context.command.params if at and arguments[at - 2] in p.opts), None)
    value = re.compile(r"-?[\d.,]+" if re.fullmatch(r"-?[\d.,]+", word) else "[a-z_]+,?")
    if taken is None or getattr(taken, "is_flag", False) or options.kind_of(word) or not value.fullmatch(word):
        return ""
    option, *values = arguments[at - 2], arguments[at - 1], *takewhile(value.fullmatch, arguments[at:])
    written, is_word = _written_option(taken, context), value.pattern.startswith("[a-z")
    if "," in written and not (is_word and "|" in written):
        return f"write `{option} {','.join(part.rstrip(',') for part in values)}` without a space"
    is_many = getattr(taken, "multiple", False)
    return f"repeat the option: `{' '.join(f'{option} {part}' for part in values)}`" if is_many else ""


def _about_extra(message: str, context: typer.Context, arguments: Sequence[str]) -> str:
    """Return the message about an argument too many, with how to write a place, a size, a room or a second log."""
    names = {name for parameter in context.command.params for name in parameter.opts}
    extra = message.removesuffix(")").rpartition("(")[2].split(" ")[0]
    if extra.startswith("--"):
        return _about_option(f"No such option: {extra}", context, arguments)
    # place=desk, or a dash of a text editor in place of two hyphens
    meant = re.fullmatch(r"[—–−]?-?([a-z][a-z-]*)(?:=(.+))?", extra)
    if meant and f"--{meant[1]}" in names and (meant[2] or extra[0] != meant[1][0]):
        return f"{message}; did you mean `--{meant[1]}{' ' if meant[2] else ''}{meant[2] or ''}`?"
    is_number = re.fullmatch(r"-?[\d.]+", extra) is not None
    is_size = is_number or re.fullmatch(r"[x×*]|by|[\d.]+(m|cm|mm)", extra) is not None
    known = f"{message}; expected `{_usage(context)}`; see `{context.command_path} --help`"
    host = next((word for word, after in pairwise(arguments) if after == extra and word.startswith("socket://")), "")
    if host and extra.isdecimal():
        return f"{known}; write `{host}:{extra}`"
    if re.fullmatch(r"\d{4,}", extra) and (rate := _instead("baud", context)):
        return f"{known}; {rate}"
    if extra in ("from", "to", "step", "by") and "--step" in names:
        return f"{known}; write --from DEG --to DEG --step DEG"
    if is_size and "--size" in arguments:
        return f"{known}; write WxD in metres without a space, such as --size 3.2x2.4"
    if extra in _ANY and (listed := _commands_by_word().get(f"{context.info_name}s")):
        return f"{message}; did you mean `sonarhw {listed}`?"
    if joined := _joined(extra, context, arguments):
        return f"{known}; {joined}"
    accepted = [p for p in context.command.params if p.param_type_name == "argument"]
    if not accepted and (instead := _instead(options.kind_of(extra).rpartition(" ")[2].lower(), context)):
        return f"{known}; {instead}"
    if not accepted and (advice := options.use_of(extra)):
        return f"{known}; {advice}"
    if not accepted and Path(extra).suffix:
        return f"{known}; `{context.command_path} > {shlex.quote(extra)}` writes its output to a file"
    if not accepted and (command := _commands_by_word().get(extra)):
        return f"{message}; did you mean `sonarhw {command}`?"
    extras = f" {message.rpartition('(')[2].removesuffix(')')} "
    words = [str(context.params[p.name]) for p in accepted if context.params.get(p.name)]
    words += [word for word in arguments if f" {word} " in extras]
    kinds = options.expected_of(accepted[0], context.command)[0] if accepted else ""
    same = [word for word in words if (kind := options.kind_of(word)) and kind in kinds.split("|")]
    flags = {name for p in context.command.params if getattr(p, "is_flag", False) for name in p.opts}
    if flag := next((flag for flag, word in pairwise(arguments) if flag in flags and word in {*words} - {*same}), ""):
        file = next((word for word in words if word not in same and Path(word).suffix), "")
        writes = f"; `> {shlex.quote(file)}` behind the command writes its output to a file" if file else ""
        return f"{known}; {flag} takes no value{writes}"
    if "compare" in arguments and len(same) == 2:
        return f"{known}; to compare two logs, use `sonarhw compare A.mcap --with B.mcap`"
    if accepted and len(same) == len(words):
        several = "; `sonarhw fit` and `sonarhw map` take several" if accepted[0].metavar == "LOG" else ""
        return f"{known}; it takes one {accepted[0].metavar}: run it once for each{several}"
    if taking := next(filter(None, (options.option_taking(word, context) for word in words if word not in same)), ""):
        return f"{known}; give it with `{taking}`"
    if "LOG" in _usage(context) and Path(extra).suffix != ".mcap" and os.path.isfile(extra):
        return f"{known}; `sonarhw import {extra} --out LOG.mcap` converts a scan of another program"
    numbers = [
        option for p in context.command.params if re.search(" (INTEGER|NUMBER)$", option := _written_option(p, context))
    ]
    if is_number and numbers:
        return f"{known}; numbers are given with options, such as `{'`, `'.join(numbers[:3])}`"
    at = arguments.index(extra) if extra in arguments else 0
    if at > 1 and arguments[at - 2] in names:
        return f"{known}; {arguments[at - 2]} takes one value"
    place = next((word for word in words if word not in same), extra)
    if spaced := _spaced(arguments):
        return f"{known}; {spaced}"
    if same and "--place" not in names:
        return f"{known}; {accepted[0].metavar} is {same[0]}: leave out {place}"
    if "--place" in names and "--place" not in arguments and re.fullmatch(r"[a-z]\w*|-?[\d.]+(,-?[\d.]+){1,2}", place):
        return f"{known}; give a place with `--place {place}`"
    return known


def _with_argument_hint(message: str, arguments: Sequence[str]) -> str:
    """Return the message of a command with how to write a pair or a list if it is written with a space."""
    context = _context_of(arguments)
    flags = {name for p in context.command.params if getattr(p, "is_flag", False) for name in p.opts}
    after = next(
        (flag for flag, word in pairwise(arguments) if flag in flags and message.startswith(f"{word}: no ")), ""
    )
    if after:
        return f"{message}; {after} takes no value"
    stray = re.match(r"(\S+): no such file|.*, (\S+): expected the URL of one scanner", message)
    words = (
        [stray[1] or stray[2]] if stray else arguments if message.startswith("--place: expected one for each") else ()
    )
    if joined := next(filter(None, (_joined(word, context, arguments) for word in words)), ""):
        return f"{message}; {joined}"
    fake = next((word for word in arguments if word.startswith("fake:") and "?" not in word), "")
    if fake and (place := re.match("--place needs --room: (\\S+) is a place", message)):
        return f"{message}; that of a fake scanner stands in its URL: '{fake}?place={place[1]}'"
    is_in_room = any("room" in options.kind_of(word) for word in arguments) and "--place" not in arguments
    if is_in_room and (place := re.match(r"(\S+): there is no such file or port", message)):
        return f"{message}; a place is given with `--place {place[1]}`"
    if size := re.match(r"(?:unknown room ')?([\d.]+[x×][\d.]+)'?[:;]", message):
        return f"{message}; `sonarhw room new NAME.toml --size {size[1]}` writes a room of this size"
    if ending := re.match(r"(--\w+) .*\.(\w+): expected a name ending in", message):
        word = ending[2].lower()
        here = [option for option in _writers(word, context.command, context) if not option.startswith(ending[1])]
        about = f"{word.upper()} is written with `{here[0]}`" if here else _written_elsewhere(word, context)
        return f"{message}; {about}" if about else message
    in_room = re.match(r"(?:unknown room ')?(\w+)[/:](\w+)'?[:;]", message)
    if in_room and in_room[1] in options.complete_room(in_room[1]):
        return f"{message}; a place is given with `{in_room[1]} --place {in_room[2]}`"
    missing = re.match(r"(.+): no such file", message)
    if missing and (spaced := _spaced(arguments)):
        return f"{message}; {spaced}"
    if missing and os.path.isfile(value := missing[1].partition("=")[2]):
        return f"{message}; did you mean `{value}`?"
    if missing and len(files := re.split("[,:;]", missing[1])) > 1 and all(map(os.path.isfile, files)):
        return f"{message}; write several files with spaces: {' '.join(files)}"
    missing = re.match(r"(.+): no such file(?:.*\(\*(\.\w+)\))?", message)
    return f"{message}{_similar_file(Path(missing[1]), missing[2] or '')}" if missing else message


def _spaced(arguments: Sequence[str]) -> str:
    """Return how to write the name of a file that the shell has divided at a space, or an empty text."""
    name = next(
        (f"{first} {second}" for first, second in pairwise(arguments) if os.path.isfile(f"{first} {second}")), ""
    )
    return f"write the name of the file in quotes: {shlex.quote(name)}" if name else ""


def _similar_file(missing: Path, expected: str) -> str:
    """Return `; did you mean NAME?` for the file with the most similar name, if possible with the `expected` suffix."""
    try:
        files = [*islice(missing.parent.iterdir(), _MOST_FILES)]
    except (OSError, ValueError):  # ValueError: a NUL in the name
        return ""
    suffix = missing.suffix if missing.suffix not in ("", expected) else expected
    stems = [path.stem for path in files if path.suffix == suffix]
    same_stem = [path.name for path in files if path.stem == missing.stem]
    near = [
        *(stem + suffix for stem in difflib.get_close_matches(missing.stem, stems, n=1, cutoff=_ALIKE)),
        *difflib.get_close_matches(missing.name, same_stem, n=1, cutoff=0.0),
        *(path.name for path in files if path.suffix and missing.name.startswith(f"{path.name}.")),
    ]
    return f"; did you mean `{missing.with_name(near[0])}`?" if near else ""


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


# kept: a program may run many command lines, and building the parser takes longer than most of them
_command = functools.cache(typer.main.get_command)


def _status(arguments: list[str] | None) -> int:
    command = _command(app)
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given[:1] == ["-v"] and len(given) > 1:
        return _refuse(
            f"-v: prints the version; did you mean `{shlex.join(['sonarhw', '--verbose', *given[1:]])}`?",
            ExitStatus.BAD_INPUT,
        )
    if given[:1] in (["-h"], ["--help"]):  # of the command, if one follows
        given = [*given[1:], given[0]]
    if "_SONARHW_COMPLETE" in os.environ:  # set by the script that --install-completion writes
        command.main(prog_name="sonarhw")
    try:
        # command.main() is not used: it gives Ctrl-C and a closed pipe other exit statuses
        with command.make_context("sonarhw", given) as context:
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
