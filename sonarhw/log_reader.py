"""Reads a log, whole or torn: the frames in the file, and the readings that the frames decode to.

Takes a file; hands on a `Log`. The raw frames are the truth: readings come from them through the same decoder as from
a live link.
"""

from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

from sonarhw.errors import NotALog
from sonarhw.log_contents import (
    FORMAT_VERSION,
    FRAMES_RECEIVED,
    FRAMES_SENT,
    METADATA_NAME,
    PROFILE,
    Log,
    LogMetadata,
    RecordedFrame,
)
from sonarhw.mcap_records import McapContents, NotMcapError, read_mcap
from sonarhw.recorded_scans import Follower


def read_log(path: Path) -> Log:
    """Everything readable in a log; `torn` of the result says where it ends too early.

    Raises NotALog where the file cannot be read, is no log of this project, or is of a newer format.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise NotALog(f"{path}: cannot be read: {error.strerror}") from error
    if not data:
        raise NotALog(f"{path}: is empty; a log of this project was expected")
    try:
        contents = read_mcap(data)
    except NotMcapError:
        raise NotALog(f"{path}: is not an MCAP file; a log of this project was expected") from None
    metadata = _metadata(path, contents)
    frames = tuple(_frames(contents))
    follower = Follower()
    for frame in frames:
        follower.take(frame)
    follower.end()
    return Log(metadata, follower.info, follower.settings, frames, follower.scans(), _torn(contents))


def _torn(contents: McapContents) -> str | None:
    # a disk may have spoilt thousands of records: the first says enough in a line
    more = len(contents.damage) - 1
    others = f" (and {more} more {'place' if more == 1 else 'places'})" if more > 0 else ""
    return f"{contents.damage[0]}{others}" if contents.damage else None


def _frames(contents: McapContents) -> Iterator[RecordedFrame]:
    for message in contents.messages:
        topic = contents.topics.get(message.channel)
        if topic in (FRAMES_RECEIVED, FRAMES_SENT):
            yield RecordedFrame(message.time * 1e-9, topic == FRAMES_RECEIVED, message.data)


def _metadata(path: Path, contents: McapContents) -> LogMetadata:
    fields = contents.metadata.get(METADATA_NAME)
    if fields is None and contents.cut and contents.profile == PROFILE:
        return LogMetadata("unknown", 0.0, product_version="unknown")
    if fields is None and contents.cut and contents.profile is None:
        raise NotALog(f"{path}: nothing in it can be read: {_torn(contents)}, before it says what it is")
    if fields is None:
        raise NotALog(f"{path}: is an MCAP file, but not a log of this project: it has no {METADATA_NAME} metadata")
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
            product_version=fields["product_version"],
            format_version=format_version,
        )
    except KeyError as error:
        raise NotALog(f"{path}: its {METADATA_NAME} metadata has no field {error}") from error
    except ValueError as error:
        raise NotALog(f"{path}: its {METADATA_NAME} metadata cannot be understood: {error}") from error
