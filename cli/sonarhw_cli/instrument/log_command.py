"""`sonarhw log`: describe a log, export its readings, or recover a torn one."""

import math
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.export.export_formats import FORMATS, export_format, export_suffixes
from sonarhw_cli.console.log_input import LogFile, load_log, open_log
from sonarhw_cli.console.number_format import counted
from sonarhw_cli.console.options import LOG, STDOUT, Force, checked_out
from sonarhw_cli.console.output import binary_output

if TYPE_CHECKING:
    from sonarhw.log import Log, RecordedScan

app = typer.Typer(help="Describe, export or recover a log.", no_args_is_help=True)


@app.command("info")
def log_info(log: LogFile) -> None:
    """Describe a log: its origin, its device and its scans."""
    for name, text in _described(open_log(log)):
        typer.echo(f"{name:<9} {text}")


_FORMATS = ", ".join(f"{known.suffix} ({known.title})" for known in FORMATS)


@app.command("export", help=f"Write a log to a file. Formats: {_FORMATS}, {LOG} (Copy of the log).")
def log_export(
    log: LogFile,
    out: Annotated[str, typer.Option("--out", help=f"File to write; - writes {FORMATS[0].suffix} to standard output.")],
    force: Force = False,
) -> None:
    """Write a log to a file in the format of its suffix."""
    kind = checked_out(out, (*export_suffixes(), LOG, STDOUT), force, log)
    recorded = open_log(log)
    if kind == LOG:
        from sonarhw.log import copy_log

        copy_log(recorded, Path(out), overwrite=force)
        return
    chosen = FORMATS[0] if kind == STDOUT else export_format(kind)
    with binary_output(out) as file:
        chosen.write(recorded, file)


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
    typer.echo(f"{kept}; {lost}")


def _lost(log: "Log") -> str:
    # readings that a stopped scan did not make are not missing
    made = [scan.finished.readings if scan.finished else scan.expected or 0 for scan in log.scans]
    missing = sum(max(0, count - len(scan.readings)) for count, scan in zip(made, log.scans, strict=True))
    if not missing:
        return "no reading is known to be missing"
    return f"{missing} of {counted(sum(made), 'reading')} {'is' if missing == 1 else 'are'} missing"


def _described(log: "Log") -> list[tuple[str, str]]:
    made, device = log.metadata, log.info
    started = f"{datetime.fromtimestamp(made.started, UTC):%Y-%m-%d %H:%M:%S} UTC"
    lines = [
        ("made by", f"{made.made_by}, sonarhw {made.product_version}" if made.started else "unknown"),
        ("started", started if made.started else "unknown"),
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
