"""Decodes the bytes of a device that prints text, without ports or clock. Counts what is not a reading."""

import re
from dataclasses import dataclass, replace

from sonarhw.text.line_format import Header, LineFormat, Printed

MOST_LINE = 400  # bytes; more without the end of a line are noise
MOST_PAUSE = 1.25  # s within a line: longer than the 1 s that pulseIn() waits for an echo, shorter than a bootloader
_SHOWN = 60  # characters of an example
_CUT = "0123456789.-+"  # characters that may be missing at the start of a number
_NUMBERS_ONLY = re.compile(r"[\d.,;:*+\-\s]*", re.ASCII)


@dataclass(frozen=True)
class Ignored:
    """Counters of what is not a reading."""

    half_lines: int = 0  # the first line after opening, and lines with missing characters
    other_lines: int = 0  # of text: banners, messages
    noise: int = 0  # lines with bytes that are not text

    @property
    def total(self) -> int:
        """Number of all ignored lines."""
        return self.half_lines + self.other_lines + self.noise


@dataclass(frozen=True)
class DecodedLine:
    """A reading."""

    printed: Printed
    restarted: bool  # whether a banner or another text was printed since the reading before


class LineDecoder:
    """Splits bytes into lines, and decodes the readings in them."""

    def __init__(self, line_format: LineFormat) -> None:
        self.ignored = Ignored()
        self.readings = 0
        self.example = ""  # newest text that was not a reading
        self._format = line_format
        self._rest = b""
        self._paused = 0.0  # s since the newest byte
        self._cut = True  # whether the start of the line may be missing
        self._text = False  # whether another text was printed since the newest reading

    def feed(self, data: bytes) -> list[DecodedLine]:
        """Return the readings that these bytes complete."""
        self._paused = 0.0
        *whole, self._rest = self._format.ends.split(self._rest + data)
        decoded = [line for raw in whole if (line := self._decode(raw))]
        if len(self._rest) > MOST_LINE:
            text = _text_of(self._rest)
            self._rest, self._cut = b"", True
            if text is None:
                self._ignore(noise=1)
            else:
                self._note_text(text, cut=False)
        return decoded

    def idle(self, seconds: float) -> None:
        """Handle a time without bytes. After a long one, the line in progress is incomplete: its end was lost."""
        self._paused += seconds
        if self._paused > MOST_PAUSE and self._rest:
            self._rest = b""
            self._ignore(half_lines=1)

    def lost(self) -> None:
        """Handle a loss of bytes."""
        self._rest, self._cut = b"", True

    def _decode(self, raw: bytes) -> DecodedLine | None:
        cut, self._cut = self._cut, False
        line = _text_of(raw)
        if line is None:
            self._ignore(noise=1)
            return None
        if not line:
            return None
        read = self._format.read(line)
        if isinstance(read, Header):
            self._text = self.readings > 0
            return None
        if read is None or (cut and self._may_be_cut(line)):
            self._note_text(line, cut)
            return None
        restarted, self._text = self._text, False
        self.readings += 1
        return DecodedLine(read, restarted)

    def _may_be_cut(self, line: str) -> bool:
        """Return whether the line is still a reading with one more character before it: 90,23 may be cut to 0,23."""
        return any(isinstance(self._format.read(f"{character}{line}"), Printed) for character in _CUT)

    def _note_text(self, line: str, cut: bool) -> None:
        self.example = line[:_SHOWN]
        if cut or _NUMBERS_ONLY.fullmatch(line):
            self._ignore(half_lines=1)
        else:
            self._text = True
            self._ignore(other_lines=1)

    def _ignore(self, half_lines: int = 0, other_lines: int = 0, noise: int = 0) -> None:
        now = self.ignored
        self.ignored = replace(
            now,
            half_lines=now.half_lines + half_lines,
            other_lines=now.other_lines + other_lines,
            noise=now.noise + noise,
        )


def _text_of(raw: bytes) -> str | None:
    """Return a line as text without spaces at its ends; None if it is not text."""
    try:
        line = raw.decode("utf-8").strip()
    except UnicodeDecodeError:
        return None
    return line if line.replace("\t", " ").replace("\r", " ").replace("\n", " ").isprintable() else None
