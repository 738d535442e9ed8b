"""`sonarhw fake`: serve a fake scanner on a pseudo-terminal or a TCP port."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated

import typer
from sonarhw_sim.air import DEFAULT_BOARD

from sonarhw_cli.console.interruption import sigterm_exits
from sonarhw_cli.console.lines import print_line
from sonarhw_cli.console.options import BoardName, PlaceName, PtyLink, RoomName, TcpAddress, check_one_line
from sonarhw_cli.console.room_input import chosen_place, open_room

Pace = Annotated[str, typer.Option(help="Real time, N times faster, or without waiting.", metavar="real|N|max")]
Faults = Annotated[
    str,
    typer.Option(help="Faults, such as drop=1/5000,reset@r20; see docs/devices/faults.md.", metavar="SPEC"),
]


def fake(
    room_name: RoomName,
    place: PlaceName = None,
    board: BoardName = DEFAULT_BOARD,
    pty: PtyLink = None,
    tcp: TcpAddress = None,
    seed: Annotated[int, typer.Option(help="Seed of all random values.", min=0)] = 0,
    pace: Pace = "real",
    faults: Faults = "",
) -> None:
    """Serve a fake scanner. The first line of standard output is its URL.

    --faults: drop, flip, insert=SHARE of the bytes; drift=PPM; protocol=0.9; miswire=WIRE; stall, deaf, mute, reset,
    nonsense, unplug, move=SECONDS; wedge=SECONDS, slip=MICROSTEPS of the turntable. Faults with SECONDS or MICROSTEPS
    start @SECONDS, @rPINGS or, repeatedly, @~SECONDS. After `move` the new URL is printed.
    """
    from sonarhw_compare.one_call import fake_device
    from sonarhw_sim.board.profile import load_board

    from sonarhw.device.faults import read_faults
    from sonarhw.device.served import Endpoint, host_and_port, open_server_port, read_pace

    check_one_line(pty, tcp)
    if tcp is not None:
        host_and_port(tcp)
    profile, room = load_board(board), open_room(room_name)
    here = chosen_place(room, place)
    chosen_pace, schedule = read_pace(pace), read_faults(faults)
    with sigterm_exits(), open_server_port(pty, tcp) as port:
        print_line(port.url)
        # clients can connect from now on, during the slow preparation
        device, echoes = fake_device(room, here, profile, seed, schedule)
        endpoint = Endpoint(device, port, chosen_pace, moved=print_line)
        with _prepared_meanwhile(echoes.prepare, endpoint.stop):
            endpoint.run()


@contextmanager
def _prepared_meanwhile(prepare: Callable[[], None], stop: Callable[[], None]) -> Iterator[None]:
    """Run `prepare` in a thread; if it fails, call `stop`, and raise its error at the end of the block."""
    failures: list[BaseException] = []

    def run() -> None:
        try:
            prepare()
        except BaseException as failure:  # noqa: BLE001 - raised again in the main thread
            failures.append(failure)
            stop()

    # a daemon thread, so that the process can end during a compilation
    threading.Thread(target=run, name="prepare", daemon=True).start()
    yield
    if failures:
        raise failures[0]
