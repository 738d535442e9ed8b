"""Input files that are regular and bounded, files that are written completely or not at all, and free space."""

import errno
import os
import re
import select
import shutil
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

from platformdirs import user_data_path

from sonarhw.errors import OutputError


def recordings_folder() -> Path:
    """Return the folder of recordings of this user; it may not exist yet."""
    return user_data_path("sonarhw", appauthor=False) / "recordings"


# input files: a device may be endless or a port that resets its board, and a named pipe may wait for ever


MOST_FOREIGN = 100_000_000_000  # bytes of a file of another program; a bag may contain pictures
_PIPE_WITHIN = 60.0  # s for all bytes of a pipe
_KINDS = {
    stat.S_IFDIR: os.strerror(errno.EISDIR),
    stat.S_IFIFO: "it is a named pipe, not a file",
    stat.S_IFSOCK: "it is a socket, not a file",
}


def open_input(path: Path, most: int, *, pipes: bool = False) -> BinaryIO:
    """Open an input file: a regular file of at most `most` bytes.

    With `pipes` also an empty device and a pipe that a shell has opened, such as standard input or `<(command)`; it is
    read to its end within a minute. Raises OSError with a clause as `strerror`, ValueError for a NUL in the name.
    """
    kind = path.stat().st_mode  # opening a port can reset the board behind it
    if stat.S_ISREG(kind):
        return _opened_regular(path, most)
    if pipes and stat.S_ISFIFO(kind) and os.path.realpath(path).startswith("/proc/"):
        return BytesIO(_read_pipe(path, most))
    if pipes and stat.S_ISCHR(kind) and os.path.samefile(path, os.devnull):
        return BytesIO()
    raise OSError(errno.EINVAL, _KINDS.get(stat.S_IFMT(kind), "it is a device, not a file"))


def _opened_regular(path: Path, most: int) -> BinaryIO:
    # another program may just have replaced the file by a pipe
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    file = os.fdopen(descriptor, "rb")
    status = os.fstat(descriptor)
    if stat.S_ISREG(status.st_mode) and status.st_size <= most:
        return file
    file.close()
    if not stat.S_ISREG(status.st_mode):
        raise OSError(errno.EINVAL, "it is not a file any more")
    raise OSError(errno.EFBIG, f"it has {status.st_size / 1e6:.4g} MB, at most {most / 1e6:.4g} MB are read")


def _read_pipe(path: Path, most: int) -> bytes:
    """Return the bytes of a pipe, one more than `most` if it has more."""
    until, content = time.monotonic() + _PIPE_WITHIN, bytearray()
    with path.open("rb", buffering=0) as pipe:
        while len(content) <= most:
            ready, _, _ = select.select([pipe], [], [], max(0.0, until - time.monotonic()))
            if not ready:
                raise OSError(errno.ETIMEDOUT, f"this pipe has not ended within {_PIPE_WITHIN:g} s")
            piece = pipe.read(most + 1 - len(content))
            if not piece:
                break
            content += piece
    return bytes(content)


# files that no reader of data takes, recognised by their first bytes


# what each of them is, and what to do with it
NO_DATA = {
    "spreadsheet": ("a spreadsheet", "save it as CSV in the spreadsheet program, then import the CSV"),
    "document": ("a document", "save its numbers as CSV or as plain text, then import that file"),
    "archive": ("an archive", "unpack it, and give the file in it"),
    "picture": ("a picture", "no command reads pictures; give the file that it was made from"),
    "page": ("a web page", "open it in a browser"),
}
_NO_DATA_STARTS = (
    (rb"\x89PNG|\xff\xd8\xff|GIF8|BM.{4}\0{4}|II\*\0|MM\0\*", "picture"),
    (rb"%PDF|\{\\rtf", "document"),
    (rb"\s*<(!DOCTYPE html|html)", "page"),
    (rb"\x1f\x8b|7z\xbc\xaf|Rar!|BZh[1-9]|\xfd7zXZ|.{257}ustar", "archive"),
)
_OLD_OFFICE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_ZIP, _ZIP_NAME = b"PK\x03\x04", 30  # bytes before the name of the first file in it
_SPREADSHEETS = (".xls", ".xlsx", ".xlsm", ".xlsb", ".ods", ".numbers")
_DOCUMENTS = (".doc", ".docx", ".odt", ".ppt", ".pptx", ".odp", ".pages")


def no_data(name: str, start: bytes) -> str:
    """Return the kind, a key of `NO_DATA`, of a file that cannot be data; empty for others.

    `start`: its first bytes, 512 or more. Of an office program or an archive, its `name` may show the kind.
    """
    if kind := next((kind for pattern, kind in _NO_DATA_STARTS if re.match(pattern, start, re.DOTALL)), ""):
        return kind
    ending = Path(name).suffix.lower()
    inside = start[_ZIP_NAME:][: int.from_bytes(start[_ZIP_NAME - 4 : _ZIP_NAME - 2], "little")]
    is_zip = start.startswith(_ZIP) and ending not in (".npz", ".npy") and not inside.endswith(b".npy")
    if not is_zip and not start.startswith(_OLD_OFFICE):
        return ""
    if ending in _DOCUMENTS or b"word/" in start or b"opendocument.text" in start:
        return "document"
    is_sheet = not is_zip or ending in _SPREADSHEETS or b"xl/" in start or b"opendocument.spreadsheet" in start
    return "spreadsheet" if is_sheet else "archive"


# files that appear under their name when they are complete; logs of running scans grow reading by reading


_OPEN_FILES = (Path("/dev/fd"), Path("/proc/self/fd"))
_STREAMS = {Path("/dev/stdin"): 0, Path("/dev/stdout"): 1, Path("/dev/stderr"): 2}
_NO_LINKS = (errno.EPERM, errno.ENOTSUP, errno.ENOSYS, errno.EMLINK)  # file systems without hard links
_unfinished: set[Path] = set()  # hidden files that this process is writing


@contextmanager
def atomic_file(path: Path, what: str = "file", *, overwrite: bool = False) -> Iterator[BinaryIO]:
    """Open `path` for writing. The file is created or, with `overwrite`, replaced only if the block raises no error.

    Raises OutputError, also if the file exists at the end of the block and `overwrite` is false. The block should only
    write, because every OSError in it is reported as an error of this file.
    """
    try:
        with _opened_in_place(path) if is_special(path) else _renamed_when_complete(path, overwrite) as file:
            yield file
    except BrokenPipeError:
        raise
    except FileExistsError as error:
        raise OutputError(f"{path}: exists already; choose another {what}") from error
    except OSError as error:
        delete = "delete other files or " if error.errno in (errno.ENOSPC, errno.EDQUOT) else ""
        raise OutputError(f"{path}: {error.strerror or error}; {delete}choose another {what}") from error


def is_special(path: Path) -> bool:
    """Return whether a path is a device, a pipe or an open file. These are written to and never replaced."""
    # /dev/stdout may be a link to a regular file, to which the parent process continues to write
    return path.exists() and not path.is_dir() and (_descriptor(path) is not None or not path.is_file())


@contextmanager
def unfinished_file(target: Path) -> Iterator[Path]:
    """Yield the name of a hidden file in the folder of `target`. It is removed at the end unless it was renamed."""
    # a rename is atomic only within one folder
    path = target.with_name(f".sonarhw-{os.urandom(6).hex()}.part")
    _unfinished.add(path)
    try:
        yield path
    finally:
        path.unlink(missing_ok=True)
        _unfinished.discard(path)


def remove_unfinished() -> None:
    """Remove all hidden files that this process is writing. For a process that exits without unwinding."""
    for path in tuple(_unfinished):
        with suppress(OSError):
            path.unlink()


def _descriptor(path: Path) -> int | None:
    if path.parent in _OPEN_FILES and path.name.isdecimal():
        return int(path.name)
    return _STREAMS.get(path)


@contextmanager
def _opened_in_place(path: Path) -> Iterator[BinaryIO]:
    descriptor = _descriptor(path)
    # opening an open file by its name would truncate it
    with path.open("wb") if descriptor is None else os.fdopen(os.dup(descriptor), "wb") as file:
        yield file


@contextmanager
def _renamed_when_complete(path: Path, overwrite: bool) -> Iterator[BinaryIO]:
    # a symbolic link is kept, and its target is replaced
    target = path.resolve()
    with unfinished_file(target) as unfinished:
        with unfinished.open("xb") as file:
            yield file
            file.flush()
            # some file systems report a full disk only here
            os.fsync(file.fileno())
        if overwrite:
            replace_regular(unfinished, target)
        else:
            _rename_to_new(unfinished, target)


def replace_regular(unfinished: Path, target: Path) -> None:
    """Rename a complete file to `target`, which may be a regular file or missing. Raises OSError."""
    if target.exists():
        if not target.is_file():
            raise OSError(errno.EINVAL, "it is not a regular file, and is not replaced")
        shutil.copymode(target, unfinished)
    unfinished.replace(target)


def _rename_to_new(unfinished: Path, target: Path) -> None:
    """Rename a file. Raises FileExistsError if the target exists, even if another process has just created it."""
    try:
        target.hardlink_to(unfinished)
    except OSError as error:
        if error.errno not in _NO_LINKS:
            raise
        if target.exists():
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(target)) from error
        unfinished.replace(target)


# two warnings of a full disk: one when it is nearly full, and one shortly before it is full


_CHECK_EVERY = 1.0  # s
_RATE_KNOWN_AFTER = 5.0  # s of writing
# limits of the two warnings: remaining recording time, s, and free bytes
_NEARLY_FULL = (600.0, 32_000_000)
_ABOUT_TO_BE_FULL = (60.0, 2_000_000)
# bytes of a reading and of a trace sample in a log with its index
_READING = 800.0
_SAMPLE = 2.4  # bytes of a sample of a trace: its frame, and 1 or 2 bytes in its decoded message


class DiskSpaceMonitor:
    """Watches the free space of the disk of `path` while that file grows, and passes warnings to `warn`."""

    def __init__(self, path: Path, warn: Callable[[str], None]) -> None:
        self._path = path
        self._warn = warn
        self._limits = [_NEARLY_FULL, _ABOUT_TO_BE_FULL]
        self._began: float | None = None
        self._next_check = 0.0

    def written(self, size: int, now: float) -> None:
        """Check the free space, at most once a second. `size` bytes have been written until `now`, s on any clock."""
        if self._began is None:
            self._began = self._next_check = now
        if now < self._next_check or not self._limits:
            return
        self._next_check = now + _CHECK_EVERY
        free = free_bytes(self._path)
        if free is None:
            return
        took = now - self._began
        left = free / (size / took) if took > _RATE_KNOWN_AFTER and size else float("inf")
        reached = [limit for limit in self._limits if left < limit[0] or free < limit[1]]
        if reached:
            self._limits = [limit for limit in self._limits if limit not in reached]
            time = f", enough for about {_span(left)} of this scan" if left < float("inf") else ""
            self._warn(f"{self._path}: its disk is nearly full: {free / 1e6:.1f} MB are free{time}; delete other files")


def log_size(readings: int, samples: float) -> float:
    """Estimate the bytes of a log with that many readings, each with a trace of `samples` samples."""
    return readings * (_READING + _SAMPLE * samples)


def free_bytes(path: Path) -> int | None:
    """Return the free bytes of the disk of `path`, or None if they are unknown."""
    try:
        return shutil.disk_usage(path.resolve().parent).free
    except OSError:
        return None


def _span(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} minutes"
