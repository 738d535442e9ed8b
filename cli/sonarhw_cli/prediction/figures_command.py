"""`sonarhw figures`: draw every figure of the paper, and check the claims of the paper about it."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from sonarhw.errors import counted
from sonarhw.files import atomic_file
from sonarhw_cli.console.lines import print_line
from sonarhw_cli.console.options import ForceFiles
from sonarhw_cli.console.output import made_folder, refuse_existing_in
from sonarhw_cli.console.progress import progress


class PictureFormat(StrEnum):
    """The formats of `sonarhw_compare.pictures.PICTURES`."""

    PNG = "png"
    PDF = "pdf"
    SVG = "svg"


def figures(
    folder: Annotated[Path, typer.Argument(help="Folder for the pictures and figures.md.", metavar="DIR")],
    picture_format: Annotated[PictureFormat, typer.Option("--format", help="Format of the pictures.")] = (
        PictureFormat.PNG
    ),
    force: ForceFiles = False,
) -> None:
    """Draw the paper's figures again and check each. DIR/figures.md states whether each agrees with the paper."""
    from sonarhw_compare.paper.figures import EXHIBITS, PAGE, claims, page, picture, picture_name

    suffix = f".{picture_format.value}"
    text = folder / PAGE
    pictures = [folder / picture_name(exhibit, suffix) for exhibit in EXHIBITS]
    refuse_existing_in(folder, [text, *pictures], force, "DIR")
    held = []
    with made_folder(folder), progress(len(EXHIBITS), lambda: "Drawing") as advance:
        for exhibit, out in zip(EXHIBITS, pictures, strict=True):
            held += [claim.holds for claim in claims(exhibit)]
            _write(out, picture(exhibit, suffix), force)
            advance()
    _write(text, page(suffix).encode(), force)
    print_line(f"{counted(len(pictures), 'figure')}; {sum(held)} of {counted(len(held), 'claim')} hold: {text}")


def _write(out: Path, content: bytes, force: bool) -> None:
    with atomic_file(out, "folder", overwrite=force) as file:
        file.write(content)
