"""The serial ports of this computer and the devices that answer there, listed and probed in a thread.

Ports with a known USB device are probed at once. The others are probed only on request, because opening a port may
reset its device. On request, a port is listened at for the text of a device that prints readings.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

from sonarhw.errors import LinkError
from sonarhw.host.scanner import probe_port
from sonarhw.link import Port, serial_ports
from sonarhw.text_device import LineGuess, guess_lines
from sonarhw_gui.work.worker import Failure, Worker


@dataclass(frozen=True)
class PortRow:
    """One port."""

    device: str
    description: str
    known: bool  # whether its USB device may be a scanner
    answer: str = "not checked"
    answers: bool = False  # whether a scanner answers
    proposed_url: str = ""  # of a device that prints readings


@dataclass(frozen=True)
class _ListPorts:
    find: Callable[[], list[Port]]

    def answer(self) -> tuple[PortRow, ...]:
        return tuple(
            PortRow(port.device, port.known or port.description, port.known is not None) for port in self.find()
        )


@dataclass(frozen=True)
class _ProbePort:
    row: PortRow
    probe: Callable[[str], tuple[bool, str]]

    def answer(self) -> PortRow:
        answers, answer = self.probe(self.row.device)
        return replace(self.row, answer=answer, answers=answers)


@dataclass(frozen=True)
class _ListenAt:
    row: PortRow
    guess: Callable[[str, Callable[[], bool]], LineGuess]
    stopped: Callable[[], bool]

    def answer(self) -> PortRow:
        try:
            found = self.guess(self.row.device, self.stopped)
        except LinkError as error:
            return replace(self.row, answer=str(error).removeprefix(f"{self.row.device}: "))
        return replace(self.row, answer=found.text, proposed_url=found.url or "")


class PortList:
    """The ports, probed one after another."""

    def __init__(
        self,
        find: Callable[[], list[Port]] = serial_ports,
        probe: Callable[[str], tuple[bool, str]] = probe_port,
        guess: Callable[[str, Callable[[], bool]], LineGuess] = guess_lines,
    ) -> None:
        self.rows: tuple[PortRow, ...] = ()
        self.failures: list[str] = []
        self._find, self._probe, self._guess = find, probe, guess
        self._closing = threading.Event()
        self._in_use = ""
        self._to_probe: list[str] = []
        self._worker = Worker("probe ports")

    @property
    def busy(self) -> bool:
        """Whether ports are being listed or probed."""
        return bool(self._to_probe) or self._worker.busy

    def list_ports(self, in_use: str = "") -> None:
        """List the ports, and probe those with a known device, except the port in use."""
        self._in_use, self._to_probe = in_use, []
        self._worker.submit(_ListPorts(self._find))

    def probe_all(self) -> None:
        """Probe every port that was not checked yet."""
        self._queue([row.device for row in self.rows])

    def listen(self, device: str) -> None:
        """Listen at a port for text, also at one that is not listed."""
        if device not in [row.device for row in self.rows]:
            self.rows += (PortRow(device, "", known=False),)
        self.rows = tuple(replace(row, answer="listening …") if row.device == device else row for row in self.rows)
        row = next(row for row in self.rows if row.device == device)
        self._worker.submit(_ListenAt(row, self._guess, self._closing.is_set))

    def take(self) -> bool:
        """Fetch the answers since the last call; return whether anything has changed."""
        taken = self._worker.take()
        for answer in taken:
            match answer:
                case Failure():
                    self.failures.append(answer.message)
                case PortRow():
                    self.rows = tuple(answer if row.device == answer.device else row for row in self.rows)
                case rows:
                    self.rows = tuple(
                        replace(row, answer="in use by this window") if row.device == self._in_use else row
                        for row in rows
                    )
                    self._queue([row.device for row in rows if row.known])
        if taken:
            self._probe_next()
        return bool(taken)

    def close(self) -> None:
        """End the thread, after the port that is being probed."""
        self._to_probe.clear()
        self._closing.set()
        self._worker.close()

    def _queue(self, devices: list[str]) -> None:
        waiting = {row.device for row in self.rows if row.answer == "not checked"}
        self._to_probe = [device for device in devices if device in waiting]
        self.rows = tuple(
            replace(row, answer="checking …") if row.device in self._to_probe else row for row in self.rows
        )
        self._probe_next()

    def _probe_next(self) -> None:
        if self._to_probe and not self._worker.busy:
            device = self._to_probe.pop(0)
            self._worker.submit(_ProbePort(next(row for row in self.rows if row.device == device), self._probe))
