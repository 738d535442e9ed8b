"""The file formats that `sonarhw import` reads, and their recognition by content.

To add a format, write a function `read_x(file, meaning)` and add an entry to FORMATS. The command and its help follow.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from sonarhw.errors import InputError, did_you_mean
from sonarhw.files import MOST_FOREIGN, NO_DATA, no_data, open_input
from sonarhw.text.words import ColumnKind, meaning_of, words_of

if TYPE_CHECKING:
    from sonarhw.readings import Reading
    from sonarhw_compare.foreign_rows import Meaning


@dataclass(frozen=True)
class ImportFormat:
    """One file format."""

    name: str  # of the option --format
    suffixes: tuple[str, ...]  # of the file name, in lower case; they decide only if the content does not
    title: str
    has_traces: bool  # of received signals, in place of ranges
    has_step: bool  # without angles of its own, at least in part
    reader: str = ""  # module and name of a function of these packages; empty for text
    units: str = ""  # by its definition; empty: as the content states

    def title_of(self, file: Path) -> str:
        """Return what a file in this format is."""
        if self is not ROS:
            return self.title
        start = start_of_file(file, 64)
        return f"a ROS {1 if start.startswith(b'#ROSBAG') or b'ros1' in start else 2} bag"

    def read(self, file: Path, meaning: "Meaning") -> "list[Reading]":
        """Return the readings of a file in this format. Raises InputError."""
        module, _, name = self.reader.partition(":")
        loaded = import_module(f"sonarhw_compare.{module}")  # loads NumPy, which the help does not need
        readings: list[Reading] = getattr(loaded, name)(file, meaning)
        return readings


TEXT = ImportFormat("text", (), "text of a device: lines, CSV, JSON, captures of a terminal", False, True)
CARMEN = ImportFormat(
    "carmen",
    (".clf",),
    "CARMEN logs with SONAR lines",
    False,
    False,
    "foreign_logs:read_carmen_log",
    "metres and radians",
)
PLAYER = ImportFormat(
    "player", (), "logs of Player with sonar", False, True, "foreign_logs:read_player_log", "metres and radians"
)
BEESOFT = ImportFormat(
    "beesoft", (), "logs of BeeSoft with sonar", False, True, "foreign_logs:read_beesoft_log", "centimetres"
)
ARIA = ImportFormat(
    "aria",
    (".2d",),
    "logs of ARIA with range scans",
    False,
    False,
    "foreign_logs:read_aria_log",
    "millimetres and degrees",
)
PING360 = ImportFormat(
    "ping360",
    (".bin",),
    "Ping Viewer logs of a Ping360 or Ping1D",
    True,
    False,
    "foreign_logs:read_ping360_log",
    "gradians, and samples in units of 25 ns",
)
ROS = ImportFormat(
    "ros",
    (".bag", ".db3"),
    "ROS bags of both versions, as a file or a folder",
    False,
    True,
    "foreign_bags:read_ros_bag",
    "metres and radians",
)
JSON_MCAP = ImportFormat("json-mcap", (), "MCAP files with JSON messages", False, True)
RAW = ImportFormat(
    "raw",
    (".wav", ".npy", ".npz"),
    "raw traces, also as text with a sampling rate, or as CSV of an oscilloscope",
    True,
    True,
    "foreign_traces:read_raw_traces",
)
ARRAYS = ImportFormat("arrays", (".mat",), "columns of angles and ranges in NPZ, NPY and MAT files", False, True)
LOG = ImportFormat("log", (), "logs (.mcap), to correct them", False, False, "foreign_logs:read_own_log")
FORMATS = (TEXT, CARMEN, PLAYER, BEESOFT, ARIA, PING360, ROS, JSON_MCAP, RAW, ARRAYS, LOG)
_MAGIC = (
    (b"#ROSBAG", ROS),
    (b"SQLite format 3\0", ROS),
    (b"\x93NUMPY", ARRAYS),
    (b"MATLAB ", ARRAYS),
    (b"PK\x03\x04", ARRAYS),
    (b"\x89HDF\r\n\x1a\n", ARRAYS),
)
_START = 65_536  # bytes that decide
_HEAD = 2_000  # characters at the start of a trace of an oscilloscope
_KEYS_OF_SCOPES = re.compile(
    r"\W*(record length|sample interval|time interval|x-axis)\W|#clock=|.*\btinc\s*=", re.IGNORECASE
)
_TIMES = ("time", "zeit", "temps", "tiempo", "tempo", "second", "seconds", "s", "x", "in")
_SIGNALS = frozenset(
    [
        "ch",
        "channel",
        "kanal",
        "voie",
        "canal",
        "canale",
        "ampl",
        "amplitude",
        "volt",
        "volts",
        "voltage",
        "v",
        "mv",
        "val",
        "spannung",
    ]
)
_BEESOFT = re.compile(r"@SENS +\d+-\d+-\d+ |#SONAR +\d+:")
MCAP = b"\x89MCAP0\r\n"


def import_format(file: Path, rate: float | None, name: str = "") -> ImportFormat:
    """Return the format of a file: that of a name, else by its content, else by its suffix, else text.

    With a sampling `rate`, text and arrays are samples. Raises InputError for a folder that is no bag, and for a file
    that cannot be data, such as a spreadsheet.
    """
    if name:
        named = next((kind for kind in FORMATS if kind.name == name), None)
        if named is None:
            names = [kind.name for kind in FORMATS]
            raise InputError(f"format {name!r}: expected {', '.join(names)}{did_you_mean(name, names)}")
        return named
    if file.is_dir():
        if any(part.suffix in (".mcap", ".db3") for part in file.iterdir()) or (file / "metadata.yaml").exists():
            return ROS
        raise InputError(f"{file}: is a folder without metadata.yaml; give a file, or the folder of a bag of ROS 2")
    start = start_of_file(file)
    if other := no_data(file.name, start):
        is_a, advice = NO_DATA[other]
        raise InputError(f"{file}: is {is_a}; {advice}")
    kind = _of_content(file, start)
    if kind is None:
        kind = next((kind for kind in FORMATS if file.suffix.lower() in kind.suffixes), None)
    if kind in (None, ARRAYS) and rate is not None:
        return RAW
    return TEXT if kind is None else kind


def start_of_file(file: Path, size: int = _START) -> bytes:
    """Return the first bytes of a file; empty if it cannot be read, which its reader reports."""
    try:
        with open_input(file, MOST_FOREIGN) as data:
            return data.read(size)
    except (OSError, ValueError):
        return b""


def _of_content(file: Path, start: bytes) -> ImportFormat | None:
    if start.startswith(MCAP):
        return _of_mcap(file, start)
    if file.suffix.lower() == ".mcap":
        return ROS
    for magic, kind in _MAGIC:
        if start.startswith(magic):
            return kind
    if start[:4] == b"RIFF" and start[8:12] == b"WAVE":
        return RAW
    if b"ping" in start[:80].replace(b"\0", b"").lower() and start[:2] == b"\0\0":
        return PING360
    if file.suffix.lower() == PING360.suffixes[0]:
        from sonarhw.text.proposals import propose

        return TEXT if propose(start, begins_whole=True).layout is not None else None
    return _of_text(start)


def _of_text(start: bytes) -> ImportFormat | None:
    """Return the format of text that is no text of a device; None for all other."""
    text = start.decode("utf-8", "replace")
    if is_oscilloscope(text):
        return RAW
    lines = text.splitlines()
    if lines[:1] == ["LaserOdometryLog"]:
        return ARIA
    if any(_BEESOFT.match(line) for line in lines):
        return BEESOFT
    if any(line.split()[:1] == ["SONAR"] for line in lines):
        return CARMEN
    return PLAYER if any(map(_is_player_line, lines)) else None


def is_oscilloscope(text: str) -> bool:
    """Return whether a text begins as the CSV of an oscilloscope: keys, or a column of times and one of a signal."""
    for line in text[:_HEAD].splitlines():
        first, *others = [words_of(cell) for cell in re.split(r"[,;\t]", line)]
        names_signal = any(word in _SIGNALS for cell in others for word in cell)
        names_angle = any(meaning_of(cell[0]).quantity is ColumnKind.ANGLE for cell in others if cell)
        is_header = first and first[0] in _TIMES and names_signal and not names_angle
        if is_header or _KEYS_OF_SCOPES.match(line):
            return True
    return False


def _is_player_line(line: str) -> bool:
    words = line.split()
    return line.startswith("## Player version") or (len(words) > 7 and words[3] == "sonar")


def _of_mcap(file: Path, start: bytes) -> ImportFormat:
    """Return the format of an MCAP file by the encoding of its messages."""
    if b"sonarhw" in start[:200] or len(start) < 20:
        return LOG
    if b"ros2" in start[8:64] or b"ros1" in start[8:64] or b"cdr" in start:
        return ROS
    return JSON_MCAP


# Options and what they need of a format.


_NEEDS = {
    **dict.fromkeys(["preset", "pattern", "decimal_comma"], "text"),
    **dict.fromkeys(["unit", "heading", "range", "time", "x", "y", "yaw"], "columns"),
    **dict.fromkeys(["angle", "scale", "mean_of"], "columns log"),
    **dict.fromkeys(["threshold", "blanking", "speed_of_sound"], "traces"),
    **dict.fromkeys(["axis", "full_scale"], "raw"),
    **dict.fromkeys(["rate", "variable"], "raw arrays"),
    "no_echo": "ranges",
    "step": "steps",
    "topic": "bag",
}
_FACTS = {
    "text": "text",
    "columns": "text",
    "arrays": "columns in arrays",
    "log": "logs",
    "traces": "formats with traces",
    "ranges": "formats with ranges",
    "raw": "raw traces",
    "steps": "text, raw traces, Player, BeeSoft and ROS",
    "bag": "ROS bags",
}


def takes_option(kind: ImportFormat, key: str) -> bool:
    """Return whether an option, a field of `ImportOptions`, applies to files of a format."""
    facts = {
        "text": kind in (TEXT, JSON_MCAP),
        "columns": kind in (TEXT, JSON_MCAP, ARRAYS),
        "arrays": kind is ARRAYS,
        "log": kind is LOG,
        "traces": kind.has_traces,
        "ranges": not kind.has_traces,
        "raw": kind is RAW,
        "steps": kind.has_step,
        "bag": kind is ROS,
    }
    return any(facts[fact] for fact in _NEEDS[key].split()) if key in _NEEDS else True


def refuse_options(file: Path, kind: ImportFormat, stated: Mapping[str, object]) -> None:
    """Raise InputError for an option that does not apply to the format of a file."""
    for key, value in stated.items():
        if not takes_option(kind, key):
            words = ", ".join(_FACTS[fact] for fact in _NEEDS[key].split())
            given = key if value is True else f"{key}={value:g}" if isinstance(value, float) else f"{key}={value}"
            raise InputError(f"{given}: only for {words}; {file.name} has the format {kind.title}")


def formats_text() -> str:
    """Return the formats and their suffixes as a list in one sentence."""
    listed = ((kind.title, ", ".join(kind.suffixes)) for kind in FORMATS)
    return "; ".join(f"{title} ({suffixes})" if suffixes else title for title, suffixes in listed)
