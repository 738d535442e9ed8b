"""Checks of commands that every device makes. A command that fails one is answered with a refusal."""

from sonarhw.wire.codes import Approach, Refusal, TraceKind, Wiring
from sonarhw.wire.limits import KEPT_READINGS, MAX_ECHOES, MAX_TEST, MAX_TESTED, MOST_READINGS
from sonarhw.wire.messages import Configure, ConfigureTurntable, ConfigureWiring, Resend, SetBaud, StartScan, TestLink


class RefusalError(Exception):
    """The current command must be answered with a refusal."""

    def __init__(self, code: Refusal, text: str) -> None:
        super().__init__(text)
        self.code, self.text = code, text


def check_settings(request: Configure) -> None:
    """Raise RefusalError for ping settings that are invalid for every device."""
    if request.trace not in [*TraceKind]:
        raise _out_of_range(f"trace is {request.trace}; expected 0, 1 or 2")
    if request.trace_bits not in (0, 8, 16):
        raise _out_of_range(f"trace_bits is {request.trace_bits}; expected 0, 8 or 16")
    if not 1 <= request.echoes <= MAX_ECHOES:
        raise _out_of_range(f"echoes is {request.echoes}; expected 1 to {MAX_ECHOES}")
    if request.listen_us == 0:
        raise _out_of_range("listen_us is 0; expected a time after blanking_us")
    if request.speed_of_sound == 0:
        raise _out_of_range("speed_of_sound is 0; expected mm/s above 0")


def check_turntable(request: ConfigureTurntable) -> None:
    """Raise RefusalError for an unknown side of approach."""
    if request.approach not in [*Approach]:
        raise _out_of_range(f"approach is {request.approach}; expected 0, 1 or 2")


def check_wiring(request: ConfigureWiring) -> None:
    """Raise RefusalError for unknown parts, and for inverted ones that do not change."""
    if request.change > sum(Wiring) or request.inverted & ~request.change:
        given = f"change {request.change}, inverted {request.inverted}"
        raise _out_of_range(f"{given}; expected 0 to 15, and none beyond change")


def check_resend(request: Resend) -> None:
    """Raise RefusalError for more readings than a device keeps, or none."""
    if not 1 <= request.count <= KEPT_READINGS:
        raise _out_of_range(f"{request.count} readings; expected 1 to {KEPT_READINGS}")


def check_baud(request: SetBaud, bauds: tuple[int, ...]) -> None:
    """Raise RefusalError for a baud rate that the line does not have."""
    if request.baud not in bauds:
        reason = f"expected {', '.join(map(str, bauds))}" if bauds else "the line has no baud rate"
        raise _out_of_range(f"{request.baud} baud; {reason}")


def check_test(request: TestLink) -> None:
    """Raise RefusalError for a test of the line that is too long or empty."""
    if not 1 <= len(request.data) <= MAX_TEST or request.size > MAX_TESTED:
        text = f"data of {len(request.data)} bytes, size {request.size}; expected 1 to {MAX_TEST} bytes"
        raise _out_of_range(f"{text}, and a size of at most {MAX_TESTED}")


def readings_to_make(order: StartScan, total: int) -> int:
    """Return the number of readings that a command requests of a scan of `total`. Raises RefusalError."""
    if total > MOST_READINGS:
        raise _out_of_range(f"{total} readings; expected at most {MOST_READINGS}")
    if total and order.first >= total:
        raise _out_of_range(f"first is {order.first}; expected 0 to {total - 1}")
    most = total - order.first
    if order.count > most:
        raise _out_of_range(f"count is {order.count}; expected 0 to {most}")
    return order.count or most


def _out_of_range(text: str) -> RefusalError:
    return RefusalError(Refusal.OUT_OF_RANGE, text)
