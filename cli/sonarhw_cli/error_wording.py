"""The wording of errors for people who type commands: with options, with what was expected, and with what to do."""

import re
from collections.abc import Sequence

import typer

from sonarhw.errors import SonarError

# phrases in the messages of the option parser about numbers, and their replacements
_REWORDED = (
    ("Value error, ", ""),
    ("Input should be a valid integer, unable to parse string as an integer", "expected a whole number"),
    ("Input should be a valid number, unable to parse string as a number", "expected a number"),
    ("Input should be ", "expected a number "),
)

# options in errors of the library, which names none: it serves the window and Python programs too
_OPTIONS = (
    (r"^(free|prior|fit|pings) (?=\S+: )", r"--\1 "),
    (r"^places: expected", "--place: expected"),
    (r"; free it too, or", "; add it to --free, or"),
    (r"; give a room$", "; give one with --room"),
    (r"; give a place, or free the position$", "; give --place, or add position to --free"),
    (r"; give a place, or X,Y in metres;", "; give --place NAME or --place X,Y in metres;"),
    (r": give a place, or X,Y in metres;", ": give --place NAME or --place X,Y in metres;"),
)


def library_message(error: SonarError, arguments: Sequence[str]) -> str:
    """Return an error of the library with the names of the options that the reader needs."""
    message = str(error)
    for words, option in _OPTIONS:
        message = re.sub(words, option, message)
    return _with_argument_hint(message, arguments)


def parser_message(error: typer.TyperException, arguments: Sequence[str]) -> str:
    """Return an error of the option parser. Without a command, it is the help, which begins with `Usage:`."""
    return _with_argument_hint(_with_help(_reworded(error), error), arguments)


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


def _with_help(message: str, error: typer.TyperException) -> str:
    """Return the message with the command that lists arguments and options, if one is missing or unknown."""
    context = getattr(error, "ctx", None)
    if context is not None and (group := _group_with_command(message, context.command)):
        return f"{message.partition('.')[0]}; did you mean `{context.command_path} {group}`?"
    if context is None or message.endswith("?") or not message.startswith(("Missing ", "No such ", "Got unexpected ")):
        return message
    return f"{message.rstrip('.')}; see `{context.command_path} --help`"


def _group_with_command(message: str, root: object) -> str:
    """Return `log export` for the message that `export` is unknown; empty if no group has such a command."""
    unknown = re.match(r"No such command '([^']*)'", message)
    groups: dict[str, object] = getattr(root, "commands", {})
    found = (
        f"{name} {unknown[1]}"
        for name, group in groups.items()
        if unknown and unknown[1] in getattr(group, "commands", {})
    )
    return next(found, "")


def _with_argument_hint(message: str, arguments: Sequence[str]) -> str:
    """Return the message with how to write X,Y or a second log if there is an argument too many."""
    is_extra = message.startswith("Got unexpected extra argument")
    if (is_extra or message.startswith("--place: expected one for each")) and any(
        one.endswith(",") for one in arguments
    ):
        return f"{message}; write X,Y without a space"
    if is_extra and "compare" in arguments:
        return f"{message}; to compare two logs, use `sonarhw compare A.mcap --with B.mcap`"
    return message
