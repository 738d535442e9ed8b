"""Find the baud rate and the preset of a device that prints text, by listening to it."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from sonarhw.link.serial_link import READ_PATIENCE, Link
from sonarhw.text.line_decoder import LineDecoder
from sonarhw.text.lines_url import SCHEME
from sonarhw.text.presets import PRESETS, preset_format

BAUDS = (9600, 115200, 57600, 38400, 19200, 230400, 250000, 4800, 76800)
LISTEN = 3.0  # s at the first baud rate: a board that was reset by the opening needs time to start
LISTEN_MORE = 1.0  # s at each other one
_ENOUGH = 8  # readings
_FEWEST = 3  # readings
_STEP = 10  # degrees, proposed for a device that prints no angle


@dataclass(frozen=True)
class LineGuess:
    """What a device prints."""

    port: str
    baud: int | None = None
    preset: str | None = None  # None: no preset matches
    readings: int = 0
    received: int = 0  # bytes, at all baud rates
    example: str = ""  # a line of text that no preset matches

    @property
    def url(self) -> str | None:
        """The URL to scan with; None without a preset."""
        if self.preset is None:
            return None
        step = "" if PRESETS[self.preset].prints_angle else f"&step={_STEP}"
        return f"{SCHEME}:{self.port}?baud={self.baud}&preset={self.preset}{step}"

    @property
    def text(self) -> str:
        """The result in words."""
        if self.url is not None:
            return f"prints {self.preset} at {self.baud} baud: '{self.url}'"
        if self.example:
            return f"prints text that no preset matches, such as {self.example!r}; write a pattern="
        return f"prints no text; {self.received} bytes were received" if self.received else "prints nothing"


def guess_lines(port: str, stopped: Callable[[], bool] = lambda: False) -> LineGuess:
    """Return what a device prints. Listens at one baud rate after the other, until `stopped`.

    Raises LinkError if the port cannot be opened.
    """
    best = LineGuess(port)
    with Link(port) as link:
        for baud in BAUDS if link.bauds else BAUDS[:1]:
            link.set_baud(baud)
            until = time.monotonic() + (LISTEN if baud == BAUDS[0] else LISTEN_MORE)
            found = _listen(link, port, baud, lambda: stopped() or time.monotonic() > until)  # noqa: B023 - used at once
            if found.preset is not None or stopped():
                return found
            best = LineGuess(port, received=best.received + found.received, example=best.example or found.example)
    return best


def _listen(link: Link, port: str, baud: int, over: Callable[[], bool]) -> LineGuess:
    decoders = {name: LineDecoder(preset_format(preset)) for name, preset in PRESETS.items()}
    before = dict.fromkeys(decoders, 0)  # lines before the first reading, such as CSV before its header
    received = 0
    while not over() and max(decoder.readings for decoder in decoders.values()) < _ENOUGH:
        data = link.read()
        received += len(data)
        for name, decoder in decoders.items():
            decoder.feed(data) if data else decoder.idle(READ_PATIENCE)
            if not decoder.readings:
                before[name] = decoder.ignored.total
    scores = {name: decoder.readings + before[name] - decoder.ignored.total for name, decoder in decoders.items()}
    name, best = max(decoders.items(), key=lambda item: scores[item[0]])
    if best.readings < _FEWEST or scores[name] <= 0:
        return LineGuess(port, received=received, example=decoders["csv"].example)
    return LineGuess(port, baud, name, best.readings, received)
