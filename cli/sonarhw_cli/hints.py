"""What a refused command line is answered with: the error, what was expected, and what to write instead.

Only a refused command line loads this module. The rules about one kind of error are in their order: the first answer
is printed.
"""

import difflib
import os
import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import typer

from sonarhw_cli import options, other_words
from sonarhw_cli.refused_line import (
    ALIKE,
    NUMBERS,
    RefusedLine,
    about_format,
    first,
    joined,
    line_of,
    meant,
    nearest,
    option_named,
    option_with_output,
    options_writing,
    without_space,
    written_elsewhere,
)
from sonarhw_cli.word_kinds import kind_of, option_taking, use_of

_SHORTENED = 3  # letters of a command at least, such as `sim`
_OPTION_ALIKE, _VERY_ALIKE = 0.8, 0.85  # similarity of options of this command and of others
_MOST_FILES = 1000  # of a folder that are compared with a name
# parts of words such as --room-file
_VAGUE = ("also", "each", "every", "file", "from", "name", "only", "path", "print", "such", "the", "with", "write")
_LIMITS = ("max", "min")  # --min-range is no --range
_MOST_ALIKE = 6  # options with the same start
_UNIT = re.compile(r"(degrees|metres|seconds|Hz|°C|m/s)\b")
_PLACE = re.compile(r"[a-z]\w*|-?[\d.]+(,-?[\d.]+){1,2}")
# usual rates of serial ports
_RATE = re.compile("(?:12|24|48|96|144|192|288|384|576|768|1152|2304|2500|4608|5000|9216|10000)00|31250|74880")
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
# values, and how the options that take them are written
_SHAPES = ((r"-?[\d.]+(,-?[\d.]+){1,2}", "X,Y"), (r"[\d.]+[x×*][\d.]+", "WxD"), (r"[\w.-]*:\d+", "HOST:PORT"))
# URLs that are divided at a space, and how to write them
_DIVIDED_URLS = (
    (r"(socket://[^:]+) (\d+)", "{}:{}"),
    (r"fake:? ([\w.]+)", "'fake:{}?place=NAME'"),
    (r"lines:? ([\w./]+)", "'lines:{}?baud=9600&preset=NAME'"),
    (r"(COM|(?:/dev/)?tty[A-Z]+) (\d+)", "{}{}"),
    (r"((?:fake|lines):[^?]+) (\w+=.+)", "'{}?{}'"),
    (r"((?:fake|lines):.+) (\w+=.+)", "'{}&{}'"),
)
# commands that list what an argument names
_LISTS = {
    **dict.fromkeys(("URL", "PORT"), "`sonarhw ports` lists the scanners"),
    "ROOM": "`sonarhw room list` lists the shipped rooms",
}
_HELP = ("?", "about", "docs", "examples", "h", "help", "license", "man", "manual", "tutorial", "usage")
_OF_A_FILE = {"log": "info", "profile": "check", "room": "check"}  # the command of a group that describes a file
# phrases in the messages of the option parser about numbers, and their replacements
_REWORDED = (
    ("Value error, ", ""),
    ("Input should be a valid integer, unable to parse string as an integer", "expected a whole number"),
    ("Input should be a valid number, unable to parse string as a number", "expected a number"),
    ("Input should be ", "expected a number "),
)


def parser_message(error: typer.TyperException, arguments: Sequence[str], program: Any) -> str:
    """Return an error of the option parser. Without a command, it is the help, which begins with `Usage:`."""
    message = _reworded(error)
    if without := re.fullmatch(r"Option '([^']+)' requires an argument\.", message):
        # this error does not contain the command
        return line_of(arguments, program).value_expected(without[1])
    context = getattr(error, "ctx", None)
    if context is None:
        return message
    line = RefusedLine(arguments, context)
    if line.option_without_value:
        return line.option_without_value
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


def _about_argument(message: str, line: RefusedLine) -> str:
    """Return the message about a missing or invalid argument, or a missing option, with the usage."""
    if message.startswith("Missing argument") and len(line.accepted) > 1 and NUMBERS.match(line.arguments[-1]):
        # the parser takes a number for the first argument, and misses the last
        message = f"Missing argument '{line.accepted[0].metavar}'"
    return joined(message, f"expected `{line.usage}`", first(_hints_about_argument(message, line)), line.see)


def _hints_about_argument(message: str, line: RefusedLine) -> Iterator[str]:
    """Yield what to write for a missing or invalid argument, or a missing option, the most probable first."""
    value = message.partition(" ")[2].partition(": expected")[0]
    missing = first(re.findall(r"^Missing (?:argument|option) '([^']+)'", message))
    last = " ".join(line.arguments[-1:])
    if kind_of(value) == "URL":
        yield "write them in this order"
    if value.startswith("--"):
        yield "arguments stand without an option before them"
    if missing in line.options:
        yield f"write `{output}`" if (output := option_with_output(last, line)) else ""
        is_printed = "standard output" in (line.options[missing].help or "")
        yield f"`{missing} -` writes to standard output" if is_printed else ""
        is_behind_argument = not line.arguments[-2].startswith("-") and line.arguments[-2] != line.path.split()[-1]
        if is_behind_argument and not os.path.exists(last):
            yield about_format(Path(last).suffix.removeprefix(".").lower(), line)
    elif missing:
        yield from _taken_by_option(line)
    if missing and re.search(r":.+\?\w+=[^&]*$", last):
        yield "write a URL with & in quotes, because the shell reads it as the end of the command"
    yield _LISTS.get(missing, "")


def _taken_by_option(line: RefusedLine) -> Iterator[str]:
    """Yield that an option took the word that an argument expects, such as a log, as its value."""
    kinds = {kind for argument in line.accepted for kind in line.kinds_of(argument)}
    for option, value in pairwise(line.arguments):
        if option not in line.options or option in line.flags or Path(value).suffix in line.written(option):
            continue  # a flag takes none, and the value may be meant for the option
        if os.path.exists(value) and kind_of(value) in kinds - {""}:
            yield f"{option} took {value} as its value: write `{line.path} {shlex.quote(value)} {option} VALUE`"


# Unknown commands.


def _about_command(message: str, line: RefusedLine) -> str:
    """Return the message about an unknown command with the one that it probably means, or those that exist."""
    # the parser writes odd characters of the word in another way, and names similar commands, among them hidden ones
    word = first(argument for argument in line.arguments if message.startswith(f"No such command {argument!r}"))
    message = message.partition(". Did you mean")[0]
    answers = _commands_for if line.is_program else _members_for
    if word and (command := first(answers(word, line))):
        return f"{message}; {meant(f'sonarhw {command}')}"
    commands = "" if line.is_program else f"its commands: {', '.join(line.commands)}"
    return joined(message, commands, first(map(use_of, line.behind(word))), line.see)


def _commands_for(word: str, line: RefusedLine) -> Iterator[str]:
    """Yield the commands that an unknown one may mean, without the name of the program, the most probable first."""
    following = line.behind(word)
    later = first(name for name in following if name in line.commands)
    if word in _HELP:
        yield " ".join([*following, "--help"])
    if groups := [f"{group} {word}" for group in line.commands if word in line.members(group)]:
        yield "` or `sonarhw ".join([*groups, *filter(None, [other_words.COMMANDS.get(word)])])
    if following[:1] == [later] and not kind_of(word):
        yield later
    longer = [name for name in line.shown_commands if name.startswith(word)]
    if len(longer) == 1 and len(word) >= _SHORTENED:
        yield longer[0]
    if described := _first_command(word):
        yield f"{later} {word}" if later else described
    yield from _commands_of_parts(word, line)
    yield nearest(word, line.shown_commands)
    yield other_words.COMMANDS.get(nearest(word, other_words.COMMANDS), "")
    yield from map(_first_command, line.arguments)


def _commands_of_parts(word: str, line: RefusedLine) -> Iterator[str]:
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
    return _FIRST_COMMANDS.get(kind_of(word) or guessed, "").format(shlex.quote(word))


def _members_for(word: str, line: RefusedLine) -> Iterator[str]:
    """Yield the commands that an unknown one of a group may mean, without the name of the program."""
    group, following = line.context.info_name or "", line.behind(word)
    if word in _HELP:
        yield " ".join([group, *following, "--help"])
    if "list" in line.commands and word in other_words.COMMANDS_OF_GROUPS["check"].split() and not following:
        yield f"{group} list"
    shipped = options.complete_room(word) if group == "room" else options.complete_board(word)
    if "list" in line.commands and shipped and word not in shipped:
        yield f"{group} list"
    if group == "room" and other_words.COMMANDS.get(word) == "gui":
        yield " ".join(["gui", *map(shlex.quote, following)])
    for name, others in other_words.COMMANDS_OF_GROUPS.items():
        if name in line.commands and word in others.split():
            yield f"{group} {name}"
    is_name = "." in word or "/" in word or word in shipped
    command = other_words.COMMANDS.get(word, "")
    if word not in other_words.ANY and not is_name:
        yield word if word in line.program_commands else "" if (group, command) == ("profile", "gui") else command
    if near := nearest(word, line.shown_commands):
        yield f"{group} {near}"
    writes = "export" in line.commands and "--out" in line.arguments
    describes = "export" if writes else _OF_A_FILE.get(group, "")
    if command := first(name for name in following if name in line.commands) or (describes if is_name else ""):
        yield f"{group} {command} {word}"


# Unknown options.


@dataclass(frozen=True)
class _UnknownOption:
    line: RefusedLine
    option: str

    @cached_property
    def word(self) -> str:
        return self.option.lstrip("-")

    @cached_property
    def value(self) -> str:
        """The argument behind it."""
        return first(value for given, value in pairwise(self.line.arguments) if given == self.option)

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
        alike = [] if self.elsewhere else difflib.get_close_matches(self.option, self.line.options, cutoff=ALIKE)
        return [name for name in alike if _is_misspelt(self.option, name)]


def _is_misspelt(word: str, name: str) -> bool:
    """Report whether an option is probably a misspelt `name`: of about the same length, or with the same start."""
    is_same_start = word[:6] == name[:6]  # with two hyphens
    ratio = difflib.SequenceMatcher(None, word, name).ratio()
    return word.startswith(name) or (ratio >= _OPTION_ALIKE and (is_same_start or abs(len(word) - len(name)) <= 1))


def _about_option(message: str, line: RefusedLine) -> str:
    """Return the message about an unknown option, with the one that it probably means or what to write instead."""
    option = message.removeprefix("No such option: ").partition(" (")[0]
    unknown = _UnknownOption(line, option)
    answer = first(_options_for(unknown)) or first(_other_answers_for(unknown)) or _last_answer(unknown)
    return f"No such option: {option}; {answer}"


def _options_for(unknown: _UnknownOption) -> Iterator[str]:
    """Yield what to write in place of an unknown option, the most probable first."""
    line, option, word = unknown.line, unknown.option, unknown.word
    # -room is read as the option -r
    yield meant(*(f"-{argument}" for argument in line.arguments if f"-{argument}" in line.options))
    if word in other_words.GLOBAL:
        before = f"sonarhw {other_words.GLOBAL[word]}"
        command = line.path.partition(" ")[2]
        yield f"it stands before the command: `{before} {command}`" if command else meant(before)
    yield from (meant(name) for name in line.options if name.casefold() == option.casefold())
    kinds = [kind for argument in line.accepted[:1] for kind in line.kinds_of(argument)]
    kind = kind_of(unknown.value)
    if kind and kind in kinds:
        yield ("" if line.has_argument else meant(line.with_argument(option, unknown.value))) or line.argument_expected
    names = [f"--{word}", f"--{word.removesuffix('s')}"] if len(word) > 1 else []
    yield from (meant(name) for name in names if name in line.options)
    baud = line.instead_of("baud") if _RATE.fullmatch(unknown.value) else ""
    for instead in (*_formats(unknown), baud, line.instead_of(word)):
        yield joined(instead, line.see) if instead else ""
    yield meant(option_taking(word, line.context))
    if not unknown.close:
        yield meant(option_taking(unknown.value, line.context)) if kind and word not in other_words.SAVE else ""
        yield from map(meant, _options_by_value(unknown))
    if {*unknown.parts} & {*other_words.SAVE} and unknown.value:
        yield meant(option_taking(unknown.value, line.context))
    if not {*unknown.parts} & {*_LIMITS}:
        yield first(meant(line.written(f"--{part}")) for part in unknown.parts if f"--{part}" in line.options)
    for instead in map(line.instead_of, (word.removesuffix("s"), *unknown.parts)):
        yield joined(instead, line.see) if instead else ""
    yield meant(*_longer(unknown)) or meant(*unknown.close)


def _options_by_value(unknown: _UnknownOption) -> Iterator[str]:
    """Yield options of the command that the value of an unknown one names, or that take such a value."""
    value, line = unknown.value, unknown.line
    shape = first(shape for pattern, shape in _SHAPES if re.fullmatch(pattern, value))
    yield from (f"{name} {value}" for name in line.options if shape and shape in line.written(name))
    if re.fullmatch("[a-z][a-z0-9-]+", value):
        for name, option in line.options.items():
            about = f"{line.written(name).replace(' ', '|')} {option.help}"
            if re.search(rf"([|:,]| or) ?{value}([|,.;]|$)", about):
                yield f"{option.opts[0]} {value}"


def _formats(unknown: _UnknownOption) -> Iterator[str]:
    """Yield how the format of files is written that the value or the word names."""
    word, value = unknown.word, unknown.value
    if word in ("format", "type"):
        yield about_format(value, unknown.line)
    elif word in (*other_words.SAVE, *other_words.PICTURES, "record") and not os.path.isfile(value):
        yield about_format(Path(value).suffix.removeprefix(".").lower(), unknown.line)
    yield about_format(word, unknown.line)


def _longer(unknown: _UnknownOption) -> Sequence[str]:
    """Return the options of the command that begin with the unknown one."""
    names, option = sorted(unknown.line.options), unknown.option
    if len(unknown.word) == 1 and not unknown.line.is_program:
        return [name for name in names if name.startswith(f"-{option}")][:_MOST_ALIKE]
    return [name for name in names if len(unknown.word) > 2 and name.startswith(option)]


def _other_answers_for(unknown: _UnknownOption) -> Iterator[str]:
    """Yield what else to do for what an unknown option may mean."""
    line, option, word = unknown.line, unknown.option, unknown.word
    later = [word for word in line.arguments if word in line.commands]
    behind = (f"options of a command stand behind it: `sonarhw {command} ... {option}`" for command in later)
    if any(option in parameter.opts for command in later for parameter in line.commands[command].params):
        yield from behind
    if word in line.program_commands and not line.program_commands[word].hidden and not unknown.elsewhere:
        yield f"`sonarhw {word}` is a command of its own"
    yield from behind
    if line.is_program and not unknown.elsewhere:
        yield from (meant(f"sonarhw {command}") for command in _commands_for(word, line) if command)
    yield "" if NUMBERS.fullmatch(unknown.value) else line.argument_expected
    if not os.path.isfile(unknown.value):
        yield about_format(Path(unknown.value).suffix.removeprefix(".").lower(), line)
    yield meant(option_taking(unknown.value, line.context)) if unknown.value else ""
    if word in other_words.SAVE:
        yield f"`{line.path} > FILE` writes its output to a file; {line.see}"


def _last_answer(unknown: _UnknownOption) -> str:
    """Return options about an unknown one, the commands that have it, or the options of the command."""
    line, word, where = unknown.line, unknown.word, ""
    if unknown.elsewhere:
        does = next(iter(unknown.elsewhere.values())).partition(". ")[0].rstrip(".")
        where = f"it is an option of `{'`, `'.join(islice(unknown.elsewhere, 3))}`: {does}"
    about = _about_word(unknown)
    if not (about or where) and word in other_words.COMMANDS and word not in other_words.ANY:
        about = f"`sonarhw {other_words.COMMANDS[word]}` does this"
    listed = f"its options: {', '.join(sorted(line.options))}" if line.options else f"`{line.path}` has no options"
    return joined(about, where, line.see if about or where or line.is_program else listed)


def _about_word(unknown: _UnknownOption) -> str:
    """Return options or the sentence of the help about the word, or the most similar option of another command."""
    line = unknown.line
    word = re.sub("^(no|not|with|without|enable|disable|use)-", "", unknown.word)
    for part in dict.fromkeys((word, *word.split("-"))):
        called = other_words.WORDS_OF_HELP.get(part)
        stem = called or re.sub("(ies|es|y|s|ing|ed)$", "", part)
        if len(stem) <= _SHORTENED or {stem, part} & {*_VAGUE}:
            continue
        about = re.compile(rf"(?i)\b{re.escape(stem)}")
        names = [name for name, option in line.options.items() if about.search(f"{name} {option.help}")]
        written = dict.fromkeys(map(line.written, names))
        if written:
            return f"options about {called or part}: `{'`, `'.join(islice(written, 2))}`"
        # what it does without an option
        sentences = re.split(r"(?<=\.)\s+", line.context.command.help or "")
        if sentence := first(sentence for sentence in sentences if about.search(sentence)):
            return f"`{line.path}`: {sentence.rstrip('.')}"
    paths = {name: path for path, command in line.all_commands for p in command.params for name in p.opts}
    near = "" if f"--{word}" in paths or len(word) <= _SHORTENED else nearest(f"--{word}", paths, _VERY_ALIKE)
    return f"`{near}` is an option of `{paths[near]}`" if near and near[2] == word[0] else ""


# Arguments too many.


@dataclass(frozen=True)
class _Extra:
    line: RefusedLine
    all: str  # of them, as the parser lists them

    @cached_property
    def word(self) -> str:
        """The first one."""
        return self.all.split(" ")[0]

    @cached_property
    def before(self) -> str:
        """The argument before it."""
        return first(before for before, word in pairwise(self.line.arguments) if word == self.word)

    @cached_property
    def words(self) -> Sequence[str]:
        """The first argument of the command and those too many."""
        values = [self.line.context.params.get(argument.name) for argument in self.line.accepted[:1]]
        return [*map(str, filter(None, values)), *(w for w in self.line.arguments if f" {w} " in f" {self.all} ")]

    @cached_property
    def same(self) -> Sequence[str]:
        """Those of the kind that the command accepts."""
        kinds = [kind for argument in self.line.accepted[:1] for kind in self.line.kinds_of(argument)]
        return [word for word in self.words if (kind := kind_of(word)) and kind in kinds]

    @cached_property
    def others(self) -> Sequence[str]:
        return [word for word in self.words if word not in self.same]


def _about_extra(message: str, line: RefusedLine) -> str:
    """Return the message about an argument too many, with how to write a place, a size, a room or a second log."""
    extra = _Extra(line, message.removesuffix(")").rpartition("(")[2])
    if extra.word.startswith("--"):
        return _about_option(f"No such option: {extra.word}", line)
    if written := _divided_url(extra):
        return f"{message}; write `{written}`"
    if other := _mistyped_option(extra) or _command_of(extra):
        return f"{message}; {meant(other)}"
    hint = first(_values_for(extra)) or first(_uses_of(extra))
    return joined(message, f"expected `{line.usage}`", hint, line.see)


def _divided_url(extra: _Extra) -> str:
    parts = f"{extra.before} {extra.word}" if "URL" in extra.line.usage else ""
    matches = ((re.fullmatch(divided, parts), url) for divided, url in _DIVIDED_URLS)
    return first(url.format(*match.groups()) for match, url in matches if match)


def _mistyped_option(extra: _Extra) -> str:
    # place=desk, place desk, or a dash of a text editor in place of two hyphens
    given = re.fullmatch(r"[—–−]?-?([a-z][a-z-]*)(?:=(.+))?", extra.word)
    return option_named(given[1], given[2] or "", extra.line) if given else ""


def _command_of(extra: _Extra) -> str:
    command = "" if extra.line.accepted else other_words.COMMANDS.get(extra.word, "")
    if extra.word in other_words.ANY:
        command = other_words.COMMANDS.get(f"{extra.line.context.info_name}s", command)
    return f"sonarhw {command}" if command else ""


def _values_for(extra: _Extra) -> Iterator[str]:
    """Yield how to write a value, or values, of which an argument too many is a part."""
    line, word = extra.line, extra.word
    if _RATE.fullmatch(word):
        yield line.instead_of("baud")
    if "--size" in line.arguments and re.fullmatch(r"-?[\d.]+|[x×*]|by|[\d.]+(m|cm|mm)", word):
        yield "write WxD in metres without a space, such as --size 3.2x2.4"
    yield without_space(word, line)


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
        yield joined(f"it takes one {line.accepted[0].metavar}: run it once for each", several)
    yield first(f"leave out {other}" for other in extra.others if other in other_words.ANY)
    for other in extra.others:
        if taking := option_taking(other, line.context) or option_with_output(other, line):
            yield f"write `{' '.join([line.path, *map(shlex.quote, extra.same), taking])}`"
    yield from map(use_of, extra.others)
    yield from _uses_of_value(extra)


def _flag_before(extra: _Extra) -> str:
    pairs = pairwise(extra.line.arguments)
    flag = first(flag for flag, word in pairs if flag in extra.line.flags and word in extra.others)
    file = first(word for word in extra.others if Path(word).suffix)
    writes = f"`> {shlex.quote(file)}` behind the command writes its output to a file" if file else ""
    return joined(f"{flag} takes no value", writes) if flag else ""


def _uses_of_value(extra: _Extra) -> Iterator[str]:
    """Yield what to do with a number, a part of a name or the name of a place."""
    line, word = extra.line, extra.word
    row = line.arguments.index(word) if word in line.arguments else 0
    if row > 1 and line.arguments[row - 2] in line.options:
        yield f"{line.arguments[row - 2]} takes one value"
    numbers = [option for option in map(line.written, line.options) if re.search(" (INTEGER|NUMBER)$", option)]
    if numbers and re.fullmatch(r"-?[\d.]+", word):
        yield f"numbers are given with options, such as `{'`, `'.join(numbers[:3])}`"
    yield line.divided_name
    if "--size" in line.options and re.fullmatch(r"[\d.]+[a-z]*[x×*][\d.]+[a-z]*", word):
        yield f"give a size in metres with `--size {word}`"
    place = first(extra.others) or word
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
    line = line_of(arguments, program)
    if line.option_without_value:
        return line.option_without_value
    matches = ((re.match(pattern, message), answer) for pattern, answer in _COMMAND_RULES)
    return joined(message, first(answer(match, line) for match, answer in matches if match))


_Match = re.Match[str]


def _room_and_place(_match: _Match, line: RefusedLine) -> str:
    listed = "`sonarhw room list` lists the shipped rooms"
    return f"{listed}; --place gives the place in it" if {"--place"} & {*line.options} - {*line.arguments} else listed


def _value_of_flag(match: _Match, line: RefusedLine) -> str:
    flag = first(flag for flag, word in pairwise(line.arguments) if flag in line.flags and word == match[1])
    return f"{flag} takes no value" if flag else ""


def _stray_value(match: _Match, line: RefusedLine) -> str:
    words = [match[1]] if match.re.groups else line.arguments
    return first(without_space(word, line) for word in words)


def _without_hyphens(match: _Match, line: RefusedLine) -> str:
    return meant(option_named(match[1], "", line)) if match[1] in line.arguments else ""


def _place_of_fake(match: _Match, line: RefusedLine) -> str:
    fake = first(word for word in line.arguments if word.startswith("fake:") and "?" not in word)
    return f"that of a fake scanner stands in its URL: '{fake}?place={match[1]}'" if fake else ""


def _preset(match: _Match, line: RefusedLine) -> str:
    from sonarhw.text.layouts import PRESETS

    name, _, port = match[1].partition(":")
    preset = nearest(name, PRESETS)
    return f"a device that prints text is `'lines:{port or 'PORT'}?preset={preset}'`" if preset else ""


def _place_in_room(match: _Match, line: RefusedLine) -> str:
    is_place = _PLACE.fullmatch(match[1]) and "--place" not in line.arguments
    is_in_room = is_place and any("room" in kind_of(word) for word in line.arguments)
    return f"a place is given with `--place {match[1]}`" if is_in_room else ""


def _new_room(match: _Match, _line: RefusedLine) -> str:
    return f"`sonarhw room new NAME.toml --size {match[1]}` writes a room of this size"


def _other_ending(match: _Match, line: RefusedLine) -> str:
    word = match[2].lower()
    command = line.context.command
    writers = [option for option in options_writing(word, command, line) if not option.startswith(match[1])]
    if writers:
        return f"{word.upper()} is written with `{writers[0]}`"
    # what is found by comparing or fitting is no log
    is_convertible = options_writing("html" if word == "pdf" else "mcap", command, line)
    return written_elsewhere(word, line) if is_convertible else ""


def _room_with_place(match: _Match, line: RefusedLine) -> str:
    if match[1] not in options.complete_room(match[1]):
        return ""
    is_fake = any(word.startswith("fake:") for word in line.arguments)
    given = f"'fake:{match[1]}?place={match[2]}'" if is_fake else f"{match[1]} --place {match[2]}"
    return f"a place is given with `{given}`"


def _plain_port(match: _Match, _line: RefusedLine) -> str:
    port = match[1].strip(":,;.'\"")
    if os.name == "nt" or not port.startswith("\\\\"):  # such a name of Windows is no other port here
        port = re.sub(r"(?i)^[\\/.]*(com\d+)$", lambda name: name[1].upper(), port)
    port = re.sub(r"^(?!lines?:)\w+:/*(?=/dev/|COM\d)", "", port)
    port = re.sub(r"^socket:?/*(?=[\w.-]+:\d+$)", "socket://", port)
    return meant(port) if port != match[1] and kind_of(port) == "URL" else ""


def _wrong_name(match: _Match, line: RefusedLine) -> str:
    file, files = match[1].partition("=")[2], re.split("[,:;]", match[1])
    if line.divided_name or os.path.isfile(file):
        return line.divided_name or meant(file)
    is_list = len(files) > 1 and all(map(os.path.isfile, files))
    if is_list:
        return f"write several files with spaces: {' '.join(files)}"
    return _similar_name(match, line) or _missing_output(match[1], line)


def _missing_output(word: str, line: RefusedLine) -> str:
    """Return the option for a file to write, which a command with many arguments takes for one to read."""
    is_last = line.arguments[-1] == word and not line.arguments[-2].startswith("-")
    is_one_of_many = is_last and any(argument.nargs != 1 for argument in line.accepted)
    taking = option_with_output(word, line) if is_one_of_many and "--out" not in line.arguments else ""
    return f"to write it, use `{taking}`" if taking else ""


def _similar_name(match: _Match, _line: RefusedLine) -> str:
    """Return the file with the most similar name, if possible with the suffix in the second group."""
    missing, expected = Path(match[1]), match[2] or ""
    try:
        files = [*islice(missing.parent.iterdir(), _MOST_FILES)]
    except (OSError, ValueError):  # ValueError: a NUL in the name
        return ""
    suffix = missing.suffix if missing.suffix not in ("", expected) else expected
    stem = nearest(missing.stem, [path.stem for path in files if path.suffix == suffix])
    names = [
        stem and stem + suffix,
        nearest(
            missing.name, [p.name for p in files if p.stem == missing.stem and p.suffix == (expected or p.suffix)], 0.0
        ),
        *(path.name for path in files if path.suffix and missing.name.startswith(f"{path.name}.")),
    ]
    return first(meant(str(missing.with_name(name))) for name in names if name)


_COMMAND_RULES: tuple[tuple[str, Callable[[_Match, RefusedLine], str]], ...] = (
    (r".+: contains no room; give one with --room", _room_and_place),
    (r"(.+?): no ", _value_of_flag),
    (r"(\S+): ", _without_hyphens),
    (r"(\S+): no such file", _stray_value),
    (r".*, (\S+): expected the URL of one scanner", _stray_value),
    (r"--place: expected one for each", _stray_value),
    (r"--place needs --room: (\S+) is a place", _place_of_fake),
    (r"(\S+): there is no such file or port", _place_in_room),
    (r"(?:unknown room ')?([\d.]+[x×][\d.]+)'?[:;]", _new_room),
    (r"(--\w+) .*\.(\w+): expected a name ending in", _other_ending),
    (r"(?:unknown room ')?(\w+)[/:,](\w+)'?[:;]", _room_with_place),
    (r"(\S+): (?:there is no such port|unknown scheme)", _plain_port),
    (r"(\S+): (?:there is no such port|unknown scheme)", _preset),
    (r"unknown \w+ '([^']+)';(?! did you mean)()", _similar_name),
    (r"(.+): no such file(?:.*\(\*(\.\w+)\))?", _wrong_name),
)
