"""`sonarhw import` and `sonarhw log`: convert, show, repair and export logs."""

import math
import re
import time
from dataclasses import fields, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from sonarhw_compare.import_formats import FORMATS as IMPORT_FORMATS
from sonarhw_compare.import_formats import formats_text

from sonarhw.errors import InputError, counted, counted_are
from sonarhw.export import FORMATS, export_format, export_suffixes
from sonarhw_cli import options
from sonarhw_cli.inputs import (
    LogFile,
    chosen_place,
    load_log,
    notes_beside,
    open_log,
    open_room,
    place_without_room,
)
from sonarhw_cli.outputs import binary_output, checked_out, print_written

if TYPE_CHECKING:
    from sonarhw_compare.imports import ImportedScan
    from sonarhw_sim.board.profile import Board

    from sonarhw.log import Log, LogMetadata, RecordedScan

# `sonarhw import`: convert scans of other programs to logs.


ForeignFile = Annotated[Path, typer.Argument(help=f"A scan in one of these formats: {formats_text()}.", metavar="FILE")]
Format = Annotated[
    str | None,
    typer.Option(
        "--format",
        help=f"Format, instead of that of the content: {', '.join(kind.name for kind in IMPORT_FORMATS)}.",
        metavar="NAME",
    ),
]
Preset = Annotated[
    str | None,
    typer.Option(help="Text: what a line looks like, as in a `lines:` URL; default: proposed.", metavar="NAME"),
]
Pattern = Annotated[
    str | None,
    typer.Option(help="Text: what a reading looks like, such as 'Angle: {deg} Dist: {cm}'.", metavar="PATTERN"),
]
RangeUnit = Annotated[
    str | None, typer.Option("--unit", help="Text: unit of the ranges: m, cm, mm, in, ft, yd, us.", metavar="UNIT")
]
AngleUnit = Annotated[
    str | None, typer.Option("--angle", help="Text, logs: unit of the angles: deg, rad, gon, step.", metavar="UNIT")
]
Variable = Annotated[
    str | None, typer.Option(help="MAT, NPZ: the array to read, also in a structure: data.signal.", metavar="NAME")
]


Axis = Annotated[
    Literal["rows", "columns"] | None, typer.Option(help="Raw traces: whether pings are the rows or the columns.")
]
FullScale = Annotated[
    float | None, typer.Option("--full-scale", help="Raw traces: the largest number, such as volts, of the receiver.")
]
HeadingColumn = Annotated[
    str | None, typer.Option("--heading", help="CSV: column of the turntable angle, degrees.", metavar="COL")
]
RangeColumn = Annotated[
    str | None,
    typer.Option("--range", help="CSV: column of the range; an empty field means no echo.", metavar="COL"),
]
RangeScale = Annotated[float | None, typer.Option(help="Text, logs: metres per unit of the ranges, instead of a unit.")]
Turn = Annotated[
    Literal["ccw", "cw"] | None,
    typer.Option(help="Direction in which these angles increase; default: as the text states, else ccw."),
]
HeadingZero = Annotated[
    float, typer.Option("--heading-zero", help="Turntable angle for the angle 0 in the file, degrees.")
]
NoEcho = Annotated[float | None, typer.Option("--no-echo", help="Range in the file that means no echo.")]
MeanOf = Annotated[
    int | None,
    typer.Option(
        "--mean-of",
        help="Text, logs: each range is the mean of so many pings; means of different ranges are left out.",
        metavar="PINGS",
    ),
]
TimeColumn = Annotated[
    str | None, typer.Option("--time", help="CSV: column of the time, s; default: readings 0.1 s apart.", metavar="COL")
]
PoseX = Annotated[
    str | None,
    typer.Option(
        "--x",
        help="CSV: column of a robot's x; also --y and --yaw. Metres, or the unit in its name.",
        metavar="COL",
    ),
]
PoseY = Annotated[str | None, typer.Option("--y", help="CSV: column of its y.", metavar="COL")]
PoseYaw = Annotated[
    str | None,
    typer.Option(
        "--yaw", help="CSV: column of its heading, counter-clockwise from x. Degrees, or as its name.", metavar="COL"
    ),
]
DecimalComma = Annotated[
    bool,
    typer.Option("--decimal-comma", help="CSV: decimal commas in numbers; semicolons or tabs between columns."),
]
EchoThreshold = Annotated[
    float | None,
    typer.Option(help="Traces: share of full scale, 0 to 1, of an echo; default: readings have no echo."),
]
Blanking = Annotated[float | None, typer.Option(help="Traces: earlier samples are no echo, s. Needs --threshold.")]
SamplingRate = Annotated[float | None, typer.Option(help="Raw traces: sampling rate, Hz. A WAV file contains it.")]
AngleStep = Annotated[
    float | None,
    typer.Option(help="Raw traces, ROS, text: angle from one trace, sensor or reading to the next, degrees."),
]
Topic = Annotated[
    str | None, typer.Option(help="ROS: the only topic to read; default: all with ranges.", metavar="NAME")
]
SpeedOfSound = Annotated[
    float | None,
    typer.Option(help="Traces: speed of sound, m/s; default: that of air at 20 °C. In water about 1500."),
]


def import_scan(
    context: typer.Context,
    file: ForeignFile,
    out: Annotated[Path, typer.Option("--out", help="Log to write.", metavar="LOG.mcap")],
    format_name: Format = None,
    preset: Preset = None,
    pattern: Pattern = None,
    unit: RangeUnit = None,
    angle: AngleUnit = None,
    heading: HeadingColumn = None,
    distance: RangeColumn = None,
    scale: RangeScale = None,
    turn: Turn = None,
    heading_zero: HeadingZero = 0.0,
    no_echo: NoEcho = None,
    mean_of: MeanOf = None,
    time_column: TimeColumn = None,
    x: PoseX = None,
    y: PoseY = None,
    yaw: PoseYaw = None,
    decimal_comma: DecimalComma = False,
    threshold: EchoThreshold = None,
    blanking: Blanking = None,
    rate: SamplingRate = None,
    step: AngleStep = None,
    topic: Topic = None,
    variable: Variable = None,
    axis: Axis = None,
    full_scale: FullScale = None,
    speed_of_sound: SpeedOfSound = None,
    room: options.RoomToStore = None,
    place: options.PlaceName = None,
    board: options.BoardToStore = None,
    force: options.Force = False,
) -> None:
    """Convert a scan of another program to a log. The content of the file selects its format.

    Of text, columns and units are recognised and printed. What cannot be decided ends the command with the option that
    decides it. --heading and --range name columns of a table ("column 2" without a header); ranges are
    then metres if no other unit is stated and metres are plausible. With --room, --place and --board, compare, report
    and fit need no options for them.
    """
    from sonarhw_compare.imports import ImportOptions
    from sonarhw_compare.imports import import_scan as read

    from sonarhw.log.writer import write_scan

    checked_out(out, (options.LOG,), force, file, room, board)
    given_options = {_FIELDS.get(name, name): value for name, value in context.params.items() if value is not None}
    stated = {key: value for key, value in given_options.items() if key in _keys()}
    given = _metadata(room, place, board)
    try:
        scan = read(file, ImportOptions(**stated))
    except InputError as error:
        raise InputError(_with_options(str(error))) from error
    metadata = scan.metadata(given, place_is_stated=place is not None)
    write_scan(out, metadata, scan.readings, overwrite=force)
    _report_import(scan, out, _board_in(metadata))


_FIELDS = {"format_name": "format", "distance": "range", "time_column": "time"}  # of `ImportOptions`, by parameter


def _keys() -> tuple[str, ...]:
    """Return the names of all that a user may state about a file."""
    from sonarhw_compare.imports import ImportOptions

    return tuple(field.name for field in fields(ImportOptions))


def _report_import(scan: "ImportedScan", out: Path, board: "Board | None") -> None:
    """Print what is damaged, how the file was read, and what is doubtful in the scan."""
    for damage in scan.damage:
        options.warn(_with_options(damage))
    for note in scan.read_as:
        options.print_note(f"{scan.where}: {_with_options(note)}")
    echoes = sum(reading.range is not None for reading in scan.readings)
    options.print_note(f"{counted(len(scan.readings), 'reading')}, {echoes} with an echo, in {out}")
    for doubt in scan.doubts(board):
        options.warn(_with_options(doubt))


def _board_in(metadata: "LogMetadata") -> "Board | None":
    """Return the board in the metadata of a log; None without one."""
    from sonarhw_compare.scans import board_of_log

    return board_of_log(metadata) if metadata.board else None


def _with_options(question: str) -> str:
    """Return a question with the options of this command in place of the keys of a URL."""
    of_file = r"(?<!\w)'[^']*'(?!\w)|\"[^\"]*\""  # quoted, not a key
    keys = rf"{of_file}|(?<![\w-])(?:({'|'.join(_keys())})=('[^']*'|\S*)|decimal_comma(?=: only))"

    def option(match: re.Match[str]) -> str:
        if match[1]:
            return f"--{match[1].replace('_', '-')} {match[2]}".rstrip()
        return match[0].replace("decimal_comma", "--decimal-comma")

    return re.sub(keys, option, question)


def _metadata(room_name: str | None, place: str | None, board: str | None) -> "LogMetadata":
    """Return the metadata of the log. The place may be unknown, also in a room with several places."""
    from sonarhw_sim.board.profile import load_board
    from sonarhw_sim.files import file_name

    from sonarhw.log import LogMetadata

    metadata = LogMetadata("import", time.time())
    if board is not None:
        profile = load_board(board)
        metadata = replace(metadata, board=profile.name, board_text=profile.text)
    if room_name is None:
        return metadata if place is None else replace(metadata, place=place_without_room(place))
    room = open_room(room_name)
    here = "" if place is None and len(room.places) != 1 else chosen_place(room, place).name
    return replace(metadata, room_file=file_name(room_name), room_text=room.text, place=here)


# `sonarhw log`: describe a log, export its readings, or recover a torn one.


app = options.CommandList(help="Describe, export or recover a log.", no_args_is_help=True)


@app.command("info")
def log_info(log: LogFile, as_json: options.AsJson = False) -> None:
    """Describe a log: its origin, its device and its scans."""
    if as_json:
        options.print_json(_figures(log, open_log(log)))
        return
    for name, text in _described(open_log(log)):
        options.print_line(f"{name:<9} {text}")


_FORMATS = ", ".join(f"{kind.suffix} ({kind.title})" for kind in FORMATS)


@app.command(
    "export",
    help=f"Write a log to a file. Formats: {_FORMATS}, {options.LOG} (Copy of the log). "
    "In CSV, heading_deg is the turntable angle.",
)
def log_export(
    log: LogFile,
    out: Annotated[
        str,
        typer.Option("--out", help=f"File to write; - writes {FORMATS[0].suffix} to standard output.", metavar="FILE"),
    ],
    force: options.Force = False,
) -> None:
    """Write a log to a file in the format of its suffix, with the notes beside it."""
    kind = checked_out(out, (*export_suffixes(), options.LOG, options.STDOUT), force, log)
    recorded = open_log(log)
    if kind == options.LOG:
        from sonarhw.log import copy_log

        _warn_of_times(copy_log(recorded, Path(out), overwrite=force))
        print_written(Path(out))
        return
    chosen = FORMATS[0] if kind == options.STDOUT else export_format(kind)
    notes = notes_beside(log, recorded.readings)
    with binary_output(out, force) as file:
        chosen.write(recorded, file, notes.texts)


@app.command("recover")
def log_recover(
    log: LogFile,
    out: Annotated[Path, typer.Option("--out", help="Log to write.", metavar="LOG.mcap")],
    force: options.Force = False,
) -> None:
    """Repair a torn log. Everything readable is written to a new log. The number of missing readings is printed."""
    from sonarhw.log import copy_log

    checked_out(out, (options.LOG,), force, log)
    recorded = load_log(log)
    _warn_of_times(copy_log(recorded, out, overwrite=force))
    kept = f"{out}: {counted(len(recorded.readings), 'reading')} in {counted(len(recorded.scans), 'scan')}"
    lost = f"nothing was lost, {log} was whole"
    if recorded.torn:
        lost = f"{_lost(recorded)}; {log} was {recorded.condition}: {recorded.torn}"
    options.print_line(f"{kept}; {lost}")


def _warn_of_times(impossible: int) -> None:
    if impossible:
        options.warn(f"{counted_are(impossible, 'time')} impossible, and replaced by the time before")


def _lost(log: "Log") -> str:
    missing, made = sum(scan.missing for scan in log.scans), sum(scan.made for scan in log.scans)
    if not missing:
        return "no reading is known to be missing"
    return f"{missing} of {counted(made, 'reading')} {'is' if missing == 1 else 'are'} missing"


def _figures(file: Path, log: "Log") -> dict[str, Any]:
    """Return a log under the keys of `log info --json`; None for what it does not contain."""
    made, device = log.metadata, log.info
    return {
        "file": str(file),
        "origin": log.origin,
        "made_by": made.made_by,
        "product_version": made.product_version,
        "started": datetime.fromtimestamp(made.started, UTC).isoformat() if made.started else None,
        "room_file": made.room_file or None,
        "place": made.place or None,
        "board": made.board or (device.board if device else "") or None,
        "source": made.source or None,
        "read_as": made.read_as or None,
        "device": None
        if device is None
        else {
            "firmware": device.firmware,
            "serial": device.serial or None,
            "protocol": f"{device.major}.{device.minor}",
        },
        "speed_of_sound": log.settings.speed_of_sound / 1000 if log.settings else None,
        "scans": [_scan_figures(scan) for scan in log.scans],
        "frames": len(log.frames),
        "condition": log.condition,
        "damage": log.torn,
    }


def _scan_figures(scan: "RecordedScan") -> dict[str, Any]:
    readings = scan.readings
    angles = [round(math.degrees(reading.angle), 6) for reading in readings]
    return {
        "readings": len(readings),
        "expected": scan.expected,
        "echoes": sum(reading.range is not None for reading in readings),
        "traces": sum(reading.trace is not None for reading in readings),
        "lowest_angle_deg": min(angles, default=None),
        "highest_angle_deg": max(angles, default=None),
        "sweeps": readings[-1].sweep + 1 if readings else 0,
        "duration_s": round(readings[-1].time - scan.began, 6) if readings else None,
        "finished": scan.finished is not None,
        "angle_warning": scan.angle_warning,
    }


def _described(log: "Log") -> list[tuple[str, str]]:
    made, device = log.metadata, log.info
    started = f"{datetime.fromtimestamp(made.started, UTC):%Y-%m-%d %H:%M:%S} UTC"
    lines = [
        ("made by", f"{made.made_by}, sonarhw {made.product_version}" if made.started else "unknown"),
        ("started", started if made.started else "unknown"),
        ("readings", log.origin if log.readings else "none"),
        ("room", made.room_file or "not recorded"),
        ("place", made.place or "not recorded"),
        ("board", made.board or (device.board if device else "") or "not recorded"),
    ]
    lines += [(name, text) for name, text in (("source", made.source), ("read as", made.read_as)) if text]
    if device:
        serial = f", serial number {device.serial}" if device.serial else ""
        lines.append(("device", f"{device.firmware}{serial}, protocol {device.major}.{device.minor}"))
    if log.settings:
        lines.append(("sound", f"{log.settings.speed_of_sound / 1000:.3f} m/s"))
    lines += [(f"scan {number}", _scan_line(scan)) for number, scan in enumerate(log.scans, 1)]
    lines.append(("frames", str(len(log.frames))))
    lines.append(("file", f"{log.condition}: {log.torn}" if log.torn else log.condition))
    return lines


def _scan_line(scan: "RecordedScan") -> str:
    readings = scan.readings
    ordered = "" if scan.expected is None else f"{len(readings)} of "
    took = f"{ordered}{counted(len(readings) if scan.expected is None else scan.expected, 'reading')}"
    lost = f"; {scan.angle_warning}" if scan.angle_warning else ""
    end = lost if scan.finished else "; the scan was not finished"
    if not readings:
        return f"{took}{end}"
    echoes = sum(reading.range is not None for reading in readings)
    traces = sum(reading.trace is not None for reading in readings)
    angles = [math.degrees(reading.angle) for reading in readings]
    return (
        f"{took}, {echoes} with an echo, {traces} with a trace; "
        f"{min(angles):.6g}° to {max(angles):.6g}°, {counted(readings[-1].sweep + 1, 'sweep')}, "
        f"{readings[-1].time - scan.began:.1f} s{end}"
    )
