"""What a refused command line is answered with: the error, what was expected, and what to write instead.

Only a refused command line loads this module. The rules about one kind of error are in their order: the first answer
is printed.
"""

import difflib
import os
import re
import shlex
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, pairwise, takewhile
from pathlib import Path
from typing import Any

import typer

from sonarhw_cli import options, other_words
from sonarhw_cli.word_kinds import expected_of, kind_of, option_taking, use_of, written_option

_SHORTENED = 3  # letters of a command at least, such as `sim`
_ALIKE = 0.75  # similarity of a word that is proposed; below, it is another word
_OPTION_ALIKE = 0.8  # the same for options of this command
_VERY_ALIKE = 0.85  # the same for options of other commands
_VAGUE = ("file", "name", "path", "the")  # parts of words such as --room-file
_MOST_FILES = 1000  # of a folder that are compared with a name
_MOST_LISTED = 6  # options of a command with few
_UNIT = re.compile(r"(degrees|metres|seconds|Hz|°C|m/s)\b")
_PLACE = re.compile(r"[a-z]\w*|-?[\d.]+(,-?[\d.]+){1,2}")
_NUMBERS, _NAMES = re.compile(r"-?[\d.,]+"), re.compile(r"[a-z_]+,?")
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
_HELP = ("help", "man")
_OF_A_FILE = {"log": "info", "profile": "check", "room": "check"}  # the command of a group that describes a file
# phrases in the messages of the option parser about numbers, and their replacements
_REWORDED = (
    ("Value error, ", ""),
    ("Input should be a valid integer, unable to parse string as an integer", "expected a whole number"),
    ("Input should be a valid number, unable to parse string as a number", "expected a number"),
    ("Input should be ", "expected a number "),
)


@dataclass(frozen=True)
class _Line:
    """A refused command line, and what its command accepts."""

    arguments: Sequence[str]
    context: typer.Context

    @cached_property
    def path(self) -> str:
        """The command, as `sonarhw room new`."""
        return self.context.command_path

    @cached_property
    def see(self) -> str:
        """Where arguments and options are listed."""
        return f"see `{self.path} --help`"

    @cached_property
    def is_program(self) -> bool:
        """Whether the line is refused before its command."""
        return self.context.parent is None

    @cached_property
    def parameters(self) -> Sequence[Any]:
        """Arguments and options."""
        return self.context.command.params

    @cached_property
    def accepted(self) -> Sequence[Any]:
        """Arguments that stand without an option before them."""
        return [parameter for parameter in self.parameters if parameter.param_type_name == "argument"]

    @cached_property
    def options(self) -> Mapping[str, Any]:
        """Options by their names."""
        parameters = [parameter for parameter in self.parameters if parameter.param_type_name == "option"]
        return {name: parameter for parameter in parameters for name in parameter.opts}

    @cached_property
    def flags(self) -> set[str]:
        """Options without a value."""
        return {name for name, parameter in self.options.items() if getattr(parameter, "is_flag", False)}

    @cached_property
    def commands(self) -> Mapping[str, Any]:
        """Commands of a group."""
        return getattr(self.context.command, "commands", {})

    @cached_property
    def shown_commands(self) -> Sequence[str]:
        """Commands of a group that its help lists."""
        return [name for name, command in self.commands.items() if not command.hidden]

    def members(self, group: str) -> Mapping[str, Any]:
        """Return the commands of one of the commands, if it is a group."""
        return getattr(self.commands.get(group), "commands", {})

    @cached_property
    def program_commands(self) -> Mapping[str, Any]:
        """Commands and groups of the whole program."""
        return getattr(self.context.find_root().command, "commands", {})

    @cached_property
    def all_commands(self) -> Sequence[tuple[str, Any]]:
        """All commands of the program by how they are written, but the hidden ones."""
        waiting: list[tuple[str, Any]] = [("sonarhw", self.context.find_root().command)]
        commands: list[tuple[str, Any]] = []
        for path, command in waiting:
            parts = getattr(command, "commands", None)
            if parts is None:
                commands.append((path, command))
            else:
                waiting.extend((f"{path} {name}", part) for name, part in parts.items() if not part.hidden)
        return commands

    @cached_property
    def usage(self) -> str:
        """The command with its arguments and required options, as `sonarhw scan URL --out LOG.mcap`."""
        pieces = [piece for piece in self.context.command.collect_usage_pieces(self.context) if piece != "[OPTIONS]"]
        required = [self.written(name) for name, option in self.options.items() if option.required]
        return " ".join([self.path, *pieces, *required])

    def written(self, name: str) -> str:
        """Return an option with its value, as `--out LOG.mcap`."""
        return written_option(self.options[name], self.context) if name in self.options else name

    def kinds_of(self, argument: Any) -> Sequence[str]:
        """Return the kinds of words that an argument of the command expects."""
        return expected_of(argument, self.context.command)[0].split("|")

    def instead_of(self, word: str) -> str:
        """Return what the command expects in place of an option of another program."""
        return other_words.instead_of(word, self.parameters)

    @cached_property
    def missing_argument(self) -> str:
        """The required argument, if the command is run with options alone."""
        path = self.path.split()
        words = [path[-1], *self.arguments[len(path) - 1 :]]
        behind = [word for before, word in pairwise(words) if before[:1] != "-" or before in self.flags]
        is_given = any(word[:1] != "-" for word in behind)
        return "" if is_given else _first(argument.metavar for argument in self.accepted if argument.required)

    @cached_property
    def argument_expected(self) -> str:
        """Where the missing argument stands."""
        where = f"where {self.missing_argument} stands without an option before it"
        return f"expected `{self.usage}`, {where}; {self.see}" if self.missing_argument else ""

    @cached_property
    def divided_name(self) -> str:
        """How to write the name of a file that the shell has divided at a space."""
        names = (f"{first} {second}" for first, second in pairwise(self.arguments))
        name = _first(filter(os.path.isfile, names))
        return f"write the name of the file in quotes: {shlex.quote(name)}" if name else ""


def _first(answers: Iterable[str]) -> str:
    """Return the first answer that is not empty. A generator of answers computes no others."""
    return next(filter(None, answers), "")


def _joined(*parts: str) -> str:
    return "; ".join(filter(None, parts))


def _line_of(arguments: Sequence[str], program: Any) -> _Line:
    """Return the command line of the command in the arguments, without its values."""
    context = typer.Context(program, info_name="sonarhw")
    for argument in arguments:
        if command := getattr(context.command, "commands", {}).get(argument):
            context = typer.Context(command, info_name=argument, parent=context)
    return _Line(arguments, context)


# Errors of the option parser.


def parser_message(error: typer.TyperException, arguments: Sequence[str], program: Any) -> str:
    """Return an error of the option parser. Without a command, it is the help, which begins with `Usage:`."""
    message = _reworded(error)
    if without := re.fullmatch(r"Option '([^']+)' requires an argument\.", message):
        # this error does not contain the command
        return f"{without[1]}: expected a value, as in `{_line_of(arguments, program).written(without[1])}`"
    context = getattr(error, "ctx", None)
    if context is None:
        return message
    line = _Line(arguments, context)
    for start, answer in _ANSWERS.items():
        if message.startswith(start):
            return answer(message.rstrip("."), line)
    is_argument = getattr(getattr(error, "param", None), "param_type_name", "") == "argument"
    return _about_argument(message.rstrip("."), line) if is_argument else message


def _reworded(error: typer.TyperException) -> str:
    """Return the message of the option parser; about a value, as `--step x: expected a number`."""
    from pydantic import ValidationError

    message = error.format_message()
    for theirs, ours in _REWORDED:
        message = message.replace(theirs, ours)
    choice = re.fullmatch(r"Invalid value for '([^']+)': '(.*)' is not one of '(.*)'\.", message, re.DOTALL)
    if choice is not None:
        return _about_choice(choice[1], choice[2], choice[3].split("', '"))
    rejected = re.match(r"Invalid value for '([^']+)': (expected .*)", message)
    if rejected is None or not isinstance(error.__cause__, ValidationError):
        return message
    given = str(error.__cause__.errors()[0]["input"])
    hint = _about_number(rejected[1], given, getattr(error, "param", None))
    return f"{rejected[1]} {given}: {rejected[2]}{hint}"


def _about_choice(option: str, given: str, choices: Sequence[str]) -> str:
    several = "; give the option once for each" if {*given.split(",")} <= {*choices} else ""
    return f"{option} {given}: expected {', '.join(choices[:-1])} or {choices[-1]}{several}"


def _about_number(option: str, given: str, parameter: Any) -> str:
    """Return how to write a number that the parser rejects, to be put behind what it expects."""
    if share := re.fullmatch(r"([\d.]*\d) ?%", given):
        return f" without %, such as {float(share[1]) / 100:g}"
    if getattr(parameter, "multiple", False) and re.fullmatch(r"[\d.]+(,[\d.]+)+", given):
        return f"; repeat the option: {' '.join(f'{option} {part}' for part in given.split(','))}"
    if re.fullmatch(r"-?\d+,\d+", given):
        return f" with a decimal point, such as {given.replace(',', '.')}"
    ends = re.fullmatch(r"(-?[\d.]*\d)(?:\.\.+|[-:,;]|to)(-?[\d.]*\d).*", given)
    if ends and option in ("--from", "--to", "--step"):
        return f"; write --from {ends[1]} --to {ends[2]} --step DEG"
    unit = _UNIT.search(getattr(parameter, "help", None) or "")
    has_unit = re.match(r"-?[\d.]+ ?[^\d.,\s/+*e-]", given)
    return f", in {unit[1]} and without a unit" if unit and has_unit else ""


def _about_argument(message: str, line: _Line) -> str:
    """Return the message about a missing or invalid argument, or a missing option, with the usage."""
    hint = "`sonarhw ports` lists the scanners" if re.match("Missing argument '(URL|PORT)'", message) else ""
    if message.startswith("Missing argument 'ROOM'"):
        hint = "`sonarhw room list` lists the shipped rooms"
    value = message.partition(" ")[2].partition(": expected")[0]
    if kind_of(value) == "URL":
        hint = "write them in this order"
    elif value.startswith("--"):
        hint = "arguments stand without an option before them"
    elif message.startswith("Missing argument") and (taken := _first(_taken_by_option(line))):
        hint = taken
    elif message.startswith("Missing ") and any(re.search(r":.+\?\w+=[^&]*$", word) for word in line.arguments[-1:]):
        hint = "write the URL in quotes, because the shell reads & as the end of the command"
    return _joined(message, f"expected `{line.usage}`", hint, line.see)


def _taken_by_option(line: _Line) -> Iterator[str]:
    """Yield that an option took the word that an argument expects, such as a log, as its value."""
    kinds = {kind for argument in line.accepted for kind in line.kinds_of(argument)}
    for option, value in pairwise(line.arguments):
        if option not in line.options or option in line.flags or Path(value).suffix in line.written(option):
            continue  # a flag takes none, and the value may be meant for the option
        if os.path.exists(value) and kind_of(value) in kinds - {""}:
            yield f"{option} took {value} as its value: write `{line.path} {value} {option} VALUE`"


# Unknown commands.


def _about_command(message: str, line: _Line) -> str:
    """Return the message about an unknown command with the one that it probably means, or those that exist."""
    # the parser writes odd characters of the word in another way, and names similar commands, among them hidden ones
    word = _first(argument for argument in line.arguments if message.startswith(f"No such command {argument!r}"))
    message = message.partition(". Did you mean")[0]
    answers = _commands_for if line.is_program else _members_for
    if word and (command := _first(answers(word, line))):
        return f"{message}; {_meant(f'sonarhw {command}')}"
    commands = "" if line.is_program else f"its commands: {', '.join(line.commands)}"
    return _joined(message, commands, line.see)


def _commands_for(word: str, line: _Line) -> Iterator[str]:
    """Yield the commands that an unknown one may mean, without the name of the program, the most probable first."""
    following = line.arguments[line.arguments.index(word) + 1 :]
    later = _first(name for name in following if name in line.commands)
    if word in _HELP:
        yield " ".join([*following, "--help"])
    yield from (f"{group} {word}" for group in line.commands if word in line.members(group))
    if following[:1] == [later] and not kind_of(word):
        yield later
    longer = [name for name in line.shown_commands if name.startswith(word)]
    if len(longer) == 1 and len(word) >= _SHORTENED:
        yield longer[0]
    if first := _first_command(word):
        yield f"{later} {word}" if later else first
    yield from _commands_of_parts(word, line)
    yield _nearest(word, line.shown_commands)
    yield other_words.COMMANDS.get(_nearest(word, other_words.COMMANDS), "")
    yield from map(_first_command, line.arguments)


def _commands_of_parts(word: str, line: _Line) -> Iterator[str]:
    """Yield the commands for the parts of a word such as `list-rooms`."""
    parts = re.split("[-_]", word)
    named = ["profile" if part == "board" else part for part in parts]
    yield from (f"{group} {member}" for group in named for member in named if member in line.members(group))
    yield other_words.COMMANDS.get(word, "")
    shown = {name: name for name in line.shown_commands}
    yield from ((shown | other_words.COMMANDS).get(part, "") for part in parts if part not in other_words.ANY)


def _first_command(word: str) -> str:
    """Return the command for a file, a scanner or a room that is given without one; empty for other words."""
    guessed = "room" if word.endswith(".toml") else "URL" if re.match("[a-z0-9]+:", word) else ""
    return _FIRST_COMMANDS.get(kind_of(word) or guessed, "").format(word)


def _members_for(word: str, line: _Line) -> Iterator[str]:
    """Yield the commands that an unknown one of a group may mean, without the name of the program."""
    group, following = line.context.info_name or "", line.arguments[line.arguments.index(word) + 1 :]
    if word in _HELP:
        yield " ".join([group, *following, "--help"])
    if group == "room" and other_words.COMMANDS.get(word) == "gui":
        yield "gui"
    for name, others in other_words.COMMANDS_OF_GROUPS.items():
        if name in line.commands and word in others.split():
            yield f"{group} {name}"
    is_name = "." in word or "/" in word or word in options.complete_room(word)
    if word not in other_words.ANY and not is_name:
        yield word if word in line.program_commands else other_words.COMMANDS.get(word, "")
    if near := _nearest(word, line.shown_commands):
        yield f"{group} {near}"
    writes = "export" in line.commands and "--out" in line.arguments
    describes = "export" if writes else _OF_A_FILE.get(group, "")
    if command := _first(name for name in following if name in line.commands) or (describes if is_name else ""):
        yield f"{group} {command} {word}"


def _nearest(word: str, names: Iterable[str], alike: float = _ALIKE) -> str:
    return _first(difflib.get_close_matches(word, names, n=1, cutoff=alike))


def _meant(*names: str) -> str:
    return f"did you mean {' or '.join(f'`{name}`' for name in names)}?" if any(names) else ""


# Unknown options.


@dataclass(frozen=True)
class _UnknownOption:
    line: _Line
    option: str

    @cached_property
    def word(self) -> str:
        return self.option.lstrip("-")

    @cached_property
    def value(self) -> str:
        """The argument behind it."""
        return _first(value for given, value in pairwise(self.line.arguments) if given == self.option)

    @cached_property
    def parts(self) -> Sequence[str]:
        """Parts of a word such as --room-file, the last first."""
        return [part for part in reversed(re.split("[-_]", self.word)) if len(part) > 1 and part not in _VAGUE]

    @cached_property
    def elsewhere(self) -> Mapping[str, str]:
        """What it does in other commands, by these."""
        all_commands = self.line.all_commands
        return {path: p.help or "" for path, command in all_commands for p in command.params if self.option in p.opts}

    @cached_property
    def close(self) -> Sequence[str]:
        """Options of the command of which it is probably a misspelling."""
        alike = [] if self.elsewhere else difflib.get_close_matches(self.option, self.line.options, cutoff=_ALIKE)
        return [name for name in alike if _is_misspelt(self.option, name)]


def _is_misspelt(word: str, name: str) -> bool:
    """Report whether an option is probably a misspelt `name`: of about the same length, or with the same start."""
    is_same_start = word[:6] == name[:6]  # with two hyphens
    ratio = difflib.SequenceMatcher(None, word, name).ratio()
    return word.startswith(name) or (ratio >= _OPTION_ALIKE and (is_same_start or abs(len(word) - len(name)) <= 1))


def _about_option(message: str, line: _Line) -> str:
    """Return the message about an unknown option, with the one that it probably means or what to write instead."""
    option = message.removeprefix("No such option: ").partition(" (")[0]
    unknown = _UnknownOption(line, option)
    answer = _first(_options_for(unknown)) or _first(_other_answers_for(unknown))
    return f"No such option: {option}; {answer}"


def _options_for(unknown: _UnknownOption) -> Iterator[str]:
    """Yield what to write in place of an unknown option, the most probable first."""
    line, option, word = unknown.line, unknown.option, unknown.word
    # -room is read as the option -r
    yield _meant(*(f"-{argument}" for argument in line.arguments if f"-{argument}" in line.options))
    if word in other_words.GLOBAL and not line.is_program:
        yield f"it stands before the command: `sonarhw {other_words.GLOBAL[word]} {line.path.partition(' ')[2]}`"
    yield from (_meant(name) for name in line.options if name.casefold() == option.casefold())
    kinds = [kind for argument in line.accepted[:1] for kind in line.kinds_of(argument)]
    if kind_of(unknown.value) in kinds:
        yield line.argument_expected
    yield from map(_meant, _named_or_valued(unknown))
    for written in _formats(unknown):
        yield _joined(written, line.see) if written else ""
    named_in_part = [f"--{part}" for part in unknown.parts if f"--{part}" in line.options]
    if not line.instead_of(word):
        yield _meant(*named_in_part[:1])
    for instead in map(line.instead_of, (word, word.removesuffix("s"), *unknown.parts)):
        yield _joined(instead, line.see) if instead else ""
    yield _meant(*_longer(unknown)) or _meant(*unknown.close)


def _named_or_valued(unknown: _UnknownOption) -> Iterator[str]:
    """Yield options of the command that are named by the word or by the value of the unknown one."""
    names = [f"--{unknown.word}", f"--{unknown.word.removesuffix('s')}"]
    if not unknown.close:
        names.append(f"--{unknown.value}")
    if len(unknown.word) > 1:
        yield from (name for name in names if name in unknown.line.options)
    if not unknown.close:
        yield _option_with(unknown.value, unknown.line)


def _option_with(value: str, line: _Line) -> str:
    """Return the option that takes a value, by the values that its help lists; empty for an unknown value."""
    if re.fullmatch("[a-z][a-z0-9-]+", value):
        for name, option in line.options.items():
            about = f"{line.written(name).replace(' ', '|')} {option.help}"
            if re.search(rf"([|:,]| or) ?{value}([|,.;]|$)", about):
                return f"{option.opts[0]} {value}"
    return ""


def _formats(unknown: _UnknownOption) -> Iterator[str]:
    """Yield how the format of files is written that the value or the word names."""
    word, value = unknown.word, unknown.value
    if word in ("format", "type"):
        yield _about_format(value, unknown.line)
    elif word in (*other_words.SAVE, *other_words.PICTURES, "record") and not os.path.isfile(value):
        yield _about_format(Path(value).suffix.removeprefix(".").lower(), unknown.line)
    yield _about_format(word, unknown.line)


def _longer(unknown: _UnknownOption) -> Sequence[str]:
    """Return the options of the command that begin with the unknown one."""
    names, option = sorted(unknown.line.options), unknown.option
    if len(unknown.word) == 1 and not unknown.line.is_program:
        return [name for name in names if name.startswith(f"-{option}")][:_MOST_LISTED]
    return [name for name in names if len(unknown.word) > 2 and name.startswith(option)]


def _other_answers_for(unknown: _UnknownOption) -> Iterator[str]:
    """Yield what else to do for what an unknown option may mean."""
    line, option, word = unknown.line, unknown.option, unknown.word
    later = [word for word in line.arguments if word in line.commands]
    behind = (f"options of a command stand behind it: `sonarhw {command} ... {option}`" for command in later)
    if any(option in parameter.opts for command in later for parameter in line.commands[command].params):
        yield from behind
    if word in line.program_commands and not line.program_commands[word].hidden:
        yield f"`sonarhw {word}` is a command of its own"
    yield from behind
    if line.is_program:
        yield from (_meant(f"sonarhw {first}") for first in map(_first_command, line.arguments) if first)
    yield line.argument_expected
    if word in other_words.SAVE:
        yield f"`{line.path} > FILE` writes its output to a file; {line.see}"
    about = _about_word(unknown)
    if unknown.elsewhere:
        does = next(iter(unknown.elsewhere.values())).partition(". ")[0].rstrip(".")
        where = f"it is an option of `{'`, `'.join(islice(unknown.elsewhere, 3))}`: {does}"
        yield _joined(about, where, line.see)
    if 0 < len(line.options) <= _MOST_LISTED:
        yield f"its options: {', '.join(sorted(line.options))}"
    yield _joined(about, line.see)


def _about_word(unknown: _UnknownOption) -> str:
    """Return options whose help contains the word, or the most similar option of another command."""
    line = unknown.line
    word = re.sub("^(no|not|with|without|enable|disable|use)-", "", unknown.word)
    called = other_words.WORDS_OF_HELP.get(word)
    stem = called or re.sub("(ies|y|s)$", "", word.partition("-")[0])
    if len(stem) > _SHORTENED and stem not in ("from", "with"):
        about = re.compile(rf"(?i)\b{re.escape(stem)}")
        names = [name for name, option in line.options.items() if about.search(option.help or "")]
        if written := dict.fromkeys(map(line.written, names)):
            return f"options about {called or word}: `{'`, `'.join(islice(written, 2))}`"
    paths = {name: path for path, command in line.all_commands for p in command.params for name in p.opts}
    near = "" if f"--{word}" in paths else _nearest(f"--{word}", paths, _VERY_ALIKE)
    return f"`{near}` is an option of `{paths[near]}`" if near else ""


# Formats of files.


def _about_format(word: str, line: _Line) -> str:
    """Return how a format of files is written: by an option of this command, or else of others on the same input."""
    word = "png" if word in other_words.PICTURES else word
    if word not in other_words.FORMATS:
        return ""
    if writers := _writers(word, line.context.command, line):
        return f"{word.upper()} is written with `{writers[0]}`"
    out = line.options.get("--out")
    writes = f"this command writes `{line.written('--out')}`" if out else ""
    endings = ", ".join(re.findall(r"\.\w+", out.help or "")) if out and out.metavar in (None, "FILE") else ""
    return _joined(f"{writes}: {endings}" if endings else writes, _written_elsewhere(word, line))


def _written_elsewhere(word: str, line: _Line) -> str:
    """Return what else writes a format of files: a browser, or other commands on the same input."""
    command = line.context.command
    if word == "pdf" and _writers("html", command, line):
        return "a browser prints HTML as PDF"
    argument = next((argument.metavar for argument in line.accepted), None)
    if _writers("mcap", command, line):
        argument = "LOG"  # others read the log that it writes
    same = [(path, c) for path, c in line.all_commands if any(argument == p.metavar for p in c.params[:1])]
    others = [f"`{path} {argument} {option}`" for path, c in same for option in _writers(word, c, line)[:1]]
    if not argument or not others or _writers(word, command, line):
        return ""
    exports = [other for other in others if "export" in other]  # of any log; a track needs poses
    return f"{word.upper()} is written by {' or '.join(dict.fromkeys(exports or (others[0], others[-1])))}"


def _writers(word: str, command: Any, line: _Line) -> list[str]:
    """Return the options of a command that write a format of files, as `--out FILE.csv`."""
    writers = []
    for parameter in command.params:
        if not {*parameter.opts} & {"--out", "--plot", "--json"}:
            continue
        name, _, value = written_option(parameter, line.context).partition(" ")
        about = f"{value} {parameter.help} {command.help if name == '--out' and value.startswith('FILE') else ''}"
        if name == f"--{word}":
            writers.append(name)
        elif re.search(rf"[|.]{word}\b", about):
            writers.append(f"{name} FILE.{word}")
    return writers


# Arguments too many.


@dataclass(frozen=True)
class _Extra:
    line: _Line
    all: str  # of them, as the parser lists them

    @cached_property
    def word(self) -> str:
        """The first one."""
        return self.all.split(" ")[0]

    @cached_property
    def before(self) -> str:
        """The argument before it."""
        return _first(before for before, word in pairwise(self.line.arguments) if word == self.word)

    @cached_property
    def words(self) -> Sequence[str]:
        """All arguments of the command that stand without an option."""
        values = [self.line.context.params.get(argument.name) for argument in self.line.accepted]
        return [*map(str, filter(None, values)), *(w for w in self.line.arguments if f" {w} " in f" {self.all} ")]

    @cached_property
    def same(self) -> Sequence[str]:
        """Those of the kind that the command accepts."""
        kinds = [kind for argument in self.line.accepted[:1] for kind in self.line.kinds_of(argument)]
        return [word for word in self.words if (kind := kind_of(word)) and kind in kinds]

    @cached_property
    def others(self) -> Sequence[str]:
        return [word for word in self.words if word not in self.same]


def _about_extra(message: str, line: _Line) -> str:
    """Return the message about an argument too many, with how to write a place, a size, a room or a second log."""
    extra = _Extra(line, message.removesuffix(")").rpartition("(")[2])
    if extra.word.startswith("--"):
        return _about_option(f"No such option: {extra.word}", line)
    if meant := _mistyped_option(extra) or _command_of(extra):
        return f"{message}; {_meant(meant)}"
    hint = _first(_values_for(extra)) or _first(_uses_of(extra))
    return _joined(message, f"expected `{line.usage}`", line.see, hint)


def _mistyped_option(extra: _Extra) -> str:
    # place=desk, or a dash of a text editor in place of two hyphens
    meant = re.fullmatch(r"([—–−]?-?)([a-z][a-z-]*)(?:=(.+))?", extra.word)
    if meant is None or f"--{meant[2]}" not in extra.line.options or not (meant[1] or meant[3]):
        return ""
    return f"--{meant[2]} {meant[3] or ''}".rstrip()


def _command_of(extra: _Extra) -> str:
    command = "" if extra.line.accepted else other_words.COMMANDS.get(extra.word, "")
    if extra.word in other_words.ANY:
        command = other_words.COMMANDS.get(f"{extra.line.context.info_name}s", command)
    return f"sonarhw {command}" if command else ""


def _values_for(extra: _Extra) -> Iterator[str]:
    """Yield how to write a value, or values, of which an argument too many is a part."""
    line, word = extra.line, extra.word
    if extra.before.startswith("socket://") and word.isdecimal():
        yield f"write `{extra.before}:{word}`"
    if re.fullmatch(r"\d{4,}", word):
        yield line.instead_of("baud")
    if word in ("from", "to", "step", "by") and "--step" in line.options:
        yield "write --from DEG --to DEG --step DEG"
    if "--size" in line.arguments and re.fullmatch(r"-?[\d.]+|[x×*]|by|[\d.]+(m|cm|mm)", word):
        yield "write WxD in metres without a space, such as --size 3.2x2.4"
    yield _without_space(word, line)


def _without_space(word: str, line: _Line) -> str:
    """Return how to write a list or several values of an option whose values are separated by spaces."""
    arguments = line.arguments
    row = next((k for k in range(2, len(arguments)) if arguments[k] == word and arguments[k - 2].startswith("--")), 0)
    option = arguments[row - 2] if row else ""
    value = _NUMBERS if _NUMBERS.fullmatch(word) else _NAMES
    if option not in line.options or option in line.flags or kind_of(word) or not value.fullmatch(word):
        return ""
    values = [arguments[row - 1], *takewhile(value.fullmatch, arguments[row:])]
    written = line.written(option)
    if "," in written and (value is _NUMBERS or "|" not in written):
        decimals = all(re.fullmatch(r"-?\d+,\d+", part) for part in values)
        parts = [part.replace(",", ".") if decimals else part.rstrip(",") for part in values]
        return f"write `{option} {','.join(parts)}`{' with decimal points and' if decimals else ''} without a space"
    is_many = getattr(line.options[option], "multiple", False)
    return f"repeat the option: `{' '.join(f'{option} {part}' for part in values)}`" if is_many else ""


def _uses_of(extra: _Extra) -> Iterator[str]:
    """Yield what to do with an argument too many, the most probable first."""
    line, word = extra.line, extra.word
    if not line.accepted:
        yield line.instead_of(kind_of(word).rpartition(" ")[2].lower())
        yield use_of(word)
        if Path(word).suffix:
            yield f"`{line.path} > {shlex.quote(word)}` writes its output to a file"
    yield _flag_before(extra)
    if "compare" in line.arguments and len(extra.same) == 2:
        yield "to compare two logs, use `sonarhw compare A.mcap --with B.mcap`"
    if line.accepted and not extra.others:
        several = "`sonarhw fit` and `sonarhw map` take several" if line.accepted[0].metavar == "LOG" else ""
        yield _joined(f"it takes one {line.accepted[0].metavar}: run it once for each", several)
    for other in extra.others:
        if taking := option_taking(other, line.context):
            yield f"give it with `{taking}`"
    if "LOG" in line.usage and Path(word).suffix != ".mcap" and os.path.isfile(word):
        yield f"`sonarhw import {word} --out LOG.mcap` converts a scan of another program"
    yield from _uses_of_value(extra)


def _flag_before(extra: _Extra) -> str:
    pairs = pairwise(extra.line.arguments)
    flag = _first(flag for flag, word in pairs if flag in extra.line.flags and word in extra.others)
    file = _first(word for word in extra.others if Path(word).suffix)
    writes = f"`> {shlex.quote(file)}` behind the command writes its output to a file" if file else ""
    return _joined(f"{flag} takes no value", writes) if flag else ""


def _uses_of_value(extra: _Extra) -> Iterator[str]:
    """Yield what to do with a number, a part of a name or the name of a place."""
    line, word = extra.line, extra.word
    numbers = [option for option in map(line.written, line.options) if re.search(" (INTEGER|NUMBER)$", option)]
    if numbers and re.fullmatch(r"-?[\d.]+", word):
        yield f"numbers are given with options, such as `{'`, `'.join(numbers[:3])}`"
    row = line.arguments.index(word) if word in line.arguments else 0
    if row > 1 and line.arguments[row - 2] in line.options:
        yield f"{line.arguments[row - 2]} takes one value"
    yield line.divided_name
    place = _first(extra.others) or word
    if "--place" not in line.options:
        yield f"{line.accepted[0].metavar} is {extra.same[0]}: leave out {place}" if extra.same else ""
    elif "--place" not in line.arguments and _PLACE.fullmatch(place):
        yield f"give a place with `--place {place}`"


# by the start of the message of the parser
_ANSWERS = {
    "No such option: ": _about_option,
    "No such command ": _about_command,
    "Got unexpected ": _about_extra,
    "Missing ": _about_argument,
}


# Errors of commands, which the library refuses.


def command_message(message: str, arguments: Sequence[str], program: Any) -> str:
    """Return the message of a command with what to write instead, if the words of its line show it."""
    line = _line_of(arguments, program)
    matches = ((re.match(pattern, message), answer) for pattern, answer in _COMMAND_RULES)
    return _joined(message, _first(answer(match, line) for match, answer in matches if match))


_Match = re.Match[str]


def _value_of_flag(match: _Match, line: _Line) -> str:
    flag = _first(flag for flag, word in pairwise(line.arguments) if flag in line.flags and word == match[1])
    return f"{flag} takes no value" if flag else ""


def _stray_value(match: _Match, line: _Line) -> str:
    words = [match[1]] if match.re.groups else line.arguments
    return _first(_without_space(word, line) for word in words)


def _place_of_fake(match: _Match, line: _Line) -> str:
    fake = _first(word for word in line.arguments if word.startswith("fake:") and "?" not in word)
    return f"that of a fake scanner stands in its URL: '{fake}?place={match[1]}'" if fake else ""


def _place_in_room(match: _Match, line: _Line) -> str:
    is_in_room = "--place" not in line.arguments and any("room" in kind_of(word) for word in line.arguments)
    return f"a place is given with `--place {match[1]}`" if is_in_room else ""


def _new_room(match: _Match, _line: _Line) -> str:
    return f"`sonarhw room new NAME.toml --size {match[1]}` writes a room of this size"


def _other_ending(match: _Match, line: _Line) -> str:
    word = match[2].lower()
    writers = [option for option in _writers(word, line.context.command, line) if not option.startswith(match[1])]
    return f"{word.upper()} is written with `{writers[0]}`" if writers else _written_elsewhere(word, line)


def _room_with_place(match: _Match, _line: _Line) -> str:
    is_room = match[1] in options.complete_room(match[1])
    return f"a place is given with `{match[1]} --place {match[2]}`" if is_room else ""


def _wrong_name(match: _Match, line: _Line) -> str:
    file, files = match[1].partition("=")[2], re.split("[,:;]", match[1])
    if line.divided_name or os.path.isfile(file):
        return line.divided_name or _meant(file)
    is_list = len(files) > 1 and all(map(os.path.isfile, files))
    return f"write several files with spaces: {' '.join(files)}" if is_list else _similar_name(match)


def _similar_name(match: _Match) -> str:
    """Return the file with the most similar name, if possible with the suffix in the second group."""
    missing, expected = Path(match[1]), match[2] or ""
    try:
        files = [*islice(missing.parent.iterdir(), _MOST_FILES)]
    except (OSError, ValueError):  # ValueError: a NUL in the name
        return ""
    suffix = missing.suffix if missing.suffix not in ("", expected) else expected
    stem = _nearest(missing.stem, [path.stem for path in files if path.suffix == suffix])
    names = [
        stem and stem + suffix,
        _nearest(missing.name, [path.name for path in files if path.stem == missing.stem], 0.0),
        *(path.name for path in files if path.suffix and missing.name.startswith(f"{path.name}.")),
    ]
    return _first(_meant(str(missing.with_name(name))) for name in names if name)


_COMMAND_RULES: tuple[tuple[str, Callable[[_Match, _Line], str]], ...] = (
    (r"(.+?): no ", _value_of_flag),
    (r"(\S+): no such file", _stray_value),
    (r".*, (\S+): expected the URL of one scanner", _stray_value),
    (r"--place: expected one for each", _stray_value),
    (r"--place needs --room: (\S+) is a place", _place_of_fake),
    (r"(\S+): there is no such file or port", _place_in_room),
    (r"(?:unknown room ')?([\d.]+[x×][\d.]+)'?[:;]", _new_room),
    (r"(--\w+) .*\.(\w+): expected a name ending in", _other_ending),
    (r"(?:unknown room ')?(\w+)[/:](\w+)'?[:;]", _room_with_place),
    (r"(.+): no such file(?:.*\(\*(\.\w+)\))?", _wrong_name),
)
