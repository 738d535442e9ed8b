"""What commands write: standard output, and files that are whole or not there at all.

Takes a name that `cli.options.checked_out` has let pass; hands on a file to write into. Logs are not written through
here: they grow on disk reading by reading and are readable however they end.
"""

import errno
import os
import secrets
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import StringIO
from pathlib import Path
from typing import BinaryIO, TextIO

from cli.options import STDOUT, is_special
from sonarhw.errors import InputError, OutputError


@contextmanager
def text_output(out: str) -> Iterator[TextIO]:
    """Standard output for `-`, else text that becomes the file `out` when the block has ended well.

    Raises OutputError.
    """
    if out == STDOUT:
        with _flushed(standard_output()) as text:
            yield text
        return
    text = StringIO(newline="")
    yield text
    with whole_file(Path(out)) as file:
        file.write(text.getvalue().encode())


def standard_output() -> TextIO:
    """Standard output. Raises OutputError where it was closed before the command began."""
    if sys.stdout is None:
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
def whole_file(path: Path, option: str = "--out") -> Iterator[BinaryIO]:
    """The file `path`, which is there, or written anew, only when the block has ended well. Raises OutputError.

    Nothing but writing belongs into the block: any OSError in it is told as one of this file.
    """
    try:
        with _written_into(path) if is_special(path) else _replaced(path) as file:
            yield file
    except BrokenPipeError:
        raise
    except OSError as error:
        free = "free some or " if error.errno in (errno.ENOSPC, errno.EDQUOT) else ""
        raise OutputError(f"{path}: {error.strerror or error}; {free}choose another {option}") from error


@contextmanager
def made_folder(folder: Path) -> Iterator[None]:
    """A folder for several files, made if it is not there; where the block ends badly none is left that is empty.

    Raises InputError.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be made: {error.strerror}; give another folder") from error
    try:
        yield
    except BaseException:
        with suppress(OSError):
            for path in made:
                path.rmdir()
        raise


@contextmanager
def _written_into(path: Path) -> Iterator[BinaryIO]:
    with path.open("wb") as file:
        yield file


@contextmanager
def _replaced(path: Path) -> Iterator[BinaryIO]:
    # a link stays one: what it leads to is replaced
    target = path.resolve()
    # only within one folder does a file change its name in one step
    unfinished = target.with_name(f".sonarhw-{secrets.token_hex(6)}.part")
    file = unfinished.open("xb")
    try:
        with file:
            yield file
            file.flush()
            # some file systems find out only now that they are full
            os.fsync(file.fileno())
        if target.exists():
            shutil.copymode(target, unfinished)
        unfinished.replace(target)
    finally:
        unfinished.unlink(missing_ok=True)
