"""`sonarhw serve`: scan, and publish the readings to viewers while they are measured."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sonarhw.errors import InputError, counted
from sonarhw_cli.console.connect import RECONNECT, Reconnect, ScannerUrl, board_of, connect
from sonarhw_cli.console.interruption import Interruption, interruption
from sonarhw_cli.console.lines import print_line, print_note, warn
from sonarhw_cli.console.options import (
    LOG,
    BoardOfScanner,
    Force,
    FromAngle,
    MaxRange,
    PingsPerHeading,
    PlaceName,
    RoomToStore,
    StepAngle,
    TemperatureInRoom,
    ToAngle,
    ZeroHere,
    order_in_degrees,
    warn_of_radians,
)
from sonarhw_cli.console.output import checked_out
from sonarhw_cli.instrument.scan_request import (
    ScanRequest,
    check_request,
    log_metadata,
    refuse_orders,
    room_and_place,
    scan_plan,
)

if TYPE_CHECKING:
    from sonarhw_sim.board.profile import Board
    from sonarhw_sim.rays.paths import Paths
    from sonarhw_sim.room.room import Place, Room

    from sonarhw.export import FoxgloveServer
    from sonarhw.host.scanner import ConnectedScanner, ScanPlan
    from sonarhw.log import LogMetadata
    from sonarhw.readings import Reading, ScanOrder

_MOST_SWEEPS = 65535  # largest number that fits into the scan command
_ADDRESS = "127.0.0.1:8765"  # the port that Foxglove suggests


OnFoxglove = Annotated[
    bool, typer.Option("--foxglove", help="Publish on the WebSocket of Foxglove; needs the extra foxglove.")
]
FoxgloveAddress = Annotated[
    str, typer.Option("--tcp", help="Address to listen on; port 0 selects a free port.", metavar="HOST:PORT")
]
SweepsServed = Annotated[
    int | None, typer.Option(help="Number of sweeps; default: until Ctrl-C.", min=1, max=_MOST_SWEEPS)
]


def serve(
    context: typer.Context,
    url: ScannerUrl,
    foxglove: OnFoxglove = False,
    tcp: FoxgloveAddress = _ADDRESS,
    out: Annotated[Path | None, typer.Option(help="Also write a log; needs --sweeps.", metavar="LOG.mcap")] = None,
    room: RoomToStore = None,
    place: PlaceName = None,
    board: BoardOfScanner = None,
    start: FromAngle = 0.0,
    stop: ToAngle = 360.0,
    step: StepAngle = 5.0,
    sweeps: SweepsServed = None,
    pings: PingsPerHeading = 1,
    max_range: MaxRange = None,
    temperature: TemperatureInRoom = None,
    traces: Annotated[bool, typer.Option("--traces", help="Publish the receive signal of every ping.")] = False,
    zero_here: ZeroHere = False,
    reconnect: Reconnect = RECONNECT,
    force: Force = False,
) -> None:
    """Scan until Ctrl-C, and publish the readings for other programs. The first line of standard output is the address.

    The topics are those of a log: /readings, /traces, and /scan with each whole sweep. With --room, /prediction has the
    predicted ranges beside each /scan.
    """
    from sonarhw.export import FoxgloveServer
    from sonarhw.plugins.device_plugin import takes_orders

    if not foxglove:
        raise InputError("give --foxglove: it is the only protocol that is served")
    if out is not None:
        checked_out(out, (LOG,), force, url, room, board)
        if sweeps is None:
            raise InputError("--out: give the number of sweeps, too: --sweeps N")
    if not takes_orders(url):
        refuse_orders(context)
    order = order_in_degrees(start, stop, step, sweeps or _sweeps(start, stop, step, pings), pings)
    warn_of_radians(start, stop)
    request = ScanRequest(order, board, max_range, temperature, traces, False, zero_here, not takes_orders(url))
    check_request(request)
    where = room_and_place(room, place, out)
    with FoxgloveServer(tcp) as server:
        print_line(server.url)
        with connect(url, reconnect) as scanner:
            profile = board_of(scanner, board)
            plan = scan_plan(scanner, request, profile, where[0].air if where else None)
            # a replay and a device that turns by itself have another number of readings than the order
            known = order if scanner.info.capabilities else None
            publisher = _Publisher(server, known, _Prediction(*where, profile) if where else None)
            metadata = replace(log_metadata(room, where), board=profile.name, board_text=profile.text)
            try:
                _scan(scanner, plan, publisher, metadata, out, force)
            finally:
                publisher.end()
                kept = f", in {out}" if out and publisher.count else ""
                print_note(f"{counted(publisher.count, 'reading')} published{kept}")


def _sweeps(start: float, stop: float, step: float, pings: int) -> int:
    """Return the largest number of sweeps."""
    from sonarhw.wire.messages import MOST_READINGS

    return max(1, min(_MOST_SWEEPS, MOST_READINGS // order_in_degrees(start, stop, step, 1, pings).readings))


def _scan(
    scanner: "ConnectedScanner",
    plan: "ScanPlan",
    publisher: "_Publisher",
    metadata: "LogMetadata",
    out: Path | None,
    force: bool,
) -> None:
    from sonarhw.host.scanner import record_scan, run_scan
    from sonarhw.log import LogWriter

    with interruption(scanner.stop) as publisher.interrupted:
        if out is None:
            run_scan(scanner, plan, publisher)
        else:
            record_scan(scanner, plan, LogWriter(out, metadata, overwrite=force, warn=warn), publisher)


class _Prediction:
    """Predicts the ranges of readings. The paths to the place are followed once."""

    def __init__(self, room: "Room", place: "Place", board: "Board") -> None:
        self._room, self._place, self._board = room, place, board
        self._paths: Paths | None = None

    def ranges(self, readings: "Sequence[Reading]") -> list[float | None]:
        """Return the predicted range at the heading of each reading, m; None: no echo."""
        from sonarhw_compare.match import headings_of
        from sonarhw_sim.predict.prediction import predict_scan

        headings = headings_of(readings, self._place, self._board)
        prediction = predict_scan(self._room, self._place, self._board, headings, paths=self._paths)
        self._paths = prediction.paths
        return [None if math.isnan(distance) else distance for distance in prediction.ranges.tolist()]


class _Publisher:
    """Receives the progress of a scan and publishes it. Counts the readings."""

    def __init__(self, server: "FoxgloveServer", order: "ScanOrder | None", prediction: _Prediction | None) -> None:
        """`order` is None if the scan may have another number of readings."""
        from sonarhw.log.writer import OpenSweeps

        self.count = 0
        self.interrupted: Interruption
        self._server = server
        self._of_each = None if order is None else order.headings * order.pings
        self._prediction = prediction
        self._sweeps = OpenSweeps()

    @property
    def stop_wanted(self) -> bool:
        return self.interrupted.wanted

    def homed(self) -> None:
        """Do nothing: the first reading follows."""

    def reading(self, reading: "Reading") -> None:
        self.count += 1
        self._server.reading(reading)
        for sweep in self._sweeps.add(reading, self._of_each):
            self._publish(sweep)

    def warn(self, message: str) -> None:
        warn(message)

    def end(self) -> None:
        """Publish the last sweep, which may be incomplete."""
        for sweep in self._sweeps.end():
            self._publish(sweep)

    def _publish(self, sweep: "list[Reading]") -> None:
        self._server.sweep(sweep, None if self._prediction is None else self._prediction.ranges(sweep))
