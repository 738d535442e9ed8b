"""`sonarhw info`: print identity, capabilities and link quality of a scanner."""

import math
import time
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sonarhw.errors import CommandRefused, InputError, counted
from sonarhw_cli.console.connect import ScannerUrl, connect
from sonarhw_cli.console.lines import print_json, print_line
from sonarhw_cli.console.options import AsJson

if TYPE_CHECKING:
    from sonarhw.host.scanner import ConnectedScanner, DeviceCapabilities, DeviceInfo, Scanner
    from sonarhw.link import LinkStatistics
    from sonarhw.wire.messages import Statistics

_EXCHANGES = 20  # commands sent for the link statistics


Watch = Annotated[bool, typer.Option("--watch", help="Also print the link statistics once a second, until Ctrl-C.")]


def info(
    url: ScannerUrl,
    watch: Watch = False,
    as_json: AsJson = False,
) -> None:
    """Print identity, capabilities and link quality of a scanner."""
    from sonarhw.host.scanner import Scanner
    from sonarhw.plugins.plugin_scanner import PluginScanner

    if watch and as_json:
        raise InputError("--watch, --json: give only one of them")
    with connect(url) as scanner:
        device = _exercise_link(scanner) if isinstance(scanner, Scanner) else None
        if as_json:
            print_json(_figures(scanner, device))
            return
        facts = [*_identity(scanner.info), *_capabilities(scanner.info), *_link(scanner, device)]
        if isinstance(scanner, PluginScanner):
            ignored = ", ".join(f"{kind} ({count})" for kind, count in scanner.ignored.items())
            facts.append(("ignored", ignored or "nothing"))
        for name, value in facts:
            print_line(f"{name:<14}{value}")
        while watch:
            time.sleep(1.0)
            device = _device_statistics(scanner) if isinstance(scanner, Scanner) else None
            clock = f"; clock drift {scanner.clock_drift * 1e6:+.0f} ppm"
            print_line(f"{scanner.state:<14}{_host_counts(scanner.statistics)}{_device_counts(device)}{clock}")


def _exercise_link(scanner: "Scanner") -> "Statistics | None":
    device = None
    for _ in range(_EXCHANGES):
        device = _device_statistics(scanner)
        if device is None:
            scanner.stop()  # older firmware answers this command
    return device


def _device_statistics(scanner: "Scanner") -> "Statistics | None":
    if scanner.info.protocol < (1, 1):
        return None
    try:
        return scanner.device_statistics()
    except CommandRefused:
        return None


def _figures(scanner: "ConnectedScanner", device: "Statistics | None") -> dict[str, Any]:
    """Return the scanner under the keys of `info --json`; angles in degrees, None for what it does not state."""
    from sonarhw.wire.messages import origin_of

    info, can = scanner.info, scanner.info.capabilities
    return {
        "url": scanner.url,
        "origin": origin_of("scan", info.firmware, info.serial),
        "firmware": info.firmware,
        "protocol": _protocol(info),
        "serial": info.serial or None,
        "starts": info.boot or None,
        "board": info.board or None,
        "trace_rate_hz": info.trace_rate or None,
        "microsteps": info.microsteps or None,
        "temperature_c": info.temperature_c,
        "capabilities": None
        if can is None
        else {
            "features": _features(can),
            "lowest_angle_deg": round(math.degrees(can.lowest_angle), 6),
            "highest_angle_deg": round(math.degrees(can.highest_angle), 6),
            "fastest_deg_s": round(math.degrees(can.fastest), 6),
            "longest_listen_s": round(can.longest_listen, 6),
            "ping_period_s": round(can.ping_period, 6),
            "fastest_baud": can.fastest_baud or None,
            "turning": can.turning or None,
        },
        "baud": scanner.baud,
        "link": asdict(scanner.statistics),
        "device": None
        if device is None
        else {"frames": device.frames, "rejected": device.rejected, "overruns": device.overruns},
    }


def _protocol(device: "DeviceInfo") -> str | None:
    """Return the version of the wire protocol; None for a device that does not speak it."""
    return f"{device.protocol[0]}.{device.protocol[1]}" if device.protocol[0] else None


def _features(can: "DeviceCapabilities") -> list[str]:
    from sonarhw.wire.messages import Feature

    return [(feature.name or "").lower().replace("_", " ") for feature in Feature if feature in can.features]


def _identity(device: "DeviceInfo") -> list[tuple[str, str]]:
    return [
        ("firmware", device.firmware),
        ("protocol", _protocol(device) or "none; it prints readings"),
        ("serial", device.serial or "none"),
        ("started", counted(device.boot, "time") if device.boot else "not counted"),
        ("board", device.board or "not stated"),
        ("traces", f"{device.trace_rate / 1000:g} kHz" if device.trace_rate else "none"),
        ("turntable", f"{360 / device.microsteps:.4g} degrees a microstep" if device.microsteps else "not stated"),
        ("temperature", "no thermometer" if device.temperature_c is None else f"{device.temperature_c:.1f} °C"),
    ]


def _capabilities(device: "DeviceInfo") -> list[tuple[str, str]]:
    can = device.capabilities
    if can is None:
        return [("capabilities", "not stated")]
    low, high = math.degrees(can.lowest_angle), math.degrees(can.highest_angle)
    return [
        ("capabilities", ", ".join(_features(can)) or "none"),
        ("turned by", can.turning or "not stated"),
        ("turns", f"{low:.6g} to {high:.6g} degrees, at most {math.degrees(can.fastest):.4g} degrees a second"),
        ("listens", f"{can.longest_listen * 1000:.4g} ms, a ping every {can.ping_period * 1000:.4g} ms"),
        ("line", f"up to {can.fastest_baud} baud" if can.fastest_baud else "no baud rate"),
    ]


def _link(scanner: "ConnectedScanner", device: "Statistics | None") -> list[tuple[str, str]]:
    can = scanner.info.capabilities
    speed = f", {scanner.baud} baud" if scanner.baud and can and can.fastest_baud else ""
    return [("link", f"{_host_counts(scanner.statistics)}{speed}{_device_counts(device)}")]


def _host_counts(link: "LinkStatistics") -> str:
    trip = "" if link.round_trip is None else f", round trip {link.round_trip * 1000:.1f} ms"
    return (
        f"{link.frames_received} frames, {link.missing_frames} missing, {link.rejected_blocks} rejected, "
        f"{link.repeated_commands} commands repeated, lost {counted(link.losses, 'time')}{trip}"
    )


def _device_counts(device: "Statistics | None") -> str:
    if device is None:
        return ""
    return f"; the scanner: {device.frames} frames, {device.rejected} rejected, {device.overruns} bytes overrun"
