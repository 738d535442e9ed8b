"""What `sonarhw scan` and `sonarhw serve` have in common: the request, its checks, the plan and the log's metadata."""

import math
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from sonarhw.errors import InputError
from sonarhw_cli.console.lines import print_detail, warn
from sonarhw_cli.console.options import check_scan_values, refuse_given
from sonarhw_cli.console.output import standard_output
from sonarhw_cli.console.room_input import chosen_place, open_room

if TYPE_CHECKING:
    from sonarhw_sim.air import Air
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.room.room import Place, Room

    from sonarhw.host.scanner import ConnectedScanner, ScanPlan
    from sonarhw.log import LogMetadata
    from sonarhw.readings import ScanOrder


# options that a device which turns by itself cannot obey, by parameter
_ORDERS = {
    "start": "--from",
    "stop": "--to",
    "step": "--step",
    "pings": "--pings",
    "traces": "--traces",
    "zero_here": "--zero-here",
}


@dataclass(frozen=True)
class ScanRequest:
    """The options of a scan."""

    order: "ScanOrder"
    board: str | None
    max_range: float | None  # m
    temperature: float | None  # °C
    traces: bool
    show: bool
    zero_here: bool
    turns_by_itself: bool  # the device takes no order, and the number of its readings is unknown


def refuse_orders(context: typer.Context) -> None:
    """Raise InputError for an option that a device cannot obey which turns and measures by itself."""
    reason = "this device turns and measures by itself; remove the option, and end the scan with --sweeps N"
    refuse_given(context, _ORDERS, reason)


def check_request(request: ScanRequest) -> None:
    """Raise InputError for an impossible option. The scanner checks the limits of the turntable."""
    _check_order(request.order)
    if request.show:
        standard_output()
    check_scan_values(request.board, request.max_range, request.temperature)


def _check_order(order: "ScanOrder") -> None:
    """Raise InputError for an order that does not fit into a frame."""
    from sonarhw.wire.messages import MOST_READINGS, microdegrees_of

    if microdegrees_of(order.step) == 0:
        raise InputError(f"--step {math.degrees(order.step):g}: too fine; expected 0.000001 degrees or more")
    if order.readings > MOST_READINGS:
        raise InputError(
            f"--sweeps {order.sweeps}, --pings {order.pings}: {order.readings} readings of {order.headings} headings, "
            f"at most {MOST_READINGS} are possible; reduce one of them"
        )


def room_and_place(room_name: str | None, place: str | None, out: Path | None) -> "tuple[Room, Place] | None":
    """Return the room and the place of --room and --place; None without a room. Raises InputError."""
    if room_name is None:
        if place is not None:
            raise InputError("--place needs --room: it is a place of a room file")
        return None
    room = open_room(room_name)
    if place is None and len(room.places) != 1:
        raise InputError(
            f"--room {room_name}: give --place NAME or --place X,Y in metres; its places: "
            f"{', '.join(room.places) or 'none'}; from an unknown place, scan without --room, "
            f"then run `sonarhw locate {out or 'LOG.mcap'} --room {room_name}`"
        )
    return room, chosen_place(room, place)


def log_metadata(room_name: str | None, where: "tuple[Room, Place] | None") -> "LogMetadata":
    """Return the metadata of a log that begins now, with the room of `room_and_place`."""
    from sonarhw_sim.files import file_name

    from sonarhw.log import LogMetadata

    metadata = LogMetadata(made_by="scan", started=time.time())
    if room_name is None or where is None:
        return metadata
    room, here = where
    return replace(metadata, room_file=file_name(room_name), room_text=room.text, place=here.name)


def scan_plan(scanner: "ConnectedScanner", request: ScanRequest, board: "Board", room_air: "Air | None") -> "ScanPlan":
    """Return the plan of the scan, with warnings about what this scanner and board cannot do."""
    from sonarhw_sim.air import Air

    from sonarhw.host.scanner import ScanPlan
    from sonarhw.readings import ScanAir

    air = room_air or Air()
    if request.max_range is not None and request.max_range > board.max_range:
        warn(
            f"--max-range {request.max_range:g}: board {board.name!r} detects echoes to {board.max_range:g} m; "
            f"each ping now takes at least {2 * request.max_range / air.speed_of_sound:.2g} s"
        )
    if request.traces and not scanner.info.trace_rate:
        warn(f"{scanner.url}: the scanner sends no traces; only echo times are recorded")
    plan = ScanPlan(
        request.order,
        reach=board.max_range if request.max_range is None else request.max_range,
        blanking=board.blanking_end,
        air=ScanAir(air.speed_at, air.temperature_c, request.temperature),
        traces=request.traces,
        zero_here=request.zero_here,
    )
    print_detail(f"board {board.name!r}; speed of sound {plan.air.speed_of_sound(scanner.info.temperature_c):.2f} m/s")
    return plan
