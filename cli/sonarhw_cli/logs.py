"""`sonarhw import` and `sonarhw log`: convert, show, repair and export logs."""

import math
import re
import time
import warnings
from dataclasses import replace
from datetime import UTC, datetime
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from sonarhw_compare.import_formats import FORMATS as IMPORT_FORMATS
from sonarhw_compare.import_formats import LOG, RAW, ROS, TEXT, ImportFormat, formats_text, import_format

from sonarhw.errors import InputError, counted, counted_are
from sonarhw.export import FORMATS, export_format, export_suffixes
from sonarhw_cli import options
from sonarhw_cli.inputs import (
    LogFile,
    chosen_place,
    load_log,
    note_assumed_heading,
    notes_beside,
    open_log,
    open_room,
    place_without_room,
)
from sonarhw_cli.outputs import binary_output, checked_out, print_written

if TYPE_CHECKING:
    from sonarhw_compare.foreign_csv import CsvColumns, Meaning

    from sonarhw.log import Log, LogMetadata, RecordedScan
    from sonarhw.readings import Reading
    from sonarhw.text.layouts import Layout

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
    str | None, typer.Option("--unit", help="Text: unit of the ranges: m, cm, mm, in, ft, us.", metavar="UNIT")
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
RangeScale = Annotated[float, typer.Option(help="CSV, logs: metres per unit of the ranges.")]
Turn = Annotated[Literal["ccw", "cw"], typer.Option(help="Direction in which these angles increase.")]
HeadingZero = Annotated[
    float, typer.Option("--heading-zero", help="Turntable angle for the angle 0 in the file, degrees.")
]
NoEcho = Annotated[float | None, typer.Option("--no-echo", help="Range in the file that means no echo.")]
MeanOf = Annotated[
    int | None,
    typer.Option(
        "--mean-of",
        help="CSV: each range is the mean of so many pings; means of different ranges are left out.",
        metavar="PINGS",
    ),
]
TimeColumn = Annotated[
    str | None, typer.Option("--time", help="CSV: column of the time, s; default: readings 0.1 s apart.", metavar="COL")
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


_OF_CSV = ": only for CSV files; {file} has the format {title}"
_OF_TRACES = " {value:g}: only for formats with traces; {file} has ranges"
_OF_TEXT = " {value}: only for text; {file} has the format {title}"
# what options need of the format of the file, one of `_facts`
_RULES = (
    options.Rule("import", "--heading --range --time --decimal-comma --mean-of", _OF_CSV, "csv"),
    options.Rule("import", "--scale", _OF_CSV, "csv log"),
    options.Rule("import", "--preset --pattern --unit", _OF_TEXT, "text"),
    options.Rule("import", "--angle", _OF_TEXT, "text log"),
    options.Rule("import", "--threshold --blanking --speed-of-sound", _OF_TRACES, "traces"),
    options.Rule(
        "import", "--no-echo", " {value:g}: only for formats with ranges; {file} has traces", excludes="traces"
    ),
    options.Rule("import", "--rate", " {value:g}: only for raw traces; {file} has its own", "raw"),
    options.Rule("import", "--axis --variable --full-scale", " {value}: only for raw traces", "raw"),
    options.Rule("import", "--step", " {value:g}: only for raw traces, ROS and text; {file} has angles", "steps"),
    options.Rule("import", "--topic", " {value}: only for ROS bags", "bag"),
)


def _facts(kind: ImportFormat | None) -> list[str]:
    """Return what a file of a format contains; None is CSV with named columns."""
    if kind is None:
        return ["csv"]
    facts = {
        "traces": kind.has_traces,
        "raw": kind is RAW,
        "steps": kind.has_step,
        "bag": kind is ROS,
        "text": kind is TEXT,
        "log": kind is LOG,
    }
    return [fact for fact, is_true in facts.items() if is_true]


def import_scan(
    context: typer.Context,
    file: ForeignFile,
    out: Annotated[Path, typer.Option("--out", help="Log to write (*.mcap).")],
    format_name: Format = None,
    preset: Preset = None,
    pattern: Pattern = None,
    unit: RangeUnit = None,
    angle: AngleUnit = None,
    heading: HeadingColumn = None,
    distance: RangeColumn = None,
    scale: RangeScale = 1.0,
    turn: Turn = "ccw",
    heading_zero: HeadingZero = 0.0,
    no_echo: NoEcho = None,
    mean_of: MeanOf = None,
    time_column: TimeColumn = None,
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

    Of text, columns and units are recognised and printed. What is doubtful is not guessed: the command ends with the
    option that decides it. --heading and --range read a CSV file by the names of its columns. With --room, --place and
    --board, compare, report and fit need no options for them.
    """
    from sonarhw_compare.foreign_csv import Meaning, read_foreign_scan

    from sonarhw.log.writer import write_scan

    checked_out(out, (options.LOG,), force, file, room, board)
    _check_options(scale, heading_zero)
    metadata = _metadata(room, place, board)
    name = format_name or ""
    by_columns = heading is not None or distance is not None or decimal_comma or time_column is not None
    file_format = _format_of(file, name, rate, by_columns)
    columns = _columns(file, heading, distance, time_column, decimal_comma) if file_format is None else None
    title = file_format.title if file_format else ""
    options.check_rules(context, _RULES, _facts(file_format), file=file.name, title=title)
    _check_values(file, file_format, threshold, blanking, speed_of_sound, rate, step, full_scale)
    meaning = Meaning(
        scale=scale,
        sign=-1.0 if turn == "cw" else 1.0,
        unit_deg=_angle_unit(angle) if file_format is LOG else 1.0,
        zero=heading_zero,
        no_echo=no_echo,
        speed_of_sound=speed_of_sound,
        threshold=threshold,
        blanking=blanking or 0.0,
        rate=rate,
        step=step or 0.0,
        topic=topic,
        variable=variable,
        axis=axis,
        full_scale=full_scale,
    )
    if columns is None:
        stated = _stated_layout(preset, pattern, unit, angle, no_echo, step)
        readings, read_as = _read(file, meaning, *stated, name)
    else:
        read_as = f"CSV: {columns.heading} in degrees, {columns.distance} times {scale:g} m"
        readings = _without_means(file, read_foreign_scan(file, columns, meaning), meaning, mean_of)
    if file_format is LOG:
        metadata = _with_those_of(load_log(file).metadata, metadata)
    if place is None and any(reading.pose for reading in readings):
        metadata = replace(metadata, place="")  # the poses state where the readings were made
    write_scan(out, replace(metadata, source=str(file), read_as=read_as), readings, overwrite=force)
    echoes = sum(reading.range is not None for reading in readings)
    options.print_note(f"{counted(len(readings), 'reading')}, {echoes} with an echo, in {out}")
    silent = math.nan if no_echo is None else no_echo * scale
    _warn_of_readings(readings, metadata, silent, scale if file_format in (None, LOG) else None, mean_of)


def _format_of(file: Path, name: str, rate: float | None, by_columns: bool) -> ImportFormat | None:
    """Return the format of a file, None for CSV with named columns. Raises InputError for an unknown name."""
    if name not in ("", *(kind.name for kind in IMPORT_FORMATS)):
        listed = ", ".join(kind.name for kind in IMPORT_FORMATS)
        raise InputError(f"--format {name}: expected {listed}")
    file_format = import_format(file, rate, name)
    return None if by_columns and file_format is TEXT else file_format


def _stated_layout(
    preset: str | None,
    pattern: str | None,
    unit: str | None,
    angle: str | None,
    no_echo: float | None,
    step: float | None,
) -> "tuple[Layout | None, Layout]":
    """Return the layout of the text, None without a preset or pattern, and what is known of any layout."""
    from sonarhw.text.layouts import Layout, layout_of

    keys = {"preset": preset, "pattern": pattern, "unit": unit, "angle": angle}
    values = {key: value for key, value in keys.items() if value}
    values |= {} if no_echo is None else {"no_echo": f"{no_echo:g}"}
    values |= {} if not step else {"step": f"{step:g}"}
    if preset or pattern:
        return layout_of(values), Layout()
    return None, layout_of({"preset": "csv", **values})


def _columns(
    file: Path, heading: str | None, distance: str | None, time_column: str | None, decimal_comma: bool
) -> "CsvColumns":
    """Return the columns of a CSV file. Raises InputError if options are missing."""
    from sonarhw_compare.foreign_csv import CsvColumns, read_head

    if heading is None or distance is None:
        names = ", ".join(read_head(file, 0, decimal_comma).header)
        raise InputError(
            f"{file}: a CSV file needs --heading COL and --range COL; its columns: {names}; "
            "`sonarhw import --help` lists other formats"
        )
    return CsvColumns(heading, distance, time_column, decimal_comma)


def _without_means(file: Path, readings: "list[Reading]", meaning: "Meaning", mean_of: int | None) -> "list[Reading]":
    """Return the readings without means of different ranges; all of them if `mean_of` is None."""
    import numpy as np

    from sonarhw.mean_ranges import MOST_PINGS, are_means, unit_of

    if mean_of is None:
        return readings
    silent = math.nan if meaning.no_echo is None else meaning.no_echo * meaning.scale
    ranges = np.array([silent if reading.range is None else reading.range for reading in readings])
    unit = unit_of(ranges, meaning.scale)
    if not 2 <= mean_of <= MOST_PINGS:
        raise InputError(f"--mean-of {mean_of}: expected 2 to {MOST_PINGS} pings")
    kept = list(compress(readings, ~are_means(ranges, unit, mean_of)))
    options.print_note(f"{file}: {counted(len(readings) - len(kept), 'mean')} of different ranges left out")
    return [replace(reading, number=number) for number, reading in enumerate(kept)]


def _check_values(
    file: Path,
    file_format: ImportFormat | None,
    threshold: float | None,
    blanking: float | None,
    speed: float | None,
    rate: float | None,
    step: float | None,
    full_scale: float | None,
) -> None:
    """Raise InputError for values about traces that are missing or wrong."""
    if threshold is not None and not 0 < threshold <= 1:
        raise InputError(f"--threshold {threshold:g}: expected a share of full scale, above 0 and up to 1")
    if blanking is not None and (threshold is None or not 0 <= blanking <= 1):
        raise InputError(f"--blanking {blanking:g}: expected 0 to 1 s, and --threshold")
    if speed is not None and not 100 <= speed <= 10_000:
        raise InputError(f"--speed-of-sound {speed:g}: expected 100 to 10000 m/s")
    if file_format is RAW and (rate is None) != (file.suffix.lower() == ".wav"):
        problem = "needs --rate, Hz" if rate is None else f"--rate {rate:g}: a WAV file has its own; leave it out"
        raise InputError(f"{file}: {problem}")
    if step is not None and not -360 <= step <= 360:
        raise InputError(f"--step {step:g}: expected -360 to 360 degrees")
    if full_scale is not None and not full_scale > 0:
        raise InputError(f"--full-scale {full_scale:g}: expected a number above 0")


def _read(
    file: Path, meaning: "Meaning", layout: "Layout | None", stated: "Layout", name: str
) -> "tuple[list[Reading], str]":
    """Return the readings of a file that is not CSV with named columns, and how it was read, which is printed."""
    from sonarhw_compare.imports import read_scan

    with warnings.catch_warnings(record=True) as doubts:
        warnings.simplefilter("always")
        try:
            scan = read_scan(file, meaning, layout, stated, name)
        except InputError as error:
            raise InputError(_with_options(str(error))) from error
    for doubt in doubts:
        options.warn(_with_options(str(doubt.message)))
    for note in scan.notes:
        options.print_note(f"{file}: {_with_options(note)}")
    return scan.readings, "; ".join(scan.notes)


def _with_options(question: str) -> str:
    """Return a question with the options of this command in place of the keys of a URL."""
    keys = r"\b(unit|angle|step|pattern|axis|variable|full_scale)=(\w*)"
    return re.sub(keys, lambda key: f"--{key[1].replace('_', '-')} {key[2]}".rstrip(), question)


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
    note_assumed_heading(place)
    here = "" if place is None and len(room.places) != 1 else chosen_place(room, place).name
    return replace(metadata, room_file=file_name(room_name), room_text=room.text, place=here)


def _warn_of_readings(
    readings: "list[Reading]", metadata: "LogMetadata", silent: float, scale: float | None, mean_of: int | None
) -> None:
    """Warn of what is probably wrong in the readings, in the numbers of the file if their `scale` is known."""
    from sonarhw_compare.scans import board_of_log, reach_of

    from sonarhw.scan_check import ANY_BOARD, check_scan

    reach = reach_of(board_of_log(metadata)) if metadata.board else ANY_BOARD
    for doubt in check_scan(readings, reach, silent):
        if doubt.kind == "means" and mean_of is not None:
            continue
        text = str(doubt)
        if doubt.silent is not None:
            number = "NUMBER" if scale is None else f"{doubt.silent / scale:g}"
            text = re.sub(r"--no-echo [\d.]+", f"--no-echo {number}", text)
        options.warn(text)


def _with_those_of(recorded: "LogMetadata", given: "LogMetadata") -> "LogMetadata":
    """Return the metadata of a corrected log: room, place and board that are not given are the recorded ones."""
    if not given.room_text:
        place = given.place or recorded.place
        given = replace(given, room_file=recorded.room_file, room_text=recorded.room_text, place=place)
    return given if given.board else replace(given, board=recorded.board, board_text=recorded.board_text)


def _angle_unit(angle: str | None) -> float:
    """Return the degrees that a unit of angles has, 1 by default. Raises InputError."""
    from sonarhw.text.words import ANGLE_UNITS

    if angle is not None and angle not in ANGLE_UNITS:
        raise InputError(f"--angle {angle}: expected {', '.join(ANGLE_UNITS)} for a log")
    return ANGLE_UNITS[angle or "deg"]


def _check_options(scale: float, heading_zero: float) -> None:
    if not (math.isfinite(scale) and scale > 0):
        raise InputError(f"--scale {scale:g}: expected a number above 0, such as 0.01 for centimetres")
    options.check_degrees("--heading-zero", heading_zero)


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
    out: Annotated[Path, typer.Option("--out", help="Log to write (*.mcap).")],
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
