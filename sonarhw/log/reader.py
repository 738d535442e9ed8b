"""Opens a log, whole or torn: the readings that its frames decode to.

Takes a file; hands on a `Log`. A closed and undamaged one is opened by its index, which takes no longer than checking
that it is undamaged; any other is gone through frame by frame. Frames and traces stay in the file.
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
from sonarhw.log.recorded_scans import Follower

_Speeds = dict[tuple[int, int], float]  # m/s, by number of the reading and device clock, µs


def read_log(path: Path) -> Log:
    """Everything readable in a log; `torn` of the result says where it ends too early or is damaged.

    Raises NotALog where the file cannot be read, is no log of this project, or is of a newer format.
    """
    try:
        file = OpenFile(path)
        if not file.size:
            raise NotALog(f"{path}: is empty; a log of this project was expected")
        if not is_mcap(file):
            raise NotALog(
                f"{path}: is not an MCAP file; a log of this project was expected"
                "; a scan in CSV becomes one by `sonarhw import`"
            )
        head = _Head(path)
        ending = read_ending(file)
        index = _closed(file, head, ending) if ending else None
        damage: list[Damage] = []
        if index is None:
            index, damage = _gone_through(file, head)
            if ending and not ending.sound and not damage:
                damage.append(Damage("its checksum does not match, though every chunk of frames is as it was written"))
    except OSError as error:
        raise NotALog(f"{path}: cannot be read: {error.strerror}") from error
    torn = _torn(damage)
    metadata = head.metadata(torn, talks=bool(index.info or index.scans))
    scans = tuple(_recorded(scan, file) for scan in index.scans)
    damaged = not all(place.at_end for place in damage)
    return Log(metadata, index.info, index.settings, LogFrames(file, index.frames), scans, torn, damaged)


def _recorded(indexed: IndexedScan, file: OpenFile) -> RecordedScan:
    traces = StoredTraces(file, indexed.scan.settings)
    return replace(indexed.scan, readings=readings_of(indexed.columns, traces.trace))


class _Head:
    """What a file says of itself, as far as it has been read."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._profile: str | None = None
        self._fields: dict[str, str] | None = None

    @property
    def complete(self) -> bool:
        return self._fields is not None

    def take(self, record: Record) -> None:
        """Look at a record. Raises what is in UNREADABLE."""
        self._profile = profile_of(record) or self._profile
        name, fields = metadata_of(record) or ("", None)
        if name == METADATA_NAME:
            self._fields = fields

    def metadata(self, torn: str | None, talks: bool) -> LogMetadata:
        """Where the log comes from; `talks`: a scanner speaks in it. Raises NotALog where it is none."""
        if self._fields is not None:
            return _metadata(self._path, self._fields)
        if torn and (self._profile == PROFILE or (self._profile is None and talks)):
            return LogMetadata("unknown", 0.0, product_version="unknown")
        if torn and self._profile is None:
            raise NotALog(f"{self._path}: nothing in it can be read: {torn}, before it says what it is")
        raise NotALog(
            f"{self._path}: is an MCAP file, but not a log of this project: it has no {METADATA_NAME} metadata"
        )


def _closed(file: OpenFile, head: _Head, ending: Ending) -> LogIndex | None:
    """The index of a log that was closed and is undamaged; None where it has to be gone through."""
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
        if isinstance(item, Record):
            head.take(item)
    return None


def _gone_through(file: OpenFile, head: _Head) -> tuple[LogIndex, list[Damage]]:
    """What the readable frames tell, and what could not be read."""
    follower, topics = Follower(), known_topics()
    damage: list[Damage] = []
    speeds: _Speeds = {}
    for item in read_records(file):
        match item:
            case Damage():
                damage.append(item)
            case McapMessage():
                if frame := recorded_frame(item, topics):
                    follower.take(frame, item.at)
                elif topics.get(item.channel) == READINGS and follower.settings is None:
                    speeds.update(_decoded_speed(item.data))
            case Record():
                try:
                    head.take(item)
                    topics.update(channel_of(item))
                except UNREADABLE:
                    damage.append(Damage(f"the record that begins at byte {item.at} is left out: it is damaged"))
    index = index_of(follower)
    return replace(index, scans=tuple(_with_speed(scan, speeds) for scan in index.scans)), damage


def _decoded_speed(data: bytes) -> _Speeds:
    """The speed of sound in a decoded reading."""
    try:
        record = json.loads(data)
        return {(record["number"], round(record["time"] * 1e6)): float(record["speed_of_sound"])}
    except (ValueError, KeyError, TypeError, OverflowError):
        return {}


def _has_no_speed(scan: IndexedScan) -> bool:
    return bool(np.isnan(scan.columns["speed_of_sound"]).any())


def _with_speed(scan: IndexedScan, speeds: _Speeds) -> IndexedScan:
    """The scan with its speed of sound from the decoded readings, where its Settings were lost."""
    if not _has_no_speed(scan):
        return scan
    columns = scan.columns
    keys = zip(columns["number"].tolist(), np.rint(columns["time"] * 1e6).astype(int).tolist(), strict=True)
    known = [speeds.get(key, math.nan) for key in keys]
    filled = np.where(np.isnan(columns["speed_of_sound"]), known, columns["speed_of_sound"])
    return replace(scan, columns={**columns, "speed_of_sound": filled})


def _torn(damage: list[Damage]) -> str | None:
    # a disk may have spoilt thousands of records: the first says enough in a line
    more = len(damage) - 1
    others = f" (and {more} more {'place' if more == 1 else 'places'})" if more > 0 else ""
    return f"{damage[0].text}{others}" if damage else None


def _metadata(path: Path, fields: dict[str, str]) -> LogMetadata:
    try:
        format_version = int(fields["format_version"])
        if format_version > FORMAT_VERSION:
            raise NotALog(
                f"{path}: has format {format_version}; this version reads up to {FORMAT_VERSION}: update sonarhw"
            )
        return LogMetadata(
            made_by=fields["made_by"],
            started=datetime.fromisoformat(fields["started"]).timestamp(),
            room_file=fields["room_file"],
            room_text=fields["room_text"],
            place=fields["place"],
            board=fields["board"],
            board_text=fields.get("board_text", ""),  # logs of the first days have none
            product_version=fields["product_version"],
            format_version=format_version,
        )
    except KeyError as error:
        raise NotALog(f"{path}: its {METADATA_NAME} metadata has no field {error}") from error
    except ValueError as error:
        raise NotALog(f"{path}: its {METADATA_NAME} metadata cannot be understood: {error}") from error
