"""Warnings: one line on standard error; the command continues."""

from sonarhw_cli.console.lines import print_note


def warn(message: str) -> None:
    """Print a warning, unless --quiet is given."""
    print_note(f"sonarhw: warning: {message}")
