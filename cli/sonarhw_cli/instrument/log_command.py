"""`sonarhw log`: describe a log, export its readings, or recover a torn one."""

import math
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sonarhw.errors import counted
from sonarhw.export import FORMATS, export_format, export_suffixes
from sonarhw_cli.console.lines import print_json, print_line
from sonarhw_cli.console.log_input import LogFile, load_log, notes_beside, open_log
from sonarhw_cli.console.options import LOG, STDOUT, AsJson, Force
from sonarhw_cli.console.output import binary_output, checked_out, print_written
from sonarhw_cli.console.plain_help import CommandList

if TYPE_CHECKING:
    from sonarhw.log import Log, RecordedScan

app = CommandList(help="Describe, export or recover a log.", no_args_is_help=True)


@app.command("info")
def log_info(log: LogFile, as_json: AsJson = False) -> None:
    """Describe a log: its origin, its device and its scans."""
    if as_json:
        print_json(_figures(log, open_log(log)))
        return
    for name, text in _described(open_log(log)):
        print_line(f"{name:<9} {text}")


_FORMATS = ", ".join(f"{known.suffix} ({known.title})" for known in FORMATS)


@app.command(
    "export",
    help=f"Write a log to a file. Formats: {_FORMATS}, {LOG} (Copy of the log). In CSV, heading_deg is the turntable "
    "angle.",
)
def log_export(
    log: LogFile,
    out: Annotated[
        str,
        typer.Option("--out", help=f"File to write; - writes {FORMATS[0].suffix} to standard output.", metavar="FILE"),
    ],
    force: Force = False,
) -> None:
    """Write a log to a file in the format of its suffix, with the notes beside it."""
    kind = checked_out(out, (*export_suffixes(), LOG, STDOUT), force, log)
    recorded = open_log(log)
    if kind == LOG:
        from sonarhw.log import copy_log

        copy_log(recorded, Path(out), overwrite=force)
        print_written(Path(out))
        return
    chosen = FORMATS[0] if kind == STDOUT else export_format(kind)
    notes = notes_beside(log, recorded.readings)
    with binary_output(out, force) as file:
        chosen.write(recorded, file, notes.texts)


@app.command("recover")
def log_recover(
    log: LogFile,
    out: Annotated[Path, typer.Option("--out", help="Log to write (*.mcap).")],
    force: Force = False,
) -> None:
    """Repair a torn log. Everything readable is written to a new log. The number of missing readings is printed."""
    from sonarhw.log import copy_log

    checked_out(out, (LOG,), force, log)
    recorded = load_log(log)
    copy_log(recorded, out, overwrite=force)
    kept = f"{out}: {counted(len(recorded.readings), 'reading')} in {counted(len(recorded.scans), 'scan')}"
    lost = f"nothing was lost, {log} was whole"
    if recorded.torn:
        lost = f"{_lost(recorded)}; {log} was {recorded.condition}: {recorded.torn}"
    print_line(f"{kept}; {lost}")


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
