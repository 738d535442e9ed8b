"""`sonarhw replay`: a log as a live scanner, on a pseudo-terminal or a TCP port."""

import math
from typing import Annotated

import typer

from sonarhw.errors import InputError
from sonarhw_cli.console.log_input import LogFile, open_log
from sonarhw_cli.console.options import PtyLink, TcpAddress, check_one_line


def replay(
    log: LogFile,
    speed: Annotated[
        float, typer.Option(help="Times faster than recorded; inf: as fast as the client reads.", metavar="F")
    ] = 1.0,
    loop: Annotated[bool, typer.Option("--loop", help="Start over until the scan ordered is full.")] = False,
    pty: PtyLink = None,
    tcp: TcpAddress = None,
) -> None:
    """Serve a log as a live scanner, which plays at each scan command; the first line of output is its URL."""
    from sonarhw.device.endpoint import Endpoint, open_server_port
    from sonarhw.replay.replayed_log import ReplayDevice
    from sonarhw_cli.console.interruption import sigterm_raises

    check_one_line(pty, tcp)
    if not speed > 0:
        raise InputError(f"--speed {speed:g}: expected a factor above 0, such as 2, or inf")
    recorded = open_log(log)
    if not recorded.readings:
        raise InputError(f"{log}: holds no readings; there is nothing to replay")
    # without a limit the device's own time is skipped, so that the recorded spacing stays in the readings
    at_once = math.isinf(speed)
    device = ReplayDevice(recorded, 1.0 if at_once else speed, loop)
    with sigterm_raises(SystemExit), open_server_port(pty, tcp) as port:
        endpoint = Endpoint(device, port, "max" if at_once else "real")
        typer.echo(port.url)
        endpoint.run()
