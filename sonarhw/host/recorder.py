"""Recording of the frames and readings of a scanner. `sonarhw.log` has the recorder that writes a file."""

from collections.abc import Callable
from typing import Protocol

from sonarhw.readings import Reading
from sonarhw.wire.frames import frame_type
from sonarhw.wire.messages import Capabilities, Hello, Info


class Recorder(Protocol):
    """Receives frames and readings in order, in the thread that drives the scanner."""

    def frame(self, received: bool, time: float, wire: bytes) -> None:
        """Record the bytes of one undamaged frame as they were on the line, with its delimiter.

        `received` is True for a frame from the device, False for one from the host. `time` is the host's time in
        s since the epoch, from a monotonic clock.
        """

    def reading(self, reading: Reading) -> None:
        """Record one decoded reading, after its frames."""


class JobRecording:
    """Passes frames and readings to a recorder while a job runs. A new recorder receives the greeting first.

    A recorder that raises an error is dropped, so that the device can still be stopped. `failure` is then the error.
    """

    def __init__(self, wanted: Callable[[], bool]) -> None:
        """`wanted` returns True while a job runs."""
        self.failure: BaseException | None = None
        self._wanted = wanted
        self._recorder: Recorder | None = None
        self._greeting: list[tuple[bool, float, bytes]] = []  # the newest Hello, and the Info and Capabilities received

    def use(self, recorder: Recorder | None) -> None:
        """Record with `recorder` from now on. None ends the recording. Raises what `recorder` raises."""
        self._recorder = recorder
        if recorder:
            for received, time, wire in self._greeting:
                recorder.frame(received, time, wire)

    def frame(self, received: bool, time: float, wire: bytes) -> None:
        """Record a frame. This is the `Tap` of a driver."""
        kind = frame_type(wire[:-1])
        if kind == Hello.TYPE and not received:
            self._greeting = [(received, time, wire)]
        elif kind == Info.TYPE and received:
            self._greeting = [*self._greeting[:1], (received, time, wire)]
        elif kind == Capabilities.TYPE and received:
            self._greeting = [*self._greeting[:2], (received, time, wire)]
        self._record(lambda recorder: recorder.frame(received, time, wire))

    def reading(self, reading: Reading) -> None:
        """Record a reading, after its frames."""
        self._record(lambda recorder: recorder.reading(reading))

    def take_failure(self) -> BaseException | None:
        """Return the error that the recorder raised, and clear it."""
        failure, self.failure = self.failure, None
        return failure

    def _record(self, act: Callable[[Recorder], None]) -> None:
        if self._recorder is None or not self._wanted():
            return
        try:
            act(self._recorder)
        except BaseException as error:  # noqa: BLE001 - raised again in the thread that waits for the job
            self._recorder, self.failure = None, error
