"""New room files and board profiles from a template."""

from pathlib import Path
from typing import Annotated

import typer

from sonarhw.errors import InputError
from sonarhw.files import atomic_file

NewFile = Annotated[Path, typer.Argument(help="File to create.", metavar="NAME.toml")]


def write_template(package: str, file: Path) -> None:
    """Write the template of a package to a new file. Raises InputError if it exists or has another suffix."""
    from importlib.resources import files

    if file.suffix != ".toml":
        raise InputError(f"{file}: expected a name ending in .toml")
    if file.exists() or file.is_symlink():
        raise InputError(f"{file}: exists already; choose another name")
    if not file.parent.is_dir():
        raise InputError(f"{file}: no such folder: {file.parent}; create it first")
    with atomic_file(file) as out:
        out.write((files(package) / "template.toml").read_bytes())
