"""The manual page sonarhw(1): commands, options of all commands, exit status. A wheel installs it in share/man/man1."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer
from sonarhw_cli.app import app

MAN_PAGE = Path(__file__).parents[1] / "reference" / "sonarhw.1"
_HEAD = r""".TH SONARHW 1 "" "sonarhw" "User Commands"
.SH NAME
sonarhw \- {summary}
.SH SYNOPSIS
.B sonarhw
[\fIOPTIONS\fR] \fICOMMAND\fR [\fIARGUMENTS\fR]
.SH DESCRIPTION
\fBsonarhw\fR \fICOMMAND\fR \fB\-\-help\fR lists the arguments and options of a command.
Degrees and metres. A room or board is the name of a shipped one, or a file that ends in .toml or contains a slash.
"""
_TAIL = r""".SH EXIT STATUS
0: done. 1: the command started and failed. 2: invalid options or input. 130: interrupted; recorded readings are kept.
.SH EXAMPLES
.nf
sonarhw demo \-\-headless result
sonarhw simulate laboratory \-\-place bench \-\-out predicted.png
sonarhw scan /dev/ttyUSB0 \-\-out scan.mcap \-\-room laboratory \-\-place bench
sonarhw compare scan.mcap
.fi
"""


def man_page() -> str:
    """Return the text of the page, in the man macros of roff."""
    group = typer.main.get_command(app)
    summary = group.help.split(".")[0]
    options = [(", ".join(option.opts), option.help) for option in group.params if option.help]
    sections: dict[str, list[tuple[str, str]]] = {}
    for name, command in group.commands.items():
        sections.setdefault(f"COMMANDS: {(command.rich_help_panel or '').upper()}", []).extend(_rows(name, command))
    sections["OPTIONS"] = options
    body = "".join(
        f".SH {title}\n" + "".join(f".TP\n.B {_roff(name)}\n{_roff(text)}\n" for name, text in rows)
        for title, rows in sections.items()
        if rows
    )
    return _HEAD.format(summary=_roff(summary[0].lower() + summary[1:])) + body + _TAIL


def _rows(name: str, command: Any) -> Iterator[tuple[str, str]]:
    """Yield the name with its arguments, and the first line of the help, of a command or of those of a group."""
    if command.hidden:
        return
    for part, inner in getattr(command, "commands", {}).items():
        yield from _rows(f"{name} {part}", inner)
    if not hasattr(command, "commands"):
        _, *arguments = command.collect_usage_pieces(typer.Context(command))
        yield " ".join((name, *arguments)), command.get_short_help_str(limit=200)


def _roff(text: str) -> str:
    return text.replace("\\", r"\e").replace("-", r"\-").replace("'", r"\(aq")


if __name__ == "__main__":
    MAN_PAGE.write_text(man_page(), encoding="utf-8")
