"""The serial ports of this computer and the devices that answer there, looked up in a thread.

Ports with a known USB device are asked at once. The others are asked only on request, because opening a port may reset
its device.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from sonarhw.host.port_probe import probe_port
from sonarhw.link.ports import Port, serial_ports
from sonarhw_gui.work.worker import Failure, Worker


@dataclass(frozen=True)
class PortRow:
    """One port."""

    device: str
    description: str
    known: bool  # whether its USB device may be a scanner
    answer: str = "not asked"
    answers: bool = False  # whether a scanner answers


@dataclass(frozen=True)
class _Look:
    find: Callable[[], list[Port]]

    def answer(self) -> tuple[PortRow, ...]:
        return tuple(
            PortRow(port.device, port.known or port.description, port.known is not None) for port in self.find()
        )


@dataclass(frozen=True)
class _Ask:
    row: PortRow
    ask: Callable[[str], tuple[bool, str]]

    def answer(self) -> PortRow:
        answers, answer = self.ask(self.row.device)
        return replace(self.row, answer=answer, answers=answers)


class PortList:
    """The ports, asked one after another."""

    def __init__(
        self,
        find: Callable[[], list[Port]] = serial_ports,
        ask: Callable[[str], tuple[bool, str]] = probe_port,
    ) -> None:
        self.rows: tuple[PortRow, ...] = ()
        self.failures: list[str] = []
        self._find, self._ask = find, ask
        self._in_use = ""
        self._to_ask: list[str] = []
        self._worker = Worker("ask ports")

    @property
    def busy(self) -> bool:
        """Whether ports are being looked up or asked."""
        return bool(self._to_ask) or self._worker.busy

    def look(self, in_use: str = "") -> None:
        """Look up the ports, and ask those with a known device, except the port in use."""
        self._in_use, self._to_ask = in_use, []
        self._worker.submit(_Look(self._find))

    def ask_all(self) -> None:
        """Ask every port that was not asked yet."""
        self._queue([row.device for row in self.rows])

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
            self._ask_next()
        return bool(taken)

    def close(self) -> None:
        """End the thread, after the port that is being asked."""
        self._to_ask.clear()
        self._worker.close()

    def _queue(self, devices: list[str]) -> None:
        waiting = {row.device for row in self.rows if row.answer == "not asked"}
        self._to_ask = [device for device in devices if device in waiting]
        self.rows = tuple(replace(row, answer="asking …") if row.device in self._to_ask else row for row in self.rows)
        self._ask_next()

    def _ask_next(self) -> None:
        if self._to_ask and not self._worker.busy:
            device = self._to_ask.pop(0)
            self._worker.submit(_Ask(next(row for row in self.rows if row.device == device), self._ask))
