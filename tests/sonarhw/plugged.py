"""A session and a faulty board joined without ports or threads: time is a number, and the cable may be pulled."""

import random
from collections.abc import Callable, Sequence

from sonarhw.dialogue import Job
from sonarhw.errors import LinkError, LinkLost
from sonarhw.faulty import FaultyDevice
from sonarhw.messages import Configure, StartScan
from sonarhw.readings import Reading
from sonarhw.session import Connection, Session

THERE = (Connection.READY, Connection.MOVING, Connection.STREAMING)


class Plugged:
    """A session with the board at the other end of the cable."""

    def __init__(self, device: FaultyDevice, vanishes: bool = True, seed: int = 0) -> None:
        """`vanishes`: the port goes with the cable; otherwise it stays, and nothing comes any more."""
        self.device = device
        self.session = Session("the fake", chance=random.Random(seed))
        self.now = 0.0
        self.noticed: list[float] = []  # how long after a cable was pulled the session knew, s
        self.unnoticed: list[float] = []  # how long a cable was out without anybody missing it, s
        self._out_since: float | None = None
        self._vanishes = vanishes
        self._open = False
        self._plug: int | None = 0
        self.session.connect(0.0)

    def step(self) -> None:
        """Let time pass until something is to be done, and do it."""
        self._watch_the_cable()
        self._tend_the_port()
        data = self.session.outgoing()
        if data and self._open:
            self.device.receive(data, self.now)
        due = [time for time in (self.session.next_event(), self.device.next_event()) if time is not None]
        self.now = max(self.now, min(due))
        arrived = self.device.advance(self.now)
        if arrived and self._open:
            self.session.receive(arrived, self.now)
        self.session.advance(self.now)
        if self._out_since is not None and self.session.state not in THERE:
            self.noticed.append(self.now - self._out_since)
            self._out_since = None

    def until(self, done: Callable[[], bool], within: float) -> None:
        """Go on until `done`; fails after `within` s."""
        end = self.now + within
        while not done():
            assert self.now < end, f"not done within {within} s, {self.session.state}"
            self.step()

    def meet(self) -> bool:
        """Whether the first greeting led to a conversation."""
        self.until(lambda: self.session.failed is not None or self.session.state is Connection.READY, within=30)
        return self.session.failed is None

    def scan(self, order: StartScan, trace: bool = False, within: float = 600.0) -> Sequence[Reading]:
        """All readings of a scan in the order they came. Raises what ended it."""
        if trace:
            self.do(self.session.configuring(Configure(62_500, 2_380, 1, 343_200)), within)
        return self.do(self.session.scanning(order), within).readings

    def do(self, job: Job, within: float = 60.0) -> Job:
        """A job to its end. Raises what ended it."""
        self.session.start(job, self.now)
        self.until(lambda: job.done or self.session.failed is not None, within)
        if error := job.error or self.session.failed:
            raise error
        return job

    def _watch_the_cable(self) -> None:
        before, self._plug = self._plug, self.device.plug
        if self._plug == before:
            return
        if self._plug is not None:
            if self._out_since is not None:
                self.unnoticed.append(self.now - self._out_since)
            self._out_since = None
            return
        self._out_since = self.now if self.session.state in THERE else None
        if self._vanishes and self._open:
            self._open = False
            self.session.broke(LinkLost("the fake: the cable is out"), self.now)

    def _tend_the_port(self) -> None:
        if self.session.wants_close:
            self._open = False
            self.session.closed()
        if not self.session.wants_open(self.now):
            return
        if self._vanishes and self.device.plug is None:
            self.session.open_failed(LinkError("the fake: there is no such port"), self.now)
        else:
            self._open = True
            self.session.opened(self.now)
