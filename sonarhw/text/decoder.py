"""Decodes the bytes of a device or of a file into readings: encodings, lines, what captures add to them, and counts."""

import codecs
import re
from collections import Counter, deque
from dataclasses import replace
from functools import reduce
from operator import xor
from statistics import median

from sonarhw.text.layouts import BinaryFrame, Layout
from sonarhw.text.numbers import HEADER, PART, LineFormat, Printed, Units
from sonarhw.text.patterns import MatchingProcess
from sonarhw.text.words import plain_text

MOST_LINE = 65_536  # bytes; more without the end of a line are noise
MOST_PAUSE = 1.25  # s within a line: longer than the 1 s that pulseIn() waits for an echo, shorter than a bootloader
_SHOWN = 60  # characters of an example
_CUT = "0123456789.-+"  # characters that may be missing at the start of a number
_NUMBERS_ONLY = re.compile(r"[\d.,;:*+\-\s]*", re.ASCII)


# kinds of lines that are no readings
HALF_LINES = "half lines"  # the first line after opening, and lines with missing characters
OTHER_TEXT = "lines of other text"  # banners, messages
SLOW = "lines that take more than 1 s to match"
NOISE = "noise"  # lines with bytes that are not text


class Pauses:
    """The pauses before the lines of readings that have several lines: a device measures between two readings."""

    def __init__(self) -> None:
        self._within = deque[float](maxlen=_MOST_PAUSES)  # s
        self._between = deque[float](maxlen=_MOST_PAUSES)
        self._is_open = False

    def add(self, pause: float, is_part: bool, is_end: bool) -> None:
        """Add the pause before a line (s), which is a part or the end of a reading, or neither."""
        if is_part or is_end:
            (self._within if self._is_open else self._between).append(pause)
        self._is_open = is_part

    @property
    def agree(self) -> bool | None:
        """Whether the device pauses between readings, and not within; None if the pauses show neither."""
        if min(len(self._within), len(self._between)) < _FEWEST_PAUSES:
            return None
        within, between = median(self._within), median(self._between)
        if max(within, between) < _LEAST_PAUSE or min(within, between) > _AT_ONCE * max(within, between):
            return None
        return between > within


_MOST_PAUSES, _FEWEST_PAUSES = 400, 4
_LEAST_PAUSE = 0.01  # s
_AT_ONCE = 0.2  # of the pause between readings; a sketch may also measure between the lines of a reading


class LineDecoder:
    """Splits bytes into lines, and decodes the readings in them. It has no port and no clock."""

    def __init__(self, line_format: LineFormat, begins_whole: bool = False) -> None:
        """`begins_whole`: the first line is complete, as in a file."""
        self.ignored = Counter({HALF_LINES: 0, OTHER_TEXT: 0, NOISE: 0})  # lines
        self.readings = 0
        self.example = ""  # newest text that was not a reading
        self.encoding = "utf-8"
        self._format = line_format
        self._rest = b""
        self._paused = 0.0  # s since the newest byte
        self._begins_whole = begins_whole
        self._cut = not begins_whole  # whether the start of the line may be missing
        self._text = False  # whether another text was printed since the newest reading
        self.has_header = False  # whether a line has named the columns
        self.pauses = Pauses()
        self._pause = 0.0  # s before the next line
        self._utf16: codecs.IncrementalDecoder | None = None
        self._begun = False

    def feed(self, data: bytes, pause: float = 0.0) -> list[Printed]:
        """Return the readings that these bytes complete. `pause`: s without bytes before them."""
        self._paused = 0.0
        if not self._rest:
            self._pause = max(self._pause, pause)
        *whole, self._rest = self._format.ends.split(self._rest + self._plain(data))
        decoded = [reading for raw in whole for reading in self._decode(raw)]
        if len(self._rest) > MOST_LINE:
            text = self._text_of(self._rest)
            self._rest, self._cut = b"", True
            if text is None:
                self.ignored[NOISE] += 1
            else:
                self._note_text(text, cut=False)
        return decoded

    def end(self) -> list[Printed]:
        """Return the reading in the last line of a file, which may have no end."""
        rest, self._rest = self._rest, b""
        return list(self._decode(rest))

    def idle(self, seconds: float) -> None:
        """Handle a time without bytes. After a long one, the line in progress is incomplete: its end was lost."""
        self._paused += seconds
        if self._paused > MOST_PAUSE and self._rest:
            self._rest = b""
            self.ignored[HALF_LINES] += 1

    def lost(self) -> None:
        """Handle a loss of bytes."""
        self._rest, self._cut, self._utf16, self._begun = b"", not self._begins_whole, None, False

    def close(self) -> None:
        """End what the format has started."""
        self._format.close()

    def _plain(self, data: bytes) -> bytes:
        """Return the bytes in UTF-8, if they begin with a byte order mark of UTF-16; else as they are."""
        if not self._begun and data:
            if len(self._rest + data) < 4 and (self._rest + data)[:1] in (b"\xff", b"\xfe"):
                return data
            first, self._rest, self._begun = self._rest + data, b"", True
            encoding = utf16_of(first)
            if encoding:
                self.encoding = encoding
                self._utf16 = codecs.getincrementaldecoder(encoding)("replace")
            data = first
        if self._utf16 is None:
            return data
        return self._utf16.decode(data).replace("\ufeff", "").encode()

    def _decode(self, raw: bytes) -> tuple[Printed, ...]:
        cut, self._cut = self._cut, False
        line = self._text_of(raw)
        if line is None:
            self.ignored[NOISE] += 1
            return ()
        if not line:
            return ()
        try:
            if cut and self._may_be_cut(line):
                self._note_text(line, cut)
                return ()
            read = self._format.read(line)
        except TimeoutError:
            self.ignored[SLOW] += 1
            return ()
        self.pauses.add(self._pause, read == PART, isinstance(read, tuple))
        self._pause = 0.0
        self.has_header = self.has_header or read == HEADER
        if isinstance(read, str):
            self._text = self._text or (read == HEADER and self.readings > 0)
            return ()
        if read is None:
            self._note_text(line, cut)
            return ()
        restarted, self._text = self._text, False
        self.readings += len(read)
        return (replace(read[0], restarted=restarted), *read[1:])

    def _may_be_cut(self, line: str) -> bool:
        """Return whether the line is still a reading with one more character before it: 90,23 may be cut to 0,23."""
        return self._format.fits(line) and any(self._format.fits(f"{character}{line}") for character in _CUT)

    def _note_text(self, line: str, cut: bool) -> None:
        self.example = line[:_SHOWN]
        if cut or _NUMBERS_ONLY.fullmatch(line):
            self.ignored[HALF_LINES] += 1
        else:
            self._text = True
            self.ignored[OTHER_TEXT] += 1

    def _text_of(self, raw: bytes) -> str | None:
        line, encoding = text_of(raw)
        if encoding != "utf-8":
            self.encoding = encoding
        return None if line is None else unwrapped(line)


class BinaryDecoder:
    """Decodes the binary messages of a sensor that prints no text, as `LineDecoder` does lines."""

    encoding = "binary"
    has_header = False

    def __init__(self, frame: BinaryFrame, units: Units) -> None:
        self.ignored = Counter({NOISE: 0})  # bytes
        self.readings = 0
        self.example = ""
        self._frame, self._units = frame, units
        self._rest = b""
        self.pauses = Pauses()

    def feed(self, data: bytes, pause: float = 0.0) -> list[Printed]:
        """Return the readings that these bytes complete. A message with a wrong checksum is skipped."""
        self._rest += data
        decoded, size = [], self._frame.size
        position = 0
        while position + size <= len(self._rest):
            message = self._rest[position : position + size]
            number = self._frame.number(message)
            printed = None if number is None else self._units.printed(None, [str(number)], None)
            if printed is None:
                self.ignored[NOISE] += 1
                position += 1
                continue
            decoded.append(printed)
            position += size
        self._rest = self._rest[position:]
        self.readings += len(decoded)
        return decoded

    def end(self) -> list[Printed]:
        """Return nothing: half a message is no reading."""
        return []

    def idle(self, seconds: float) -> None:
        """Do nothing: a message is found by its checksum."""

    def lost(self) -> None:
        """Handle a loss of bytes."""
        self._rest = b""

    def close(self) -> None:
        """Do nothing."""


Decoder = LineDecoder | BinaryDecoder


def make_decoder(layout: Layout, begins_whole: bool = False) -> Decoder:
    """Return the decoder of a layout. Raises InputError for an invalid pattern."""
    if layout.frame is not None:
        return BinaryDecoder(layout.frame, layout.units)
    matching = MatchingProcess(layout.pattern) if layout.pattern and layout.is_regex else None
    return LineDecoder(layout.make_format(matching), begins_whole)


_DATE = r"(?:\d{4}[-/.]\d\d[-/.]\d\d|\d\d?[-/.]\d\d?[-/.]\d{4}|[^\W\d_]{3,4}\.? {1,2}\d\d?)"
_TIME = r"\d\d?:\d\d:\d\d(?:[.,]\d{1,9})?(?: ?[AP]M)?(?:Z|[+-]\d\d:?\d\d)?"
_STAMP = re.compile(  # of serial monitors and loggers; before a tab it may be a column of a table
    rf"[\[(]?(?:{_DATE}[ T,_]+)?{_TIME}[\])]?(?:\s*(?:->|[>:|-]) *|\t(?!.*\t)| +)(?:\[RX\][ :-]*)?(?=\S)"
)
_SENTENCE = re.compile(r"[$!]([^*$!]+)\*([0-9A-Fa-f]{2})")  # of NMEA 0183, with its checksum
_CAPTURE = re.compile(
    r"=~=~=~.*|\*{3,}.*|-{3,}.*|Welcome to minicom.*|OPTIONS:.*|Press CTRL-A.*|Terminal log file.*|[-=_*#~]+"
)


def unwrapped(line: str) -> str:
    """Return a line without what is around it: a time, name and checksum of a sentence; no line of a PuTTY log."""
    plain = _STAMP.sub("", line, count=1) if _STAMP.match(line) else line
    if (sentence := _SENTENCE.fullmatch(plain)) and reduce(xor, sentence[1].encode()) == int(sentence[2], 16):
        return sentence[1].partition(",")[2]
    return "" if _CAPTURE.fullmatch(plain) else plain


def utf16_of(start: bytes) -> str | None:
    """Return which UTF-16 the first bytes are, by a byte order mark or the zeros of ASCII; None for other text."""
    if marked := _BYTE_ORDERS.get(start[:2]):
        text = plain_text(start[2 : 2 * _LOOKED_AT].decode(marked, "replace"))
        return marked if text and all(char.isprintable() or char in "\t\r\n" for char in text) else None
    if len(start) < 2 * _LOOKED_AT:
        return None
    even, odd = start[: 2 * _LOOKED_AT : 2], start[1 : 2 * _LOOKED_AT : 2]
    if not any(odd) and _ASCII.fullmatch(even):
        return "utf-16-le"
    return "utf-16-be" if not any(even) and _ASCII.fullmatch(odd) else None


_BYTE_ORDERS = {b"\xff\xfe": "utf-16-le", b"\xfe\xff": "utf-16-be"}
_LOOKED_AT = 16  # characters; if they are of ASCII, UTF-16 needs no mark
_ASCII = re.compile(rb"[\t\r\n -~]+")


_ESCAPES = re.compile(rb"\x1b\[[0-9;?]*[A-Za-z]")  # colours of terminals
_SPACES = " \r\n\v\f"
_CONTROL = re.compile(rb"[\0-\x08\x0e-\x1f]")
_MOST_FOREIGN = 0.25  # share of bytes above 127 in a text in cp1252
_FEWEST_FOREIGN = 5  # bytes of a line in cp1252; fewer are noise
_BESIDE_NUMBERS = "\u00a0°".encode("cp1252")  # common also in short lines


def text_of(raw: bytes) -> tuple[str | None, str]:
    """Return a line as text without spaces at its ends, and its encoding; None if it is not text.

    A tab at the end stays: an empty cell follows it.
    """
    raw = _ESCAPES.sub(b"", raw)
    encoding = encoding_of(raw, line=True)
    if encoding is None:
        return None, "utf-8"
    line = plain_text(raw.decode(encoding, "replace")).lstrip().rstrip(_SPACES)
    plain = line.replace("\t", " ").replace("\r", " ").replace("\n", " ")
    return (line, encoding) if plain.isprintable() and "\ufffd" not in line else (None, "utf-8")


def encoding_of(data: bytes, line: bool = False) -> str | None:
    """Return the encoding of a `line`, or of a text by its first bytes: UTF-8, UTF-16 with its mark, or cp1252.

    It is cp1252 if few bytes are above 127. None if it is no text. The last character of first bytes may be cut.
    """
    if not line and utf16_of(data):
        return "utf-16"
    try:
        codecs.getincrementaldecoder("utf-8")().decode(data, final=line)
    except UnicodeDecodeError:
        foreign = sum(byte > 127 and byte not in _BESIDE_NUMBERS for byte in data)
        is_text = foreign <= max(1, _MOST_FOREIGN * len(data)) and not _CONTROL.search(data)
        return "cp1252" if is_text and (not foreign or len(data) >= _FEWEST_FOREIGN) else None
    return "utf-8"
