"""Warnings: one line on standard error, after which the command goes on."""

import typer


def warn(message: str) -> None:
    """Print a warning."""
    typer.echo(f"sonarhw: warning: {message}", err=True)
