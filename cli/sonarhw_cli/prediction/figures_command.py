"""`sonarhw figures`: draw every figure of the paper, and check the claims of the paper about it."""

from pathlib import Path
from typing import Annotated

import typer

from sonarhw.errors import InputError
from sonarhw_cli.console.number_format import counted
from sonarhw_cli.console.options import refuse_existing
from sonarhw_cli.console.output import atomic_file, made_folder
from sonarhw_cli.console.progress import progress


def figures(
    folder: Annotated[Path, typer.Argument(help="Folder for the pictures and figures.md.", metavar="DIR")],
    force: Annotated[bool, typer.Option("--force", help="Overwrite files of these names.")] = False,
) -> None:
    """Draw the paper's figures again and check each. DIR/figures.md states whether each agrees with the paper."""
    from sonarhw_compare.paper.page import EXHIBITS, PAGE, claims, page, picture, picture_name

    text = folder / PAGE
    pictures = [folder / picture_name(exhibit) for exhibit in EXHIBITS]
    _check(folder, [text, *pictures], force)
    held = []
    with made_folder(folder), progress(len(EXHIBITS), lambda: "Drawing") as advance:
        for exhibit, out in zip(EXHIBITS, pictures, strict=True):
            held += [claim.holds for claim in claims(exhibit)]
            _write(out, picture(exhibit))
            advance()
    _write(text, page().encode())
    typer.echo(f"{counted(len(pictures), 'figure')}; {sum(held)} of {counted(len(held), 'claim')} hold: {text}")


def _check(folder: Path, files: list[Path], force: bool) -> None:
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; give the name of a folder")
    for file in files if folder.exists() else ():
        refuse_existing(file, force, "DIR")


def _write(out: Path, content: bytes) -> None:
    with atomic_file(out, "DIR") as file:
        file.write(content)
