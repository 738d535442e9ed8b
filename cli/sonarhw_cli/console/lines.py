"""Lines that the commands print. Names from files and devices may contain anything, so each line is made harmless.

Only this module prints text. A rule of ruff forbids `typer.echo` elsewhere. The global options --quiet and
--verbose select the messages on standard error. Results and errors are always printed.
"""

from enum import IntEnum

import typer

from sonarhw.errors import harmless, json_text, shortened

_MOST = 1000  # characters of a line on standard error


class Verbosity(IntEnum):
    """The messages that are printed."""

    QUIET = 0  # none: no warnings, no progress bars, no closing lines
    NORMAL = 1
    VERBOSE = 2  # also what a command has read and chosen, and the class of an error


_chosen = Verbosity.NORMAL


def choose_verbosity(*, quiet: bool, verbose: bool) -> None:
    """Select the messages of this run. --quiet wins."""
    global _chosen
    _chosen = Verbosity.QUIET if quiet else Verbosity.VERBOSE if verbose else Verbosity.NORMAL


def prints(level: Verbosity) -> bool:
    """Report whether messages of a level are printed."""
    return _chosen >= level


def print_line(text: str = "") -> None:
    """Print a line on standard output."""
    typer.echo(harmless(text))


def print_json(figures: object) -> None:
    """Print JSON on standard output, indented. JSON escapes control characters itself."""
    typer.echo(json_text(figures))


def print_note(text: str) -> None:
    """Print text as one line on standard error, unless --quiet is given."""
    if prints(Verbosity.NORMAL):
        _print_on_stderr(text)


def warn(message: str) -> None:
    """Print a warning as one line on standard error, unless --quiet is given."""
    print_note(f"sonarhw: warning: {message}")


def print_detail(text: str) -> None:
    """With --verbose, print on standard error what a command has read or chosen."""
    if prints(Verbosity.VERBOSE):
        _print_on_stderr(f"sonarhw: {text}")


def print_error(message: str) -> None:
    """Print an error as one line on standard error."""
    _print_on_stderr(f"sonarhw: {message}")


def print_help(text: str) -> None:
    """Print a help text with its line breaks on standard error."""
    typer.echo(text, err=True)


def _print_on_stderr(text: str) -> None:
    """Print text as one line. Of a very long text only the begin and the end are printed."""
    typer.echo(shortened(harmless(" ".join(text.split())), _MOST), err=True)
