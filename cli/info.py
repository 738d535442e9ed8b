"""`sonarhw info`: who answers at a URL, and how good the link is."""

from typing import TYPE_CHECKING

import typer

from cli.connect import ScannerUrl, connect
from cli.interruption import sigterm_raises

if TYPE_CHECKING:
    from sonarhw.scanner import Scanner


def info(url: ScannerUrl) -> None:
    """Tell who answers: firmware, protocol, serial number, capabilities, temperature, link statistics."""
    with sigterm_raises(), connect(url) as scanner:
        scanner.stop()  # one more command there and back for the statistics
        for name, value in _facts(scanner):
            typer.echo(f"{name:<14}{value}")


def _facts(scanner: "Scanner") -> list[tuple[str, str]]:
    who, link = scanner.info, scanner.statistics
    return [
        ("firmware", who.firmware),
        ("protocol", f"{who.protocol[0]}.{who.protocol[1]}"),
        ("serial", who.serial or "none"),
        ("board", who.board or "not stated"),
        ("traces", f"{who.trace_rate / 1000:g} kHz" if who.trace_rate else "none"),
        ("turntable", f"{360 / who.microsteps:.4g} degrees a microstep" if who.microsteps else "not stated"),
        ("temperature", "no thermometer" if who.temperature_c is None else f"{who.temperature_c:.1f} °C"),
        (
            "link",
            f"{link.frames_received} frames, {link.missing_frames} missing, {link.rejected_blocks} rejected, "
            f"{link.repeated_commands} commands repeated",
        ),
    ]
