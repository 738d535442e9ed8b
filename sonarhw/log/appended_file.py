"""The file under a log that is being written: whole pieces, pushed to the disk as they come.

Takes bytes from the MCAP writer; hands on a file that ends behind a whole piece, whatever happens to process, disk
or drive. A file that is to be overwritten stays as it was until the new one has something to put in its place.
"""

import errno
import os
import secrets
import shutil
import threading
from contextlib import suppress
from io import FileIO
from pathlib import Path

from sonarhw.errors import LogError

_NO_DISK = (errno.EINVAL, errno.ENOTSUP, errno.EROFS)  # what a pipe or a device says that knows no fsync
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # what was written before stays


class LogFile:
    """Gathers what is written and gives it to the system in one piece at `flush`.

    With `live` a thread pushes every piece on to the disk at once, so that a drive that is pulled out has it, and so
    that its end is noticed: without that the system takes bytes for half a minute for a drive that is gone. Else
    the disk has everything when `close` returns.
    """

    def __init__(self, path: Path, overwrite: bool, live: bool) -> None:
        """Make the file. Raises LogError where it exists (unless `overwrite`) or cannot be made."""
        self.path = path
        self.readings = 0  # in the file after the next `flush`; what an error tells of
        self._pending = bytearray()
        self._written = 0  # bytes
        self._kept = 0  # readings
        self._beside = _beside(path) if overwrite and path.is_file() else None
        # a device or a pipe is always there, and nothing in it can be lost
        self._device = path.exists() and not path.is_file() and not path.is_dir()
        try:
            self._file = FileIO(self._beside or path, "wb" if self._device else "xb")
        except FileExistsError as error:
            raise LogError(f"{path}: exists already; choose another name or overwrite it on purpose") from error
        except OSError as error:
            raise LogError(f"{path}: cannot be written: {error.strerror}") from error
        self._pusher = _Pusher(self._file) if live else None

    @property
    def closed(self) -> bool:
        """Whether nothing can be written any more."""
        return self._file.closed

    @property
    def overwriting(self) -> bool:
        """Whether the file that is to be overwritten is still there as it was."""
        return self._beside is not None

    def write(self, data: bytes) -> int:
        """Keep the bytes for the next `flush`."""
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """Offset in the file of the next byte written."""
        return self._written + len(self._pending)

    def flush(self) -> None:
        """Give everything to the system. On failure cut the file behind its last whole piece and raise LogError."""
        try:
            if self._pusher and self._pusher.failure:
                raise self._pusher.failure
            left = memoryview(bytes(self._pending))
            while left:
                left = left[self._file.write(left) :]
            links = os.fstat(self._file.fileno()).st_nlink
        except OSError as error:
            self._give_up()
            raise self._failure(error) from error
        if links == 0:
            self._give_up()
            raise LogError(f"{self.path}: was deleted while it was being written; record into another folder")
        self._written += len(self._pending)
        self._kept = self.readings
        self._pending.clear()
        if self._pusher:
            self._pusher.push(self._kept)

    def take_place(self) -> None:
        """Put the file where the one is that it overwrites, if that has not happened yet. Raises LogError."""
        if self._beside is None:
            return
        beside, self._beside = self._beside, None
        self._stop_pushing()
        # not every system renames a file that is open
        self._file.close()
        try:
            target = self.path.resolve()
            if target.exists():
                shutil.copymode(target, beside)
            beside.replace(target)
            self._file = FileIO(target, "ab")
        except OSError as error:
            beside.unlink(missing_ok=True)
            raise LogError(f"{self.path}: cannot be overwritten: {error.strerror}; choose another name") from error
        if self._pusher:
            self._pusher = _Pusher(self._file)
            self._pusher.push(self._kept)

    def close(self) -> None:
        """Push everything to the disk and close the file; what was not flushed is dropped. Raises LogError."""
        if self._file.closed:
            return
        try:
            self._stop_pushing()
            _push(self._file)
        except OSError as error:
            raise self._failure(error) from error
        finally:
            self._file.close()

    def drop(self) -> None:
        """Close the file and remove it; one that was to be overwritten stays as it was."""
        if not self._file.closed:
            self._give_up()
        if not self._beside and not self._device:
            self.path.unlink(missing_ok=True)

    def _failure(self, error: OSError) -> LogError:
        # a full disk keeps what it took; of one that has gone only what was pushed to it is sure
        pusher = self._pusher
        unsure = pusher and (error is pusher.failure or error.errno not in _FULL)
        kept = pusher.kept if pusher and unsure else self._kept
        if not kept:
            return LogError(
                f"{self.path}: cannot be written: {error.strerror}; nothing is recorded, choose another file"
            )
        told = f"{kept} reading{' is' if kept == 1 else 's are'} kept in it"
        room = "make room or " if error.errno in _FULL else ""
        return LogError(
            f"{self.path}: cannot be written any further: {error.strerror}; {told}; {room}record to another disk"
        )

    def _stop_pushing(self) -> None:
        if self._pusher:
            self._pusher.stop()

    def _give_up(self) -> None:
        try:
            self._stop_pushing()
            self._file.truncate(self._written)
        except OSError:
            pass  # then the reader finds where the last whole piece ends
        finally:
            self._file.close()
            if self._beside:
                with suppress(OSError):
                    self._beside.unlink(missing_ok=True)


class _Pusher:
    """A thread that pushes a file to its disk as often as that keeps up with."""

    def __init__(self, file: FileIO) -> None:
        self.kept = 0  # readings that are on the disk
        self._file = file
        self._wanted = 0
        self.failure: OSError | None = None
        self._stopping = False
        self._wake = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"push {file.name!s}", daemon=True)
        self._thread.start()

    def push(self, readings: int) -> None:
        """Push what is there by now, with that many readings, without waiting for it."""
        self._wanted = readings
        self._wake.set()

    def stop(self) -> None:
        """End the thread. The file may be closed then."""
        self._stopping = True
        self._wake.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._stopping and not self.failure:
            self._wake.wait()
            self._wake.clear()
            wanted = self._wanted
            try:
                _push(self._file)
            except OSError as error:
                self.failure = error
            else:
                self.kept = wanted


def _push(file: FileIO) -> None:
    try:
        os.fsync(file.fileno())
    except OSError as error:
        if error.errno not in _NO_DISK:
            raise


def _beside(path: Path) -> Path:
    # only within one folder does a file change its name in one step
    return path.resolve().with_name(f".sonarhw-{secrets.token_hex(6)}.part")
