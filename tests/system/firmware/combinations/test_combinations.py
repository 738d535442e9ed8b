"""Every image that is offered, on the emulated board with its ranging board and turntable, in the demo room."""

import math

import numpy as np
import pytest
from sonarhw_compare.scanner_url import DEMO_PLACE, DEMO_ROOM
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.room_echoes import RoomEchoes
from sonarhw_sim.room.room import load_room

from sonarhw import sector
from sonarhw.errors import DeviceError
from sonarhw.host.scanner import DeviceInfo
from sonarhw.readings import Ping, PingResult
from sonarhw.wire.messages import Feature, ResetCause
from tests.system.firmware.combinations.images import FREE_STACK, MEGA, budgets, combinations, vector
from tests.system.firmware.conftest import Echoes, scanner_on

PROGRAMS = combinations("PROGRAMS")  # of Linux
OTHERS = [name for name in combinations() + PROGRAMS if name != MEGA]  # the first one has test_emulated_board.py
TWO_TICKS = 1e-6  # s
STEP = {"step-dir": 360 / 7200, "28byj": 360 / 4096, "servo": 360 / 8000}  # degrees
REACH = {"step-dir": 720, "28byj": 360, "servo": 90}  # degrees
BLANKING = {"polaroid": 0.00238, "hc-sr04": 0.000116}  # s
START_KNOWN = 10e-6 + 1e-6  # s; half of FIRES_WITHIN_NS in linux/ranging/polaroid.c, and two ticks
REARM = 0.0006  # s; so long that the interrupt of the board never loses an echo


class Heard:
    """The echoes of the demo room, and what each ping was answered."""

    temperature_c = 21.3

    def __init__(self, board: str) -> None:
        room = load_room(DEMO_ROOM)
        self._echoes = RoomEchoes(room, room.place(DEMO_PLACE), load_board(board), seed=1)
        self._echoes.prepare()
        self.pings: list[tuple[float, tuple[float, ...]]] = []  # degrees, s

    def receive(self, ping: Ping) -> PingResult:
        """Return the echoes of the room."""
        result = self._echoes.receive(ping)
        self.pings.append((math.degrees(ping.angle), tuple(result.echo_times)))
        return result


def parts(combination: str) -> tuple[str, str]:
    """Return the ranging board and the turntable of a combination."""
    ranging = "hc-sr04" if "-hc-sr04-" in combination else "polaroid"
    return ranging, combination.split(f"-{ranging}-")[1]


def detected(times: tuple[float, ...], ranging: str) -> list[float]:
    """Return the echoes that a ranging board detects of those that arrive: an HC-SR04 the first, a 6500 after rests."""
    if ranging == "hc-sr04":
        return [time for time in times[:1] if BLANKING[ranging] <= time < 0.030]
    found: list[float] = []
    for time in times:
        if time >= (found[-1] + REARM if found else BLANKING[ranging]):
            found.append(time)
    return found[:16]


def check_capabilities(info: DeviceInfo, combination: str) -> None:
    """Check that a host learns what the board can from its messages alone."""
    ranging, turning = parts(combination)
    able = info.capabilities
    assert info.firmware == f"sonarhw-{combination.split('-')[0]} 0.1.0"
    assert info.board == {"polaroid": "polaroid-6500", "hc-sr04": "hc-sr04"}[ranging]
    assert able.highest_angle == -able.lowest_angle == pytest.approx(math.radians(REACH[turning]))
    marked = Feature.HOME_MARK | Feature.LOST_STEPS
    assert able.features & marked == (marked if turning == "step-dir" else Feature(0))
    several = Feature.BLANKING | Feature.REARM
    assert able.features & several == (several if ranging == "polaroid" else Feature(0))
    assert not able.features & (Feature.ENVELOPE | Feature.CARRIER)
    assert (info.trace_rate, able.fastest_trace) == (0, 0)


@pytest.mark.parametrize("combination", OTHERS)
def test_a_scan_of_the_demo_room_is_right(combination: str) -> None:
    ranging, turning = parts(combination)
    echoes = Heard({"polaroid": "polaroid-6500", "hc-sr04": "hc-sr04"}[ranging])
    with scanner_on(echoes, combination=combination, start_deg=0 if turning == "28byj" else 20) as (board, scanner):
        settings = scanner.configure(trace=True, rearm=REARM)
        assert (settings.trace, settings.trace_rate) == (False, 0)  # replaced, as the protocol demands
        scanner.home(here=turning == "28byj")
        found = sorted(scanner.scan(sector(-75, 80, 18.75)), key=lambda reading: reading.number)
        statistics = scanner.device_statistics()
        longest = board.longest_interrupts()
        check_capabilities(scanner.info, combination)
    assert [reading.number for reading in found] == [*range(9)]
    # a reading that was lost on its way may have been measured again
    heard = {round(heading, 2): (heading, arrived) for heading, arrived in echoes.pings}
    for reading, (heading, arrived) in zip(found, (heard[at] for at in sorted(heard)), strict=True):
        wanted = -75 + 18.75 * reading.number
        assert math.degrees(reading.angle) == pytest.approx(wanted, abs=STEP[turning] / 2 + 1e-6)
        # where the table really was; the play of the 28BYJ-48 is taken up counter-clockwise
        offset = -30 * STEP["28byj"] if turning == "28byj" else 0
        assert heading - offset == pytest.approx(math.degrees(reading.angle), abs=0.01)
        expected = detected(arrived, ranging)
        assert reading.echo_times == pytest.approx(expected, rel=0, abs=TWO_TICKS)
    assert sum(bool(reading.echo_times) for reading in found) >= 6
    assert np.diff(sorted(reading.time for reading in found)).min() >= 0.0999
    assert (statistics.reset_cause, statistics.lost_steps) == (ResetCause.POWER, 0)
    assert statistics.stack_free >= FREE_STACK or combination in PROGRAMS
    for (handler, _), cycles in budgets(combination).items():
        assert longest[vector(combination, handler)] <= cycles, handler


def test_delays_by_other_programs_change_no_range_and_lose_no_steps() -> None:
    echoes = Echoes(0.005, 0.0201234)
    options = {"combination": "linux-polaroid-step-dir", "start_deg": 40, "stall": 0.0005}
    with scanner_on(echoes, **options) as (_, scanner):
        scanner.configure(listen=0.022)
        scanner.home()
        scanner.turn(math.radians(-300))
        scanner.home()  # at full speed
        readings = [*scanner.scan(sector(-75, 80, 18.75, pings=5))]
        assert scanner.device_statistics().lost_steps == 0
    assert [reading.number for reading in readings] == [*range(45)]
    aimed = {-75 + 18.75 * index for index in range(9)}
    assert all(min(abs(math.degrees(ping.angle) - heading) for heading in aimed) < 0.3 for ping in echoes.pings)
    for reading in readings:
        # a delay can hide the second echo, but not move an echo
        assert all(min(abs(time - echo) for echo in (0.005, 0.0201234)) < START_KNOWN for time in reading.echo_times)
    assert sum(len(reading.echo_times) == 2 for reading in readings) >= 37


def test_a_turntable_without_a_mark_refuses_home_and_says_what_to_do() -> None:
    with scanner_on(Echoes(0.020), combination="uno-hc-sr04-28byj") as (_, scanner):
        with pytest.raises(DeviceError, match="turn it to zero by hand and send SetZero"):
            scanner.home()
        scanner.home(here=True)


def test_a_servo_refuses_a_zero_by_hand_and_angles_beyond_its_range() -> None:
    echoes = Echoes(0.020)
    with scanner_on(echoes, combination="uno-hc-sr04-servo", start_deg=-80) as (_, scanner):
        with pytest.raises(DeviceError, match="the zero of a servo cannot be set; send Home"):
            scanner.home(here=True)
        scanner.home()
        with pytest.raises(DeviceError, match="from -90 to 90 degrees"):
            scanner.turn(math.radians(91))
        list(scanner.scan(sector(-90, 91, 90)))
    assert np.degrees([ping.angle for ping in echoes.pings]) == pytest.approx([-90, 0, 90], abs=1e-6)


def test_an_hc_sr04_without_an_echo_or_beyond_its_range_gives_no_range() -> None:
    for times in ((), (0.0305,)):
        with scanner_on(Echoes(*times), combination="uno-hc-sr04-servo") as (_, scanner):
            readings = list(scanner.scan(sector(0, 10, 5)))
        assert [reading.echo_times for reading in readings] == [()] * 2
