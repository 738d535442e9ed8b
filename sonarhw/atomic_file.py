"""Write a file completely or not at all. A temporary file is written first, and renamed when it is complete.

Logs are not written in this way. They grow on disk reading by reading, and are readable after any interruption.
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
    """Open `path` for writing. The file is created or replaced only if the block raises no error.

    Raises OutputError. The block should only write, because every OSError in it is reported as an error of this file.
    """
    try:
        with _opened_in_place(path) if is_special(path) else _renamed_when_complete(path) as file:
            yield file
    except BrokenPipeError:
        raise
    except OSError as error:
        delete = "delete other files or " if error.errno in (errno.ENOSPC, errno.EDQUOT) else ""
        raise OutputError(f"{path}: {error.strerror or error}; {delete}choose another {option}") from error


def is_special(path: Path) -> bool:
    """Return whether a path is a device, a pipe or an open file. These are written to and never replaced."""
    # /dev/stdout may be a link to a regular file, to which the parent process continues to write
    return path.exists() and not path.is_dir() and (path.parent in _OPEN_FILES or not path.is_file())


@contextmanager
def _opened_in_place(path: Path) -> Iterator[BinaryIO]:
    with path.open("wb") as file:
        yield file


@contextmanager
def _renamed_when_complete(path: Path) -> Iterator[BinaryIO]:
    # a symbolic link is kept, and its target is replaced
    target = path.resolve()
    # a rename is atomic only within one folder
    unfinished = target.with_name(f".sonarhw-{secrets.token_hex(6)}.part")
    file = unfinished.open("xb")
    try:
        with file:
            yield file
            file.flush()
            # some file systems report a full disk only here
            os.fsync(file.fileno())
        if target.exists():
            shutil.copymode(target, unfinished)
        unfinished.replace(target)
    finally:
        unfinished.unlink(missing_ok=True)
