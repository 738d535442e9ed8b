"""The fenced blocks of a page, and the comments before them.

A block without an info string contains shell commands, each after `$ `, and their output. Other blocks have an info
string: `python` runs, `text` and file formats do not. A comment directly before a block changes how it is tested:

    <!-- not run: it needs a scanner -->
    <!-- run first: sonarhw simulate arena --place p3 --out scan.mcap -->

`run first` prepares what the reader has from elsewhere, such as a log. It may be repeated.
"""

import re
from dataclasses import dataclass
from pathlib import Path

SHELL, PYTHON = "", "python"
_BLOCK = re.compile(r"((?:^<!--.*?-->\n+)*)^```([a-z]*)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)
_COMMENT = re.compile(r"<!-- (not run|run first): (.*?) -->", flags=re.DOTALL)


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
    reasons = [text for kind, text in comments if kind == "not run"]
    first = tuple(" ".join(text.split()) for kind, text in comments if kind == "run first")
    return Block(f"{page.name}, line {line}", match[2], match[3], first, reasons[0] if reasons else None)
