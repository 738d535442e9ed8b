"""A session and a board with a cable that is pulled: no ports, no threads, time is a number."""

import random
from collections.abc import Callable
from dataclasses import dataclass, replace

from sonarhw.board import Board, BoardIdentity
from sonarhw.dialogue import Job
from sonarhw.errors import LinkError, LinkLost
from sonarhw.messages import StartScan
from sonarhw.session import Connection, Session
from tests.sonarhw.joined import Cable, sound
from tests.sonarhw.plain_echoes import PlainEchoes

PLUGGED = {Connection.READY, Connection.MOVING, Connection.STREAMING}


@dataclass
class Pull:
    """Something that happens to the cable, and when it is over."""

    at: float
    back: float
    noticed: bool = True  # the port goes away; else bytes just stop, as where a wire breaks behind the adapter
    power: bool = False  # the board loses its supply with it


class World:
    """A session, a board and what lies between them."""

    def __init__(
        self, identity: BoardIdentity | None = None, bauds: bool = False, seed: int = 7, reconnect: float = 30.0
    ) -> None:
        """`bauds`: the speed of the line can be set; then it carries rubbish where the two sides differ."""
        self.identity = identity or BoardIdentity(serial="FAKE-0007")
        self.seed = seed
        self.board = Board(PlainEchoes(), seed, identity=self.identity)
        self.session = Session("the port", reconnect=reconnect, chance=random.Random(seed))
        self.now = 0.0
        self.pulls: list[Pull] = []
        self.pulled: Pull | None = None
        self.seen: list[float] = []  # how long each loss took to be noticed, s
        self.highest_sound_baud = 10**9
        self.up: Cable = sound
        self.down: Cable = sound
        self._bauds = bauds
        self._open = False
        self._noise = random.Random(seed)
        self.session.connect(0.0)

    # what happens

    def reset(self, serial: str | None = None) -> None:
        """The board starts anew, or another one takes its place."""
        self.identity = replace(self.identity, boot=self.identity.boot + 1, serial=serial or self.identity.serial)
        echoes = self.board._echoes
        self.board = Board(echoes, self.seed, identity=self.identity)

    def pull(self, seconds: float, noticed: bool = True, power: bool = False, after: float = 0.0) -> None:
        """Pull the cable for so long."""
        self.pulls.append(Pull(self.now + after, self.now + after + seconds, noticed, power))

    # going on

    def step(self) -> None:
        """Let time pass until something is to be done, and do it."""
        self._serve_link()
        due = [self.session.next_event(), self.board.next_event(), *(pull.at for pull in self.pulls)]
        due += [self.pulled.back] if self.pulled else []
        self.now = max(self.now, min(time for time in due if time is not None))
        self._serve_cable()
        spoken_at = self.board.line.baud
        data = self.up(self.board.advance(self.now))
        if data and self._open and self.pulled is None:
            self.session.receive(self._at_speed(data, spoken_at), self.now)
        self.session.advance(self.now)

    def until(self, done: Callable[[], bool], within: float = 120.0) -> None:
        """Go on until `done`; fails after `within` s."""
        end = self.now + within
        while not done():
            assert self.now < end, f"not done within {within} s: {self.session.state}"
            self.step()

    def run(self, job: Job) -> Job:
        """Do a job to its end."""
        self.session.start(job, self.now)
        self.until(lambda: job.done)
        return job

    def meet(self) -> "World":
        """Connect."""
        self.until(lambda: self.session.state is Connection.READY or self.session.failed is not None)
        return self

    def scan(self, order: StartScan) -> Job:
        """Begin a scan."""
        return self.session.start(self.session.scanning(order), self.now)

    def _serve_link(self) -> None:
        if self.session.wants_close:
            self._open = False
            self.session.closed()
        if self.session.wants_open(self.now):
            if self.pulled and self.pulled.noticed:
                self.session.open_failed(LinkError("there is no such port"), self.now)
            else:
                self._open = True
                self.session.opened(self.now, bauds=self._bauds)
        data = self.down(self.session.outgoing()) if self._open else b""
        if data and self.pulled is None:
            self.board.receive(self._at_speed(data, self.board.line.baud), self.now)

    def _serve_cable(self) -> None:
        if self.pulled and self.now >= self.pulled.back:
            self.pulled = None
        for pull in [pull for pull in self.pulls if pull.at <= self.now]:
            self.pulls.remove(pull)
            self.pulled = pull
            if pull.power:
                self.reset()
            if pull.noticed and self._open:
                self._open = False
                self.session.broke(LinkLost("the port went away"), self.now)

    def _at_speed(self, data: bytes, board: int) -> bytes:
        """What arrives where the board's side of the line runs at that speed."""
        host = self.session.dialogue.baud
        if not self._bauds or (host == board and host <= self.highest_sound_baud):
            return data
        return self._noise.randbytes(len(data))
