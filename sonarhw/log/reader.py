"""Read a log, whole or torn.

A closed and undamaged log is opened with its index. This takes only the time to verify its checksums. The frames of any
other log are decoded one by one. Frames and traces are read from the file on access.
"""

import json
import math
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np

from sonarhw.errors import NotALog
from sonarhw.log.contents import FORMAT_VERSION, METADATA_NAME, PROFILE, READINGS, Log, LogMetadata, RecordedScan
from sonarhw.log.index import NAME, IndexedScan, LogIndex, index_of, unpack_index
from sonarhw.log.mcap_records import (
    UNREADABLE,
    Damage,
    Ending,
    McapMessage,
    OpenFile,
    Record,
    attachment,
    channel_of,
    is_mcap,
    metadata_of,
    profile_of,
    read_ending,
    read_records,
)
from sonarhw.log.reading_columns import readings_of
from sonarhw.log.recorded_frames import LogFrames, StoredTraces, known_topics, recorded_frame
from sonarhw.log.recorded_scans import ScanDecoder
from sonarhw.readings import Origin

_FIELDS = ("format_version", "product_version", "made_by", "started", "room_file", "room_text", "place", "board")
_LATEST = 1.8e10  # s since the epoch; later times do not fit into the messages of a log
_UNKNOWN = LogMetadata("unknown", 0.0, product_version="unknown")
_Speeds = dict[tuple[int, float], float]  # m/s, by number and device time (µs) of the reading


def read_log(path: Path | str) -> Log:
    """Return everything readable in a log. `torn` states where it ends too early or is damaged.

    Raises NotALog if the file cannot be read, is not a log of sonarhw, or has a newer format.
    """
    path = Path(path)
    try:
        # a pipe or a device may have no end
        if not path.is_file():
            what = "is a folder" if path.is_dir() else "is not a file" if path.exists() else "no such file"
            raise NotALog(f"{path}: {what}; give the name of a log (*.mcap)")
        file = OpenFile(path)
        if not file.size:
            raise NotALog(f"{path}: the file is empty; expected a log of sonarhw")
        if not is_mcap(file):
            raise NotALog(
                f"{path}: is not an MCAP file; expected a log of sonarhw; "
                "`sonarhw import` converts a scan in CSV to a log"
            )
        head = _Head(path)
        ending = read_ending(file)
        index, topics = _stored_index(file, head, ending) if ending else None, known_topics()
        damage: list[Damage] = []
        if index is None:
            index, damage = _decoded(file, head, topics)
            if ending and not ending.intact and not damage:
                damage.append(Damage("its checksum does not match, though every chunk of frames is undamaged"))
    except OSError as error:
        raise NotALog(f"{path}: cannot be read: {error.strerror}") from error
    metadata, invalid = head.metadata(_torn(damage), has_frames=bool(index.info or index.scans))
    torn = _torn([*damage, *invalid])
    damaged = not all(place.at_end for place in [*damage, *invalid])
    log = Log(metadata, index.info, index.settings, LogFrames(file, index.frames, topics), (), torn, damaged)
    return replace(log, scans=tuple(_recorded(scan, file, log.origin, topics) for scan in index.scans))


def _recorded(indexed: IndexedScan, file: OpenFile, origin: Origin, topics: dict[int, str]) -> RecordedScan:
    traces = StoredTraces(file, indexed.scan.settings, topics)
    return replace(indexed.scan, readings=readings_of(indexed.columns, traces.trace, origin))


class _Head:
    """The part of the header of a file that has been read so far."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._profile: str | None = None
        self._fields: dict[str, str] | None = None

    @property
    def complete(self) -> bool:
        return self._fields is not None

    def take(self, record: Record) -> None:
        """Process a record. Raises the errors in UNREADABLE."""
        self._profile = profile_of(record) or self._profile
        name, fields = metadata_of(record) or ("", None)
        if name == METADATA_NAME:
            self._fields = fields

    def metadata(self, torn: str | None, has_frames: bool) -> tuple[LogMetadata, list[Damage]]:
        """Return the metadata and its damage.

        `has_frames`: the file has frames of a scanner. Raises NotALog if it is not a log.
        """
        if self._fields is not None:
            return _metadata(self._path, self._fields)
        if torn and (self._profile == PROFILE or (self._profile is None and has_frames)):
            return _UNKNOWN, []
        if torn and self._profile is None:
            raise NotALog(f"{self._path}: cannot be read: its header is damaged: {torn}")
        raise NotALog(f"{self._path}: is an MCAP file, but not a log of sonarhw: it has no {METADATA_NAME} metadata")


def _stored_index(file: OpenFile, head: _Head, ending: Ending) -> LogIndex | None:
    """Return the index of a closed and undamaged log; None if its frames must be decoded."""
    at = ending.attachments.get(NAME)
    if at is None or not ending.checked:
        return None
    packed = attachment(file, at)
    index = None if packed is None else unpack_index(packed, at)
    if index and any(_has_no_speed(scan) for scan in index.scans):
        return None
    for item in read_records(file):
        if index is None or head.complete:
            return index
        try:
            if isinstance(item, Record):
                head.take(item)
        except UNREADABLE:
            return None
    return None


def _decoded(file: OpenFile, head: _Head, topics: dict[int, str]) -> tuple[LogIndex, list[Damage]]:
    """Decode the readable frames. Return their index, and the damage. Add the channels of the file to `topics`."""
    decoder = ScanDecoder()
    damage: list[Damage] = []
    speeds: _Speeds = {}
    for item in read_records(file):
        match item:
            case Damage():
                damage.append(item)
            case McapMessage():
                if frame := recorded_frame(item, topics):
                    decoder.take(frame, item.at)
                elif topics.get(item.channel) == READINGS and decoder.settings is None:
                    speeds.update(_decoded_speed(item.data))
            case Record():
                try:
                    head.take(item)
                    topics.update(channel_of(item))
                except UNREADABLE:
                    damage.append(Damage(f"the record that begins at byte {item.at} is left out: it is damaged"))
    index = index_of(decoder)
    return replace(index, scans=tuple(_with_speed(scan, speeds) for scan in index.scans)), damage


def _decoded_speed(data: bytes) -> _Speeds:
    """Return the speed of sound in a decoded reading."""
    try:
        record = json.loads(data)
        return {(record["number"], round(record["time"] * 1e6)): float(record["speed_of_sound"])}
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError):
        return {}


def _has_no_speed(scan: IndexedScan) -> bool:
    return bool(np.isnan(scan.columns["speed_of_sound"]).any())


def _with_speed(scan: IndexedScan, speeds: _Speeds) -> IndexedScan:
    """Return the scan. If its Settings were lost, its speed of sound is that of the decoded readings."""
    if not _has_no_speed(scan):
        return scan
    columns = scan.columns
    keys = zip(columns["number"].tolist(), np.rint(columns["time"] * 1e6).tolist(), strict=True)
    known = [speeds.get(key, math.nan) for key in keys]
    filled = np.where(np.isnan(columns["speed_of_sound"]), known, columns["speed_of_sound"])
    return replace(scan, columns={**columns, "speed_of_sound": filled})


def _torn(damage: list[Damage]) -> str | None:
    # thousands of records may be damaged, so the message names only the first
    more = len(damage) - 1
    others = f" (and {more} more {'place' if more == 1 else 'places'})" if more > 0 else ""
    return f"{damage[0].text}{others}" if damage else None


def _metadata(path: Path, fields: dict[str, str]) -> tuple[LogMetadata, list[Damage]]:
    """Return the metadata in these fields, and a clause about each that is missing or invalid."""
    missing = [name for name in _FIELDS if name not in fields]
    damage = [Damage(f"its {METADATA_NAME} metadata has no field {', '.join(map(repr, missing))}")] if missing else []
    read = LogMetadata(
        made_by=fields.get("made_by", "unknown"),
        started=0.0,
        room_file=fields.get("room_file", ""),
        room_text=fields.get("room_text", ""),
        place=fields.get("place", ""),
        board=fields.get("board", ""),
        board_text=fields.get("board_text", ""),  # missing in early logs
        product_version=fields.get("product_version", "unknown"),
    )
    try:
        read = replace(read, started=_seconds(fields.get("started", "1970-01-01T00:00:00Z")))
    except (ValueError, OverflowError, OSError):
        damage.append(Damage(f"the start time in its {METADATA_NAME} metadata is invalid: {fields['started'][:40]!r}"))
    try:
        read = replace(read, format_version=int(fields.get("format_version", FORMAT_VERSION)))
    except ValueError:
        damage.append(Damage(f"the format in its {METADATA_NAME} metadata is invalid"))
    if read.format_version > FORMAT_VERSION:
        raise NotALog(
            f"{path}: has format {read.format_version}; this version reads up to {FORMAT_VERSION}: update sonarhw"
        )
    return read, damage


def _seconds(date: str) -> float:
    """Return a date in s since the epoch. Raises ValueError for a date that no log can have."""
    seconds = datetime.fromisoformat(date).timestamp()
    if not 0 <= seconds <= _LATEST:
        raise ValueError(f"{date} is not in a time of logs")
    return seconds
