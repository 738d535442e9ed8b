"""`sonarhw replay`: serve a log as a live scanner, on a pseudo-terminal or a TCP port."""

import math
from typing import Annotated

import typer

from sonarhw.errors import InputError
from sonarhw_cli.console.lines import print_line
from sonarhw_cli.console.log_input import LogFile, open_log
from sonarhw_cli.console.options import PtyLink, TcpAddress, check_one_line

Speed = Annotated[
    float, typer.Option(help="Factor on the recorded speed; inf: as fast as the client reads.", metavar="F")
]


def replay(
    log: LogFile,
    speed: Speed = 1.0,
    loop: Annotated[bool, typer.Option("--loop", help="Repeat the log until the requested scan is complete.")] = False,
    pty: PtyLink = None,
    tcp: TcpAddress = None,
) -> None:
    """Serve a log as a live scanner. Each scan command replays it. The first line of standard output is its URL."""
    from sonarhw.device.replayed_log import ReplayDevice
    from sonarhw.device.served import Endpoint, open_server_port
    from sonarhw_cli.console.interruption import sigterm_exits

    check_one_line(pty, tcp)
    if not speed > 0:
        raise InputError(f"--speed {speed:g}: expected a factor above 0, such as 2, or inf")
    recorded = open_log(log)
    if not recorded.readings:
        raise InputError(f"{log}: contains no readings; nothing to replay")
    # for inf the endpoint does not wait, and the readings keep their recorded times
    at_once = math.isinf(speed)
    device = ReplayDevice(recorded, 1.0 if at_once else speed, loop)
    with sigterm_exits(), open_server_port(pty, tcp) as port:
        endpoint = Endpoint(device, port, "max" if at_once else "real")
        print_line(port.url)
        endpoint.run()
