"""Files that are whole or not there at all: written beside their place, and put there when they are done.

Takes a path; hands on a file to write into. Logs are not written through here: they grow on disk reading by reading
and are readable however they end.
"""

import errno
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from sonarhw.errors import OutputError

_OPEN_FILES = (Path("/dev"), Path("/dev/fd"), Path("/proc/self/fd"))


@contextmanager
def atomic_file(path: Path, option: str = "--out") -> Iterator[BinaryIO]:
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


def is_special(path: Path) -> bool:
    """Whether a name stands for a device, a pipe or an open file, which is written into and never replaced."""
    # /dev/stdout and its kind may lead to a plain file, which whoever opened it goes on writing to
    return path.exists() and not path.is_dir() and (path.parent in _OPEN_FILES or not path.is_file())


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
