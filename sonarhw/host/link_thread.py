"""The thread that exchanges bytes with a scanner: it opens the link, reads, writes, and opens it again after a loss.

It sends signs of life while the caller is busy. It reads nothing while MOST_WAITING readings wait for the caller.
"""

import threading
import time
from collections.abc import Callable

from sonarhw.errors import InputError, LinkError, LinkLost
from sonarhw.host.exclusive_use import ExclusiveUse
from sonarhw.host.session import Session
from sonarhw.link.serial_link import MOST, Link

MOST_WAITING = 1024  # readings; about 100 s at 10 pings a second
TICK = 0.05  # s; longest delay until `close` takes effect
_STOPPED = 0.3  # s; after a longer time between two reads, the system had stopped this process


class LinkThread:
    """A running thread for one session. `changed` guards the session and is notified when the session changes."""

    def __init__(self, url: str, session: Session, find: Callable[[], str], use: ExclusiveUse) -> None:
        """Start to connect. `find` returns the URL to open each time."""
        self.changed = threading.Condition()
        self._url = url
        self._session = session
        self._find = find
        self._use = use
        # times are s since the epoch on a clock that never runs backwards
        self._epoch = time.time() - time.monotonic()
        self._closing = threading.Event()
        self._defect: BaseException | None = None  # the error that ended the thread
        self._link: Link | None = None
        self._looked = self.now()  # time of the last read
        session.connect(self.now())
        self._thread = threading.Thread(target=self._converse, name=f"converse {url}", daemon=True)
        self._thread.start()

    def now(self) -> float:
        """Return the time on the clock of the session, s since the epoch."""
        return self._epoch + time.monotonic()

    @property
    def closed(self) -> bool:
        """Whether `close` was called."""
        return self._closing.is_set()

    @property
    def alive(self) -> bool:
        """Whether the thread runs."""
        return self._thread.is_alive()

    def wait(self) -> None:
        """Wait until the session changes, at most TICK. The caller holds `changed`. Raises what `check` raises."""
        self.check()
        self.changed.wait(TICK)

    def check(self) -> None:
        """Raise LinkLost after `close`, or the error that ended the thread."""
        if self.closed:
            raise LinkLost(f"{self._url}: the scanner was closed")
        if self._defect:
            raise self._defect

    def wake(self) -> None:
        """End a read that waits for bytes, so that the thread writes at once."""
        if self._link:
            self._link.wake()

    def close(self) -> None:
        """End the thread and close the link."""
        self._closing.set()
        with self.changed:
            self.changed.notify_all()
        self._thread.join()

    def _converse(self) -> None:
        try:
            while not self._closing.is_set():
                self._link = self._exchange(self._link) if self._link else self._open_link()
        except BaseException as defect:  # noqa: BLE001 - raised again in the thread that uses the scanner
            self._defect = defect
        finally:
            link, self._link = self._link, None
            if link:
                link.close()
            with self.changed:
                self.changed.notify_all()

    def _open_link(self) -> Link | None:
        """Return the opened link. None if the session does not need it now, or if it cannot be opened."""
        with self.changed:
            self._session.advance(self.now())
            if not self._session.wants_open(self.now()):
                self._forward_stop()
                self.changed.notify_all()
                self.changed.wait(TICK)
                return None
        try:
            link = Link(self._find())
        except (LinkError, InputError) as error:
            with self.changed:
                self._session.open_failed(error, self.now())
                self.changed.notify_all()
            return None
        with self.changed:
            self._session.opened(self.now(), link.quiet, link.bauds)
        return link

    def _exchange(self, link: Link) -> Link | None:
        """Write and read once. Return the link, or None if it has been closed."""
        behind = self._caller_is_behind()
        try:
            self._write(link)
            if behind:
                return link
            begun = self.now()
            data = link.read()
        except LinkError as error:
            link.close()
            with self.changed:
                self._session.broke(error, self.now())
                self.changed.notify_all()
            return None
        with self.changed:
            # without data, it is known only that nothing had arrived when the read began: the system may have stopped
            # this process since, while bytes arrived
            now = self.now() if data else begun
            if data:
                self._session.receive(data, now)
            elif self.now() - self._looked > _STOPPED:
                # what runs on the same machine, such as an emulated board, may have been stopped too: this time is no
                # silence of the device
                self._session.keep_alive(self.now())
            self._looked = self.now()
            if len(data) < MOST:  # otherwise more bytes are waiting
                self._session.advance(now)
            self._forward_stop()
            self.changed.notify_all()
            if not self._session.wants_close:
                return link
            self._session.closed()
        link.close()
        return None

    def _write(self, link: Link) -> None:
        with self.changed:
            baud, data = self._session.device.baud, self._session.outgoing()
        link.set_baud(baud)
        if data:
            link.write(data)

    def _caller_is_behind(self) -> bool:
        """Return whether the queue of readings is full, so that nothing may be read. If so, send signs of life only."""
        with self.changed:
            job = self._session.job
            if job is None or len(job.readings) < MOST_WAITING or job.stop_wanted:
                return False
            self._session.keep_alive(self.now())
            self._forward_stop()
            self.changed.wait(TICK)
            return True

    def _forward_stop(self) -> None:
        job = self._session.job
        if self._use.stop_wanted and job is not None and not job.stop_wanted:
            self._session.stop(job, self.now())
