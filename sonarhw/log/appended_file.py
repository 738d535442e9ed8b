"""The file of a log that is being written, in whole pieces that are synced to the disk one by one.

The file ends after a whole piece, whatever happens to process, disk or drive. A file to be overwritten is unchanged
until the new log has its first reading.
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

_NO_DISK = (errno.EINVAL, errno.ENOTSUP, errno.EROFS)  # errors of pipes and devices without fsync
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # errors after which all earlier bytes are kept


class LogFile:
    """Collects bytes and writes them in one piece at `flush`.

    With `live` a thread syncs every piece to the disk at once. A drive that is pulled out then has all pieces, and its
    removal is noticed: without a sync the system accepts bytes for a removed drive for half a minute. Without `live`
    everything is on the disk when `close` returns.
    """

    def __init__(self, path: Path, overwrite: bool, live: bool) -> None:
        """Create the file. Raises LogError if it exists (unless `overwrite`) or cannot be created."""
        self.path = path
        self.readings = 0  # in the file after the next `flush`; stated in error messages
        self._pending = bytearray()
        self._written = 0  # bytes
        self._kept = 0  # readings
        self._beside = _beside(path) if overwrite and path.is_file() else None
        # a device or a pipe always exists, and has no content to lose
        self._device = path.exists() and not path.is_file() and not path.is_dir()
        try:
            self._file = FileIO(self._beside or path, "wb" if self._device else "xb")
        except FileExistsError as error:
            raise LogError(f"{path}: exists already; choose another name, or allow overwriting it") from error
        except OSError as error:
            raise LogError(f"{path}: cannot be written: {error.strerror}") from error
        self._pusher = _Pusher(self._file) if live else None

    @property
    def closed(self) -> bool:
        """Whether the file is closed."""
        return self._file.closed

    @property
    def overwriting(self) -> bool:
        """Whether the file to be overwritten is still unchanged."""
        return self._beside is not None

    def write(self, data: bytes) -> int:
        """Store the bytes until the next `flush`."""
        self._pending += data
        return len(data)

    def tell(self) -> int:
        """Return the offset in the file of the next byte."""
        return self._written + len(self._pending)

    def flush(self) -> None:
        """Write all stored bytes. On failure truncate the file after its last whole piece and raise LogError."""
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
        """Replace the file to be overwritten, unless this has been done. Raises LogError."""
        if self._beside is None:
            return
        beside, self._beside = self._beside, None
        self._stop_pushing()
        # some systems cannot rename an open file
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
        """Sync the file to the disk and close it. Bytes that were not flushed are dropped. Raises LogError."""
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
        """Close and remove the file. A file to be overwritten is unchanged."""
        if not self._file.closed:
            self._give_up()
        if not self._beside and not self._device:
            self.path.unlink(missing_ok=True)

    def _failure(self, error: OSError) -> LogError:
        # a full disk keeps all it accepted; a removed one only what was synced
        pusher = self._pusher
        unsure = pusher and (error is pusher.failure or error.errno not in _FULL)
        kept = pusher.kept if pusher and unsure else self._kept
        if not kept:
            return LogError(
                f"{self.path}: cannot be written: {error.strerror}; nothing is recorded, choose another file"
            )
        count = f"{kept} reading{' is' if kept == 1 else 's are'} kept in it"
        room = "free disk space or " if error.errno in _FULL else ""
        return LogError(
            f"{self.path}: cannot be written any further: {error.strerror}; {count}; {room}record to another disk"
        )

    def _stop_pushing(self) -> None:
        if self._pusher:
            self._pusher.stop()

    def _give_up(self) -> None:
        try:
            self._stop_pushing()
            self._file.truncate(self._written)
        except OSError:
            pass  # the reader finds the end of the last whole piece
        finally:
            self._file.close()
            if self._beside:
                with suppress(OSError):
                    self._beside.unlink(missing_ok=True)


class _Pusher:
    """A thread that syncs a file to its disk as often as the disk allows."""

    def __init__(self, file: FileIO) -> None:
        self.kept = 0  # readings on the disk
        self._file = file
        self._wanted = 0
        self.failure: OSError | None = None
        self._stopping = False
        self._wake = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"push {file.name!s}", daemon=True)
        self._thread.start()

    def push(self, readings: int) -> None:
        """Request a sync of the file, which has that many readings now, without waiting for it."""
        self._wanted = readings
        self._wake.set()

    def stop(self) -> None:
        """End the thread. Then the file may be closed."""
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
    # a rename is atomic only within one folder
    return path.resolve().with_name(f".sonarhw-{secrets.token_hex(6)}.part")
