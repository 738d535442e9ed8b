"""The log that a command reads: opened, with one line of warning where it is torn."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import InputError

if TYPE_CHECKING:
    from sonarhw.log import Log

LogFile = Annotated[Path, typer.Argument(help="Log (*.mcap), whole or torn.", metavar="LOG")]


def open_log(path: Path) -> "Log":
    """The log in a file. Warns on standard error where it is torn; raises InputError where there is no such file."""
    from sonarhw.log import read_log

    if not path.is_file():
        raise InputError(f"{path}: there is no such file; give the name of a log (*.mcap)")
    log = read_log(path)
    if log.torn:
        typer.echo(f"sonarhw: warning: {path}: {log.torn}; going on with {len(log.readings)} whole readings", err=True)
    return log
