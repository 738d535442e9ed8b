"""Output of the commands: standard output, and files that are written completely or not at all.

File names must have been checked by `options.checked_out`. Logs are not written here: they grow on disk reading by
reading, and are readable after any interruption.
"""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import StringIO, TextIOBase
from pathlib import Path
from typing import BinaryIO, TextIO

from sonarhw.atomic_file import atomic_file, is_special
from sonarhw.errors import InputError, OutputError
from sonarhw_cli.console.lines import print_note
from sonarhw_cli.console.options import STDOUT


@contextmanager
def written_file(path: Path, what: str = "file", *, overwrite: bool = False) -> Iterator[BinaryIO]:
    """Yield the file `path`, kept only if the block succeeds, and print its name then. Raises OutputError."""
    with atomic_file(path, what, overwrite=overwrite) as file:
        yield file
    print_written(path)


def print_written(path: Path) -> None:
    """Print that a file is written, on standard error; nothing for a device or a pipe, and with --quiet."""
    if not is_special(path):
        print_note(f"{path}: written")


@contextmanager
def text_output(out: str, overwrite: bool) -> Iterator[TextIO]:
    """Yield standard output for `-`, else a buffer that is written to the file `out` if the block succeeds.

    Raises OutputError.
    """
    if out == STDOUT:
        with _flushed(standard_output()) as text:
            yield text
        return
    text = StringIO(newline="")
    yield text
    with written_file(Path(out), overwrite=overwrite) as file:
        file.write(text.getvalue().encode())


@contextmanager
def binary_output(out: str, overwrite: bool) -> Iterator[BinaryIO]:
    """Yield standard output for `-`, else the file `out`, kept only if the block succeeds. Raises OutputError."""
    if out != STDOUT:
        with written_file(Path(out), overwrite=overwrite) as file:
            yield file
        return
    with _flushed(standard_output()) as text:
        yield text.buffer


class ClosedOutput(TextIOBase):
    """Standard output that was closed before the command started. Writing raises OutputError."""

    def write(self, text: str) -> int:
        """Raise OutputError, unless the text is empty."""
        if text:
            raise OutputError("standard output: is closed; leave it open, or redirect it to a file")
        return 0


def standard_output() -> TextIO:
    """Return standard output. Raises OutputError if it was closed before the command started."""
    if sys.stdout is None or isinstance(sys.stdout, ClosedOutput):
        raise OutputError("standard output: is closed; leave it open, or name a file with --out")
    return sys.stdout


@contextmanager
def _flushed(text: TextIO) -> Iterator[TextIO]:
    try:
        yield text
        text.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OutputError(f"standard output: {error.strerror or error}; name a file with --out") from error


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """Create a folder for several files if it is missing, and remove it again if the block fails and it is empty.

    Raises InputError.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        # within `try`: Ctrl-C may come as soon as the folder exists
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{folder}: cannot be created: {error.strerror}; give another folder") from error
        yield
    except BaseException:
        for path in made:
            with suppress(OSError):
                path.rmdir()
        raise
