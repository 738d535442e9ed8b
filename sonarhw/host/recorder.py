"""What keeps a conversation with a scanner: the scanner hands every frame and every reading to one of these.

`sonarhw.log` has the one that writes a file; the scanner knows only this page.
"""

from typing import Protocol

from sonarhw.readings import Reading


class Recorder(Protocol):
    """Takes what passes over the link, in order, from the thread that drives the scanner."""

    def frame(self, received: bool, time: float, wire: bytes) -> None:
        """Keep one undamaged frame's bytes with its delimiter.

        `received` tells which way it went: True from the device, False from the host. `time` is the host's clock in
        s since the epoch, taken from a clock that does not run backwards.
        """

    def reading(self, reading: Reading) -> None:
        """Keep one decoded reading; its frames have been handed over before."""
