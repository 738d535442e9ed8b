"""Wiring faults of a scanner, and the wires of a fake board that has them."""

import math
from dataclasses import replace
from enum import IntFlag

from sonarhw.device.turntable import Turntable, marked
from sonarhw.echo_source import PingResult
from sonarhw.errors import InputError
from sonarhw.readings import Trace
from sonarhw.wire.codes import Input, Wiring
from sonarhw.wire.units import centidegrees_of

CAM_ANGLE = math.radians(-20.0)  # edge of the cam
ONE_SWITCH_MOST = math.radians(185)  # limit of one Home by the mark alone
ONE_SWITCH_UNPROVEN = math.radians(60)  # on each side, until a Home has succeeded with the present wiring
HOTTEST = 12_500  # 0.01 °C; measured with a shorted thermistor
NOISE_ECHO = 0.003  # s; time of the false echo of every ping with NOISE_ON_INIT

_BEGIN = "begin within 45 degrees of 0"


class WiringFault(IntFlag):
    """A wrong or broken wire, as in firmware/emulator/emulator.h. Open inputs are high, because of their pull-ups."""

    CAM_INVERTED = 1
    CAM_OPEN = 2
    MOTOR_REVERSED = 4
    MARK_OPEN = 8
    MARK_INVERTED = 16
    MOTOR_OPEN = 32  # the table does not turn
    ECHO_LOW = 64  # ECHO is never high: a broken wire, or no pull-up
    ECHO_HIGH = 128  # ECHO is always high
    NOISE_ON_INIT = 256  # every ping has an echo at NOISE_ECHO
    THERMISTOR_OPEN = 512
    THERMISTOR_SHORTED = 1024
    BLNK_OPEN = 2048  # the board detects one echo of each ping
    INIT_OPEN = 4096  # the board transmits nothing
    # of the emulated board only
    STEPS_DOUBLED = 8192  # a wrong jumper of the driver: the table turns twice as far
    SUPPLY_WEAK = 16384  # every ping restarts the chip
    LINE_NOISY = 32768  # some bytes from the board are damaged


_FAKE = [fault for fault in WiringFault if fault < WiringFault.STEPS_DOUBLED]
FAULT_NAMES = {str(fault.name).lower().replace("_", "-"): fault for fault in _FAKE}


def read_wiring_faults(text: str) -> WiringFault:
    """Return the faults in a text such as `cam-inverted/motor-reversed`. Raises InputError for an unknown fault."""
    faults = WiringFault(0)
    for name in text.split("/"):
        if name not in FAULT_NAMES:
            raise InputError(f"unknown wire fault {name!r}; expected one of {', '.join(FAULT_NAMES)}, joined with /")
        faults |= FAULT_NAMES[name]
    return faults


class Wires:
    """The wires between a fake board and its turntable, and the settings with which its firmware corrects them.

    They outlast a restart of the board.
    """

    def __init__(self, faults: WiringFault = WiringFault(0)) -> None:
        self.faults = faults
        self.inverted = Wiring(0)  # and ONE_SWITCH
        self.proven = False  # whether a Home has succeeded with these settings

    @property
    def one_switch(self) -> bool:
        """Whether the table homes by the mark alone."""
        return Wiring.ONE_SWITCH in self.inverted

    @property
    def sign(self) -> float:
        """Direction in which the table turns for a counter-clockwise command: 1 or, clockwise, -1."""
        return -1.0 if self._wrong(WiringFault.MOTOR_REVERSED, Wiring.MOTOR) else 1.0

    @property
    def mark_wrong(self) -> bool:
        """Whether the mark is low for the firmware where it should be high."""
        return self._wrong(WiringFault.MARK_INVERTED, Wiring.MARK)

    @property
    def motor_connected(self) -> bool:
        """Whether the table turns."""
        return not self.faults & WiringFault.MOTOR_OPEN

    def temperature(self, celsius: float | None) -> int:
        """Return what the board measures of an air temperature, in the unit of messages; None: no thermometer."""
        if self.faults & WiringFault.THERMISTOR_SHORTED:
            return HOTTEST
        return centidegrees_of(None if self.faults & WiringFault.THERMISTOR_OPEN else celsius)

    def arriving(self, result: PingResult) -> PingResult:
        """Return what arrives of a ping."""
        trace = result.trace
        if trace is not None and self.faults & WiringFault.INIT_OPEN:
            trace = Trace(0 * trace.samples, trace.rate, trace.start)
        return replace(result, echo_times=self._arriving_echoes(result.echo_times), trace=trace)

    def _arriving_echoes(self, times: tuple[float, ...]) -> tuple[float, ...]:
        if self.faults & (WiringFault.ECHO_LOW | WiringFault.ECHO_HIGH | WiringFault.INIT_OPEN):
            return ()
        arrived = (NOISE_ECHO, *times) if self.faults & WiringFault.NOISE_ON_INIT else times
        return arrived[:1] if self.faults & WiringFault.BLNK_OPEN else arrived

    def levels(self, turntable: Turntable, now: float) -> Input:
        """Return the inputs whose pins are high, while the board does not listen."""
        angle = turntable.true_angle(now)
        levels = Input(0)
        if marked(angle) != bool(self.faults & WiringFault.MARK_INVERTED) or self.faults & WiringFault.MARK_OPEN:
            levels |= Input.MARK
        if (angle > CAM_ANGLE) != bool(self.faults & WiringFault.CAM_INVERTED) or self.faults & WiringFault.CAM_OPEN:
            levels |= Input.CAM
        if self.faults & WiringFault.ECHO_HIGH:
            levels |= Input.ECHO
        return levels

    def homing_failure(self) -> str | None:
        """Return why a Home fails with these wires; None if it finds a zero."""
        cam = self._wrong(WiringFault.CAM_INVERTED, Wiring.CAM)
        if self.faults & WiringFault.MARK_OPEN:
            return "the zero mark never came; check its wire and the motor"
        if self.faults & WiringFault.CAM_OPEN or cam != (self.sign < 0):
            return "the cam never changed; check its wire and polarity, and the direction"
        # the mark is high at the edge of the cam, or the table passes the mark on its other side
        if self.mark_wrong or self.sign < 0:
            return "moved the wrong way; invert the mark, or cam and motor"
        return None

    def one_switch_zero(self, angle: float) -> tuple[float, str | None]:
        """Return the true angle of the zero that a Home by the mark alone finds from `angle`, and why it fails.

        A mark opposite to zero counts as a failure.
        """
        way = self.sign * (-1.0 if marked(angle) != self.mark_wrong else 1.0)
        edge = _next_edge(angle, way)
        most = ONE_SWITCH_MOST if self.proven else ONE_SWITCH_UNPROVEN
        if self.faults & WiringFault.MARK_OPEN or (
            abs(edge - angle) > most and (self.proven or abs(_next_edge(angle, -way) - angle) > most)
        ):
            return edge, f"the zero mark never came; check its wire and the motor; {_BEGIN}"
        if abs(edge - angle) > most or round(edge / math.pi) % 2:
            return edge, f"moved the wrong way; invert the mark or the motor; {_BEGIN}"
        return edge, None

    def _wrong(self, fault: WiringFault, setting: Wiring) -> bool:
        return bool(self.faults & fault) != bool(self.inverted & setting)


def _next_edge(angle: float, way: float) -> float:
    """Return the angle of the next edge of the mark in this direction, 1 or -1."""
    halves = (angle + 1e-9) / math.pi
    return math.pi * (math.ceil(halves) if way > 0 else math.floor(halves))
