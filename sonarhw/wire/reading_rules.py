"""Rules of firmware_protocol.md that the host can check, because it has sent the order and the settings.

Each function returns a clause that names the broken rule, or None. Damaged frames never get here: the CRC rejects them.
So a broken rule is an error in the firmware.
"""

from itertools import pairwise

from sonarhw.wire.messages import Configure, ReadingMessage, Settings, Started, StartScan

_TURN = 360_000_000  # µdeg
_COARSEST = 200  # microsteps per turn; assumed if the device does not report its microsteps
_ROUNDING = 1_000  # ns; the settings are in µs


def readings_requested(order: StartScan) -> int:
    """Return the number of readings that a StartScan requests."""
    return order.count or max(0, order.headings * order.sweeps * order.pings - order.first)


def broken_start_rule(order: StartScan, answer: Started) -> str | None:
    """Return how the answer to a StartScan breaks the protocol; None if it does not."""
    expected = readings_requested(order)
    if (answer.readings, answer.first) == (expected, order.first):
        return None
    return (
        f"Started announces {answer.readings} readings from number {answer.first}; "
        f"StartScan requested {expected} from number {order.first}"
    )


def broken_settings_rule(request: Configure, answer: Settings) -> str | None:
    """Return how the answer to a Configure breaks the protocol; None if it does not."""
    if answer.speed_of_sound == 0:
        return "Settings contains a speed_of_sound of 0; expected the requested one"
    if answer.speed_of_sound != request.speed_of_sound:
        return f"Settings contains speed_of_sound {answer.speed_of_sound}; {request.speed_of_sound} was requested"
    if answer.listen_us == 0 or answer.listen_us > request.listen_us:
        return f"Settings contains listen_us {answer.listen_us}; expected 1 to {request.listen_us}, as requested"
    return None


def broken_reading_rule(
    reading: ReadingMessage, order: StartScan, settings: Settings | None, microsteps: int
) -> str | None:
    """Return how a reading of the scan `order` breaks the protocol; None if it does not.

    `microsteps` per turn round its angle; 0: unknown.
    """
    broken = _broken_place(reading, order, microsteps) or _broken_order(reading.echoes)
    if broken is None and settings is not None:
        broken = _broken_window(reading.echoes, settings)
    return f"reading {reading.number}: {broken}" if broken else None


def _broken_place(reading: ReadingMessage, order: StartScan, microsteps: int) -> str | None:
    heading, ping = divmod(reading.number, order.pings)
    sweep, index = divmod(heading, order.headings)
    if (reading.sweep, reading.ping) != (sweep, ping):
        return f"sweep {reading.sweep}, ping {reading.ping}; its number means sweep {sweep}, ping {ping}"
    angle = order.start + order.step * (order.headings - 1 - index if sweep % 2 else index)
    if not order.in_place and abs(reading.angle - angle) > _TURN / (microsteps or _COARSEST):
        return f"angle {reading.angle / 1e6:g} degrees; its number means {angle / 1e6:g} degrees"
    return None


def _broken_order(echoes: tuple[int, ...]) -> str | None:
    for earlier, later in pairwise(echoes):
        if later < earlier:
            return f"an echo at {earlier / 1e6:g} ms is before one at {later / 1e6:g} ms; the earliest must be first"
    return None


def _broken_window(echoes: tuple[int, ...], settings: Settings) -> str | None:
    if len(echoes) > settings.echoes:
        return f"{len(echoes)} echoes; Settings allows {settings.echoes}"
    if echoes and echoes[0] < settings.blanking_us * 1000 - _ROUNDING:
        return f"an echo at {echoes[0] / 1e6:g} ms, before the end of blanking at {settings.blanking_us / 1000:g} ms"
    if echoes and echoes[-1] > settings.listen_us * 1000 + _ROUNDING:
        return f"an echo at {echoes[-1] / 1e6:g} ms, after the end of listening at {settings.listen_us / 1000:g} ms"
    return None
