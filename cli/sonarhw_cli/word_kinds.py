"""What a word on the command line names, and what an argument or an option expects.

A file is recognised by its content, so that a file of another kind is refused with the command or the option that
reads it.
"""

import os
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer

from sonarhw.errors import InputError
from sonarhw.files import NO_DATA, no_data

_START = 65_536  # bytes of a file that decide
_NAMED = 3  # files of a folder that a message names
_MOST_FILES = 1000  # of a folder that are looked at
_LOG_START = b"\x89MCAP0"
# lines of the TOML files of this program
_TOML = (
    (rb"(?m)^\[\[rooms\]\]|^rooms *=", "study"),
    (rb"(?m)^\[\[(walls|posts)\]\]|^walls *=|^\[(materials|places)\b", "room"),
    (rb"(?m)^(aperture_radius|frequency|blanking|threshold_db) *=", "board"),
)
_LOG_FILE = ".mcap"
_DRAWINGS = (".dxf", ".geojson", ".sdf", ".svg", ".world", ".yaml", ".yml")
_URL = re.compile(r"/dev/(tty|cu\.|serial)|COM\d+$|[a-z0-9]{3,}://|(fake|lines):")
# what each kind is, and what to do with it; `{name}` is the word
_KINDS = {
    "log": (
        "a log",
        "`sonarhw compare {name}` explains it, `sonarhw gui {name}` shows it, `sonarhw replay {name}` serves it",
    ),
    "room": (
        "a room file",
        "`sonarhw simulate {name}` predicts a scan in it, `sonarhw fake {name}` serves a scanner in it",
    ),
    "shipped room": ("a shipped room", "`sonarhw simulate {name}` predicts a scan in it"),
    "board": ("a board profile", "edit it as text, and `sonarhw profile check {name}` checks it"),
    "shipped board": ("a shipped board", "`sonarhw simulate ROOM --board {name}` predicts with it"),
    "study": ("a study file", "`sonarhw study {name}` predicts its scans"),
    "drawing": ("a file of another program", "`sonarhw room import {name}` converts a map or a drawing to a room file"),
    "scan": ("a file of another program", "`sonarhw import {name} --out LOG.mcap` converts a scan of another program"),
    "folder": ("a folder", "give the name of a file in it{such}"),
    "URL": ("the URL of a scanner", "`sonarhw scan {name} --out LOG.mcap` records a log"),
    **NO_DATA,
}
# commands for words of another kind than a command of the first name expects
_OTHER_COMMANDS = {
    ("check", "room"): "`sonarhw room check {name}` checks it",
    ("check", "board"): "`sonarhw profile check {name}` checks it",
    ("import", "log"): "`sonarhw map {name} --out ROOM.toml` finds the room",
}
_ROOM, _BOARD, _LOG = "room|shipped room", "board|shipped board", "log"
# what an argument or an option expects: its metavar or its name, the kinds, and their description
_EXPECTED = {
    "LOG": (_LOG, "a log (*.mcap)"),
    "--with": (_LOG, "a log (*.mcap)"),
    "ROOM": (_ROOM, "a room: NAME or FILE.toml"),
    "--room": (_ROOM, "a room: NAME or FILE.toml"),
    "PROFILE": (_BOARD, "a board profile: NAME or FILE.toml"),
    "--board": (_BOARD, "a board profile: NAME or FILE.toml"),
    "SPEC": ("study", "a study file (*.toml)"),
    "URL": ("URL|log", "the URL of a scanner, or a log"),
    "URL|LOG": ("URL|log", "the URL of a scanner, or a log"),
    "PORT": ("URL", "a serial port such as /dev/ttyUSB0"),
    "LOG|SCAN|URL|ROOM": (f"{_LOG}|scan|URL|drawing|folder|{_ROOM}", "a log, a scan, a room or the URL of a scanner"),
    "FILE.csv": ("scan", "a CSV file"),
}
# the two commands that convert files of other programs
_IMPORTED = {
    "import_scan": ("scan|log|folder|drawing", "a scan of another program"),
    "import_room_file": ("scan|drawing", "a map or a drawing of another program"),
}
_VALUES = {"int": "INTEGER", "float": "NUMBER", "path": "FILE", "str": "TEXT"}  # of Python types


def kind_of(word: str) -> str:
    """Return the kind of what a word names, a key of `_KINDS`. It is empty for another word."""
    if not word or os.path.isdir(word):
        return "folder" if word else ""
    if os.path.isfile(word):
        return _kind_of_file(Path(word))
    if re.fullmatch(r"[a-z][\w-]*", word):
        return _kind_of_name(word)
    return "URL" if _URL.match(word) else _LOG if word.endswith(_LOG_FILE) else ""


def _kind_of_name(word: str) -> str:
    from sonarhw_sim.files import SHIPPED_BOARDS, SHIPPED_ROOMS  # reads TOML, which loads slowly

    if word in SHIPPED_ROOMS.names():
        return "shipped room"
    return "shipped board" if word in SHIPPED_BOARDS.names() else ""


def _kind_of_file(path: Path) -> str:
    try:
        with path.open("rb") as file:
            start = file.read(_START)
    except OSError:
        return ""
    if start.startswith(_LOG_START):  # it contains the text of its room
        return "log"
    if other := no_data(path.name, start):
        return other
    suffix = path.suffix.lower()
    own = next((kind for pattern, kind in _TOML if re.search(pattern, start)), "")
    if own or suffix in ("", ".toml"):
        return own
    # a damaged log is read as a log, which says what is wrong with it
    if not start or suffix == _LOG_FILE:
        return ""
    return "drawing" if suffix in _DRAWINGS else "scan"


def expected_of(parameter: Any, command: Any = None) -> tuple[str, str]:
    """Return the kinds that an argument or an option expects, and their description; empty texts for other values."""
    imported = _IMPORTED.get(getattr(getattr(command, "callback", None), "__name__", ""))
    if imported and parameter.param_type_name == "argument":
        return imported
    is_input = parameter.param_type_name == "argument" or parameter.name == "poses"
    names = [*parameter.opts, parameter.metavar if is_input else None]
    return next((_EXPECTED[name] for name in names if name in _EXPECTED), ("", ""))


def check_kinds(context: typer.Context) -> None:
    """Raise InputError if an argument or an option names a file, a room or a scanner of another kind than expected."""
    for parameter in context.command.params:
        kinds, expected = expected_of(parameter, context.command)
        for word in _words_of(context.params.get(parameter.name or "")) if kinds else ():
            kind = kind_of(word)
            is_missing_log = kind == _LOG and not os.path.exists(word)
            if kind and kind not in kinds.split("|") and not is_missing_log:
                option = f"{parameter.opts[0]} " if parameter.param_type_name == "option" else ""
                advice = _advice(word, kind, parameter, context)
                raise InputError(f"{option}{word}: is {_KINDS[kind][0]}; expected {expected}; {advice}")


def _words_of(value: object) -> Iterator[str]:
    values = value if isinstance(value, list | tuple) else [value] if value else []
    return map(str, values)


def _advice(word: str, kind: str, parameter: Any, context: typer.Context) -> str:
    """Return what to do with a word of another kind than a parameter expects: another option, or another command."""
    if parameter.metavar == "URL" and kind in _ROOM.split("|"):
        record = f"sonarhw {context.info_name} URL --room {shlex.quote(word)}"
        out = f" --out {shlex.quote(str(context.params['out']))}" if context.params.get("out") else ""
        has_room = any("--room" in option.opts for option in context.command.params)
        scanned = (
            f"; with another scanner, write `{record}{out}`; `sonarhw ports` lists the scanners" if has_room else ""
        )
        return f"'fake:{word}?place={_only_place(word)}' is a fake scanner in it{scanned}"
    if other := _OTHER_COMMANDS.get((context.info_name or "", kind.rpartition(" ")[2])):
        return other.format(name=shlex.quote(word))
    if taking := option_taking(word, context, parameter):
        return f"give it with `{taking}`"
    kinds = expected_of(parameter, context.command)[0].split("|")
    inside = sorted(Path(word).iterdir())[:_MOST_FILES] if kind == "folder" else []
    named = [shlex.quote(str(path)) for path in inside if kind_of(str(path)) in kinds][:_NAMED]
    return _use(kind, word, f", such as {', '.join(named)}" if named else "")


def _only_place(room: str) -> str:
    """Return the place of a room that has one place; NAME of others."""
    from sonarhw_sim.room.room import load_room

    try:
        places = [*load_room(room).places]
    except InputError:
        places = []
    return places[0] if len(places) == 1 else "NAME"


def use_of(word: str) -> str:
    """Return what to do with a word by its kind, such as the command that reads it; empty for another word."""
    kind = kind_of(word)
    return _use(kind, word) if kind else ""


def _use(kind: str, word: str, such: str = "") -> str:
    return _KINDS[kind][1].format(name=shlex.quote(word), such=such)


def option_taking(word: str, context: typer.Context, but: Any = None) -> str:
    """Return an option of the command that takes a word, with the word: by its choices, the kind or the ending."""
    kind, ending = kind_of(word), Path(word).suffix
    for parameter in context.command.params:
        if parameter.param_type_name != "option" or parameter is but or getattr(parameter, "is_flag", False):
            continue
        value = written_option(parameter, context).partition(" ")[2]
        is_choice = not kind and "." not in value and "|" in value and word in value.split("|")
        is_kind = kind and kind in expected_of(parameter)[0].split("|")
        is_written = not expected_of(parameter)[0] and re.search(rf"[|.]{re.escape(ending[1:])}\b", value)
        if is_choice or is_kind or (ending and not kind and is_written):
            return f"{parameter.opts[0]} {shlex.quote(word)}"
    return ""


def written_option(option: Any, context: typer.Context) -> str:
    """Return an option with its value, as `--out LOG.mcap`."""
    name, _ = option.get_help_record(context) or ("", "")
    return plain(option, name)


def plain(parameter: Any, name: str) -> str:
    """Return an argument as in the usage, and an option with the value that it expects, not with its Python type."""
    if parameter.param_type_name == "argument":
        return f"{parameter.display_name_raw}{'...' if parameter.nargs != 1 else ''}"
    return re.sub(r"<(?:list\[)?([^] >]+)[^>]*>", lambda type_: _VALUES.get(type_[1], type_[1]), name)
