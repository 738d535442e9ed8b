"""A refused command line, what its command accepts, and how to write parts of it.

Only a refused command line loads this module.
"""

import difflib
import os
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import dropwhile, pairwise, takewhile
from pathlib import Path
from typing import Any

import typer

from sonarhw_cli import other_words
from sonarhw_cli.word_kinds import expected_of, kind_of, written_option

ALIKE = 0.75  # similarity of a word that is proposed; below, it is another word
NUMBERS, _NAMES = re.compile(r"-?[\d.,]+"), re.compile(r"[a-z_]+,?")


@dataclass(frozen=True)
class RefusedLine:
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

    def behind(self, word: str) -> Sequence[str]:
        """Return the arguments behind a command or an option."""
        return [*dropwhile(lambda argument: argument.lstrip("-") != word, self.arguments)][1:]

    @cached_property
    def has_argument(self) -> bool:
        """Whether the command is run with more than options."""
        path = self.path.split()
        words = [path[-1], *self.arguments[len(path) - 1 :]]
        behind = [word for before, word in pairwise(words) if before[:1] != "-" or before in self.flags]
        return any(word[:1] != "-" for word in behind)

    def value_expected(self, name: str) -> str:
        """Return the message about an option without a value."""
        return f"{name}: expected a value, as in `{self.written(name)}`"

    @cached_property
    def option_without_value(self) -> str:
        """The message about an option that took the next option as its value."""
        pairs = pairwise(self.arguments)
        names = (name for name, value in pairs if name in self.options.keys() - self.flags and value in self.options)
        return first(map(self.value_expected, names))

    @cached_property
    def missing_argument(self) -> str:
        """The required argument, if the command is run with options alone."""
        return "" if self.has_argument else first(argument.metavar for argument in self.accepted if argument.required)

    def with_argument(self, option: str, value: str) -> str:
        """Return the line with the value of an option as its argument; empty if it has other unknown options."""
        words = [*self.behind(self.path.split()[-1])]
        row = words.index(option)
        rest = [*words[:row], *words[row + 2 :]]
        is_known = all(word in self.options for word in rest if word.startswith("-"))
        return shlex.join([*self.path.split(), value, *rest]) if is_known else ""

    @cached_property
    def argument_expected(self) -> str:
        """Where the missing argument stands."""
        where = f"where {self.missing_argument} stands without an option before it"
        return f"expected `{self.usage}`, {where}; {self.see}" if self.missing_argument else ""

    @cached_property
    def divided_name(self) -> str:
        """How to write the name of a file that the shell has divided at a space."""
        names = (f"{first} {second}" for first, second in pairwise(self.arguments))
        name = first(filter(os.path.isfile, names))
        return f"write the name of the file in quotes: {shlex.quote(name)}" if name else ""


def line_of(arguments: Sequence[str], program: Any) -> RefusedLine:
    """Return the command line of the command in the arguments, without its values."""
    context = typer.Context(program, info_name="sonarhw")
    for argument in arguments:
        if command := getattr(context.command, "commands", {}).get(argument):
            context = typer.Context(command, info_name=argument, parent=context)
    return RefusedLine(arguments, context)


def first(answers: Iterable[str]) -> str:
    """Return the first answer that is not empty. A generator of answers computes no others."""
    return next(filter(None, answers), "")


def joined(*parts: str) -> str:
    """Return the parts of a message, without empty ones."""
    return "; ".join(filter(None, parts))


def meant(*names: str) -> str:
    """Return the question whether a command or an option was meant, or nothing without a name."""
    return f"did you mean {' or '.join(f'`{name}`' for name in names)}?" if any(names) else ""


def nearest(word: str, names: Iterable[str], alike: float = ALIKE) -> str:
    """Return the most similar name, or nothing if none is similar."""
    return first(difflib.get_close_matches(word, names, n=1, cutoff=alike))


# Formats of files.


def about_format(word: str, line: RefusedLine) -> str:
    """Return how a format of files is written: by an option of this command, or else of others on the same input."""
    word = "png" if word in other_words.PICTURES else word
    if word not in other_words.FORMATS:
        return ""
    if writers := options_writing(word, line.context.command, line):
        return f"{word.upper()} is written with `{writers[0]}`"
    out = line.options.get("--out")
    writes = f"this command writes `{line.written('--out')}`" if out else ""
    endings = ", ".join(re.findall(r"\.\w+", out.help or "")) if out and out.metavar in (None, "FILE") else ""
    return joined(f"{writes}: {endings}" if endings else writes, written_elsewhere(word, line))


def written_elsewhere(word: str, line: RefusedLine) -> str:
    """Return what else writes a format of files: a browser, or other commands on the same input."""
    command = line.context.command
    if word == "pdf" and options_writing("html", command, line):
        return "a browser prints HTML as PDF"
    argument = next((argument.metavar for argument in line.accepted), None)
    if options_writing("mcap", command, line):
        argument = "LOG"  # others read the log that it writes
    same = [(path, c) for path, c in line.all_commands if any(argument == p.metavar for p in c.params[:1])]
    others = [f"`{path} {argument} {option}`" for path, c in same for option in options_writing(word, c, line)[:1]]
    if not argument or not others or options_writing(word, command, line):
        return ""
    if exports := [other for other in others if "export" in other]:
        return f"a log is written as {word.upper()} by {exports[0]}"
    return f"{word.upper()} is written by {' or '.join(dict.fromkeys((others[0], others[-1])))}"


def options_writing(word: str, command: Any, line: RefusedLine) -> list[str]:
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


def option_with_output(word: str, line: RefusedLine) -> str:
    """Return the option that writes a file of this name, with the name; empty for an existing file and other words."""
    ending = Path(word).suffix.removeprefix(".").lower()
    writers = options_writing(ending, line.context.command, line) if ending and not os.path.exists(word) else []
    return f"{writers[0].partition(' ')[0]} {shlex.quote(word)}" if writers else ""


# Options and their values.


def option_named(word: str, value: str, line: RefusedLine) -> str:
    """Return the option of this name, with a value or the word behind it; empty if there is none."""
    option = f"--{word}"
    if option not in line.options:
        return ""
    following = [] if option in line.flags else line.behind(word)[:1]
    return " ".join([option, *([value] if value else following)])


def without_space(word: str, line: RefusedLine) -> str:
    """Return how to write a list or several values of an option whose values are separated by spaces."""
    arguments = line.arguments
    row = next((k for k in range(2, len(arguments)) if arguments[k] == word and arguments[k - 2].startswith("--")), 0)
    option = arguments[row - 2] if row else ""
    value = NUMBERS if NUMBERS.fullmatch(word) else _NAMES
    if option not in line.options or option in line.flags or kind_of(word):
        return ""
    if not value.fullmatch(word) or not value.fullmatch(arguments[row - 1]):
        return ""
    values = [arguments[row - 1], *takewhile(value.fullmatch, arguments[row:])]
    written = line.written(option)
    if "," in written and (value is NUMBERS or "|" not in written):
        decimals = all(re.fullmatch(r"-?\d+,\d+", part) for part in values)
        parts = [part.replace(",", ".") if decimals else part.rstrip(",") for part in values]
        return f"write `{option} {','.join(parts)}`{' with decimal points and' if decimals else ''} without a space"
    is_many = getattr(line.options[option], "multiple", False)
    return f"repeat the option: `{' '.join(f'{option} {part}' for part in values)}`" if is_many else ""
