"""Fenced blocks of a page, and a shell that runs their commands and compares what they print.

A block without an info string contains shell commands, each after `$ `, and their output. Other blocks have an info
string: `python` runs, `text` and file formats do not. A comment directly before a block changes how it is tested:

    <!-- not run: it needs a scanner -->
    <!-- run first: sonarhw simulate arena --place p3 --out scan.mcap -->

`run first` prepares what the reader has from elsewhere, such as a log. It may be repeated.

A transcript is a page of such blocks for tests. A block after `<!-- file: NAME -->` is written to this file. The output
has more marks: `…` stands for any text in a line, and alone for any lines; `2> ` is before the lines of standard error,
except those that begin with `sonarhw: `; `[2]` at the end is the exit status, if it is not 0.
"""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.fixtures.commands import sonarhw

SHELL, PYTHON = "", "python"
_BLOCK = re.compile(r"((?:^<!--.*?-->\n+)*)^```([a-z]*)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)
_COMMENT = re.compile(r"<!-- (not run|run first|file): (.*?) -->", flags=re.DOTALL)
# one command, without patterns, variables and redirections outside quotes; and the filters of its output
_PLAIN = re.compile(r"""(sonarhw(?: (?:[^\s'"$`*?;&|<>(){}\\#~!]|'[^']*'|"[^"$`\\]*")*)+)(?:\| ([^<>]+))?""")
_COMPILING = "sonarhw: Compiling the ray kernels"  # once per installation, and after a change of a kernel
_OWN = "sonarhw: "  # begins every line that commands themselves write to standard error about errors


@dataclass(frozen=True)
class Command:
    """A command of a shell block and the output that the page shows; empty: the page shows none."""

    text: str
    printed: str


@dataclass(frozen=True)
class Block:
    """A fenced block."""

    where: str  # page and line
    info: str
    text: str
    run_first: tuple[str, ...]
    not_run: str | None  # the reason
    file: str | None = None

    def commands(self) -> list[Command]:
        """Return the commands of a shell block. A command goes on after a line that ends with a backslash."""
        before, *parts = re.split(r"^\$ ", self.text, flags=re.MULTILINE)
        assert not before, f"{self.where}: expected `$ ` before a command, an info string, or `not run`"
        found = [re.match(r"((?:[^\n]*\\\n)*[^\n]*)\n(.*)", part, flags=re.DOTALL) for part in parts]
        return [Command(match[1].replace("\\\n", ""), match[2]) for match in found if match]


def blocks_of(page: Path) -> list[Block]:
    """Return the fenced blocks of a page."""
    text = page.read_text(encoding="utf-8")
    return [_block(page, text.count("\n", 0, match.start(2)) + 1, match) for match in _BLOCK.finditer(text)]


def _block(page: Path, line: int, match: re.Match[str]) -> Block:
    comments = _COMMENT.findall(match[1])
    marks = dict(comments)
    first = tuple(" ".join(text.split()) for kind, text in comments if kind == "run first")
    return Block(f"{page.name}, line {line}", match[2], match[3], first, marks.get("not run"), marks.get("file"))


def shown(done: subprocess.CompletedProcess[str]) -> str:
    """Return the output of a command as a transcript shows it."""
    lines = (line for line in done.stderr.splitlines() if not line.startswith(_COMPILING))
    errors = (line if line.startswith(_OWN) else f"2> {line}".rstrip() for line in lines)
    status = [f"[{done.returncode}]"] if done.returncode else []
    return done.stdout + "".join(f"{line}\n" for line in (*errors, *status))


class Shell:
    """Runs lines in a folder: one `sonarhw` command in this process, which is faster, and other lines in bash."""

    def __init__(self, folder: Path, *, apart: bool = True) -> None:
        """`folder` is also the working folder of this process. If not `apart`, errors are among the output."""
        self.folder = folder
        self.environment = os.environ | {"PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
        self._apart = apart

    def run(self, text: str) -> subprocess.CompletedProcess[str]:
        """Run a line; return its status and output."""
        plain = _PLAIN.fullmatch(text)
        if plain is None:
            return self._in_bash(text)
        done = sonarhw(*shlex.split(plain[1])[1:], apart=self._apart or bool(plain[2]))
        if done.returncode or plain[2] is None:
            return done
        filtered = self._in_bash(plain[2], done.stdout)
        if self._apart:
            filtered.stderr = done.stderr + filtered.stderr
        else:
            filtered.stdout = done.stderr + filtered.stdout
        return filtered

    def _in_bash(self, text: str, given: str = "") -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["bash", "-c", f"set -o pipefail; {text}"],
            input=given,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE if self._apart else subprocess.STDOUT,
            text=True,
            cwd=self.folder,
            env=self.environment,
        )


def differences(page: Path, shell: Shell) -> Iterator[str]:
    """Run the commands of a transcript; yield what is not as the page shows it.

    A command that is refused, with exit status 2, must leave all files as they were.
    """
    for block in blocks_of(page):
        if block.file:
            (shell.folder / block.file).write_text(block.text, encoding="utf-8")
        for command in [] if block.file else block.commands():
            before = _files(shell.folder)
            done = shell.run(command.text)
            if not matches(shown(done), command.printed):
                yield f"{block.where}: $ {command.text}\n{shown(done)}expected:\n{command.printed}"
            if done.returncode == 2 and _files(shell.folder) != before:
                yield f"{block.where}: $ {command.text}\nis refused, but changes files\n"


def _files(folder: Path) -> dict[Path, tuple[int, int]]:
    stats = {path: path.lstat() for path in folder.rglob("*")}
    return {path: (stat.st_mtime_ns, stat.st_size) for path, stat in stats.items()}


def matches(output: str, expected: str) -> bool:
    """Return whether an output is the expected one, in which `…` stands for any text."""
    lines = (".*".join(map(re.escape, line.split("…"))) + "\n" for line in expected.splitlines())
    return re.fullmatch("".join("(?:.*\n)*" if line == ".*\n" else line for line in lines), output) is not None
