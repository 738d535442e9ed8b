"""The file of a log: one that grows during a recording, or one that is written as a whole.

The file of a recording grows in whole pieces, which are synced to the disk one by one.

If the process is killed, the disk is full or the drive is removed, the file ends after a whole piece. A file to be
overwritten is unchanged until the new log has its first reading.
"""

import errno
import os
import shutil
import threading
from contextlib import ExitStack, suppress
from io import FileIO
from pathlib import Path
from typing import BinaryIO

from sonarhw.atomic_file import unfinished_file
from sonarhw.errors import LogError
from sonarhw.harmless_text import counted_are

_NO_SYNC = (errno.EINVAL, errno.ENOTSUP, errno.EROFS)  # errors of pipes and devices without fsync
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # errors after which all earlier bytes are kept


class WholeLogFile:
    """The file of a log that is written as a whole. The caller has opened it, and keeps or discards it at the end."""

    disposable = True  # whether the new file may be removed after an error

    def __init__(self, file: BinaryIO) -> None:
        self.path = Path(str(file.name))
        self.readings = 0
        self.closed = False
        self._file = file
        self._written = 0

    def write(self, data: bytes) -> int:
        """Write the bytes."""
        self._written += len(data)
        return self._file.write(data)

    def tell(self) -> int:
        """Return the offset in the file of the next byte."""
        return self._written

    def flush(self) -> None:
        """Do nothing. The caller flushes the file."""

    def replace_old_file(self) -> None:
        """Do nothing. The caller replaces the old file."""

    def close(self) -> None:
        """Let no more bytes be written. The caller closes the file."""
        self.closed = True

    drop = close


class LogFile:
    """Collects bytes and writes them in one piece at `flush`.

    A thread syncs every piece to the disk at once. A drive that is pulled out then has all pieces, and its removal is
    detected. Without a sync, the system accepts bytes for a removed drive for half a minute.
    """

    def __init__(self, path: Path, overwrite: bool) -> None:
        """Create the file. Raises LogError if it exists (unless `overwrite`) or cannot be created."""
        self.path = path
        self.readings = 0  # readings in the file after the next `flush`, for error messages
        self._pending = bytearray()
        self._written = 0  # bytes
        self._kept = 0  # readings in the file
        self._hidden = ExitStack()
        self._unfinished: Path | None = None
        if overwrite and path.is_file():
            self._unfinished = self._hidden.enter_context(unfinished_file(path.resolve()))
        # a device or a pipe always exists, and has no content to lose
        self._device = path.exists() and not path.is_file() and not path.is_dir()
        try:
            self._file = FileIO(self._unfinished or path, "wb" if self._device else "xb")
        except FileExistsError as error:
            raise LogError(f"{path}: exists already; choose another name, or allow overwriting it") from error
        except OSError as error:
            raise LogError(f"{path}: cannot be written: {error.strerror}; choose another file") from error
        self._sync_thread = _SyncThread(self._file)

    @property
    def closed(self) -> bool:
        """Whether the file is closed."""
        return self._file.closed

    @property
    def disposable(self) -> bool:
        """Whether the new file may be removed after an error: it has no reading, and an old file is still unchanged."""
        return self._unfinished is not None and not self.readings

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
            if self._sync_thread.failure:
                raise self._sync_thread.failure
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
        self._sync_thread.request(self._kept)

    def replace_old_file(self) -> None:
        """Replace the file to be overwritten, unless it has been replaced already. Raises LogError."""
        if self._unfinished is None:
            return
        unfinished, self._unfinished = self._unfinished, None
        self._sync_thread.stop()
        # some systems cannot rename an open file
        self._file.close()
        try:
            target = self.path.resolve()
            if target.exists():
                shutil.copymode(target, unfinished)
            unfinished.replace(target)
            self._file = FileIO(target, "ab")
        except OSError as error:
            self._hidden.close()
            raise LogError(f"{self.path}: cannot be overwritten: {error.strerror}; choose another name") from error
        self._hidden.close()
        self._sync_thread = _SyncThread(self._file)
        self._sync_thread.request(self._kept)

    def close(self) -> None:
        """Sync the file to the disk and close it. Bytes that were not flushed are dropped. Raises LogError."""
        if self._file.closed:
            return
        try:
            self._sync_thread.stop()
            _sync(self._file)
        except OSError as error:
            raise self._failure(error) from error
        finally:
            self._file.close()

    def drop(self) -> None:
        """Close and remove the file. A file to be overwritten is unchanged."""
        if not self._file.closed:
            self._give_up()
        if not self._unfinished and not self._device:
            self.path.unlink(missing_ok=True)

    def _failure(self, error: OSError) -> LogError:
        # a full disk keeps all written bytes; a removed drive keeps only the synced ones
        sync_thread = self._sync_thread
        only_synced = error is sync_thread.failure or error.errno not in _FULL
        kept = sync_thread.kept if only_synced else self._kept
        if not kept:
            return LogError(
                f"{self.path}: cannot be written: {error.strerror}; nothing is recorded, choose another file"
            )
        count = f"{counted_are(kept, 'reading')} kept in it"
        delete = "delete other files or " if error.errno in _FULL else ""
        return LogError(
            f"{self.path}: can no longer be written: {error.strerror}; {count}; {delete}record to another disk"
        )

    def _give_up(self) -> None:
        try:
            self._sync_thread.stop()
            self._file.truncate(self._written)
        except OSError:
            pass  # the reader finds the end of the last whole piece
        finally:
            self._file.close()
            with suppress(OSError):
                self._hidden.close()


class _SyncThread:
    """A thread that syncs a file to its disk as often as the disk allows."""

    def __init__(self, file: FileIO) -> None:
        self.kept = 0  # readings on the disk
        self._file = file
        self._wanted = 0
        self.failure: OSError | None = None
        self._stopping = False
        self._wake = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"sync {file.name!s}", daemon=True)
        self._thread.start()

    def request(self, readings: int) -> None:
        """Request a sync of the file, which now has that number of readings. Does not wait for the sync."""
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
                _sync(self._file)
            except OSError as error:
                self.failure = error
            else:
                self.kept = wanted


def _sync(file: FileIO) -> None:
    try:
        os.fsync(file.fileno())
    except OSError as error:
        if error.errno not in _NO_SYNC:
            raise
