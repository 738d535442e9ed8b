"""Warnings: one line on standard error; the command continues."""

import typer


def warn(message: str) -> None:
    """Print a warning."""
    typer.echo(f"sonarhw: warning: {message}", err=True)
