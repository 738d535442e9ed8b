"""Rooms and boards by name: a shipped one such as `laboratory`, or a file of the user such as `./laboratory.toml`.

One rule separates them. A text that ends in `.toml` or contains a slash is the name of a file; any other text is the
name of a shipped room or board. A `Path` is always a file.
"""

import os
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from sonarhw.errors import InputError
from sonarhw_sim.near_miss import did_you_mean
from sonarhw_sim.toml_file import quoted, read_text

SUFFIX = ".toml"


def is_file(name: Path | str) -> bool:
    """Return whether `name` is the name of a file, not of something shipped."""
    return isinstance(name, Path) or name.endswith(SUFFIX) or "/" in name or os.sep in name


def file_name(name: Path | str) -> str:
    """Return the name of the file without its folder, also for something shipped."""
    return Path(name).name if is_file(name) else f"{name}{SUFFIX}"


@dataclass(frozen=True)
class Shipped:
    """The TOML files of one package."""

    package: str
    what: str  # one of them, for errors: "room"
    document: str  # its file, for errors: "room file"

    def names(self) -> list[str]:
        """Return the names of the shipped ones, in order."""
        entries = (entry.name for entry in files(self.package).iterdir())
        return sorted(name.removesuffix(SUFFIX) for name in entries if name.endswith(SUFFIX))

    def read(self, name: Path | str) -> tuple[str, str]:
        """Return the text of a file or of a shipped one, and its name for errors. Raises InputError."""
        if is_file(name):
            if not os.path.exists(name) and name in [f"{shipped}{SUFFIX}" for shipped in self.names()]:
                raise InputError(f"{name}: no such file; the shipped {self.what} is {str(name).removesuffix(SUFFIX)!r}")
            return read_text(Path(name), self.document), str(name)
        if name not in self.names():
            raise InputError(self._unknown(str(name)))
        shipped = files(self.package) / f"{name}{SUFFIX}"
        return shipped.read_text(encoding="utf-8"), shipped.name

    def _unknown(self, name: str) -> str:
        names = self.names()
        found = next((file for file in (name, f"{name}{SUFFIX}") if os.path.isfile(file)), None)
        if found:
            read_text(Path(found), self.document)  # raises an error for a log, which must not be suggested
        hint = f"; did you mean the file ./{found}?" if found else did_you_mean(name, names)
        return f"unknown {self.what} {quoted(name)}{hint or ';'} known: {', '.join(names)}, or a file NAME{SUFFIX}"
