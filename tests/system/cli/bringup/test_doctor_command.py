"""`sonarhw doctor`: every wiring fault fails the check that it belongs to, on the fake and on the emulated board."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from sonarhw import Scanner, bringup
from sonarhw.bringup import Diagnosis, Plate, examine
from sonarhw.device.emulated_board import EmulatedBoard, emulated_board
from sonarhw.device.fake_board import BoardIdentity, FakeBoard, Wires, WiringFault
from sonarhw.device.faults import FaultyDevice, read_faults
from sonarhw.device.served import serve
from sonarhw.readings import Ping, PingResult, Trace
from sonarhw.wire.messages import Wiring
from tests.fixtures.commands import sonarhw
from tests.fixtures.plain_echoes import DISTANCE, PLATE_DEG, HallEchoes

PLATE = Plate(math.radians(PLATE_DEG), DISTANCE)
MIRRORED = WiringFault.CAM_INVERTED | WiringFault.MARK_INVERTED | WiringFault.MOTOR_REVERSED

# a fault, the checks that fail, and a part of the advice
FAULTS = [
    (WiringFault(0), [], ""),
    (WiringFault.CAM_INVERTED, ["zero"], "--invert cam"),
    (WiringFault.CAM_OPEN, ["zero"], "--invert cam"),
    (WiringFault.MOTOR_REVERSED, ["zero"], "--invert motor"),
    (WiringFault.MARK_OPEN, ["zero"], "check the wire of the mark"),
    (WiringFault.MARK_INVERTED, ["zero"], "--invert mark"),
    (MIRRORED, ["zero"], "must turn counter-clockwise, seen from above, else `sonarhw wiring URL --invert motor`"),
    (WiringFault.MOTOR_OPEN, ["zero"], "check"),
    (WiringFault.ECHO_LOW, ["echoes", "direction", "plate"], "the pull-up of ECHO"),
    (WiringFault.INIT_OPEN, ["echoes", "direction", "plate"], "5 V supply of the ranging board, INIT"),
    (WiringFault.ECHO_HIGH, ["ECHO at rest", "echoes", "direction", "plate"], "ECHO is stuck"),
    (WiringFault.NOISE_ON_INIT, ["echo moves", "direction", "plate"], "noise on INIT"),
    (WiringFault.THERMISTOR_SHORTED, ["thermometer", "plate"], "check the thermistor"),
    (WiringFault.BLNK_OPEN, ["BLNK"], "check the wire of BLNK"),
]
# of the emulated board only
BOARD_FAULTS = [
    (WiringFault.STEPS_DOUBLED, ["steps"], "check the microstep jumpers"),
    (WiringFault.SUPPLY_WEAK, ["supply"], "give it a supply of 5 V and 3 A of its own"),
    (WiringFault.LINE_NOISY, ["line"], "use a short USB cable"),
]
# test_emulated_turntable.py has more wrong wires of the cam and the mark
ON_EMULATED = [one for one in FAULTS if one[0] not in (WiringFault.CAM_INVERTED, WiringFault.MARK_OPEN)] + BOARD_FAULTS
TURNTABLE = ("steps", "echo moves", "direction", "plate")  # checks that need the motor


def names(faults: list[tuple[WiringFault, list[str], str]]) -> list[str]:
    """Return the names of the faults."""
    return [str(fault.name or "none") for fault, _, _ in faults]


@contextmanager
def fake(faults: WiringFault) -> Iterator[str]:
    """A fake board with these wiring faults; yields its URL."""
    with serve(FakeBoard(HallEchoes(), seed=2, wires=Wires(faults)), tcp="127.0.0.1:0", pace="max") as endpoint:
        yield endpoint.url


@contextmanager
def emulated(faults: WiringFault) -> Iterator[str]:
    """An emulated board with these wiring faults; yields its URL. With a fault, 5 pings in place show it like 20."""
    with (
        pytest.MonkeyPatch.context() as patch,
        emulated_board(HallEchoes(), pace=3.0, start_deg=40, miswire=faults) as board,
    ):
        if faults:
            patch.setattr(bringup, "PINGS", 5)
        yield board.url


def assert_diagnoses(
    url: str, checks: list[str], advice: str, turns: bool = True, wiring: Wiring = Wiring(0)
) -> list[Diagnosis]:
    """Assert that exactly these checks fail with these settings, and that the first one gives this advice."""
    with Scanner.open(url) as scanner:
        scanner.configure_wiring(wiring, wiring)
        made = [*examine(scanner, turns, PLATE)]
    bad = [diagnosis for diagnosis in made if diagnosis.verdict == "FAIL"]
    assert [diagnosis.check for diagnosis in bad] == checks, made
    if bad:
        assert advice in bad[0].advice
    return made


@pytest.mark.parametrize(("fault", "checks", "advice"), FAULTS, ids=names(FAULTS))
def test_each_wiring_fault_of_a_fake_board_fails_its_check(fault: WiringFault, checks: list[str], advice: str) -> None:
    with fake(fault) as url:
        assert_diagnoses(url, checks, advice)


@pytest.mark.parametrize(("fault", "checks", "advice"), ON_EMULATED, ids=names(ON_EMULATED))
def test_each_wiring_fault_fails_its_check(fault: WiringFault, checks: list[str], advice: str) -> None:
    # a fault that an earlier check finds needs no turntable
    needs_turntable = not checks or checks[0] == "zero" or checks[0] in TURNTABLE
    with emulated(fault) as url:
        shown = checks if needs_turntable else [check for check in checks if check not in TURNTABLE]
        assert_diagnoses(url, shown, advice, needs_turntable)


ONE_SWITCH_FAULTS = [
    (WiringFault.CAM_OPEN, [], ""),
    (WiringFault.MARK_OPEN, ["zero"], "check the wire of the mark"),
    (WiringFault.MARK_INVERTED, ["zero"], "--invert mark"),
    (WiringFault.MOTOR_REVERSED, ["zero"], "--invert motor"),
    (
        WiringFault.MARK_INVERTED | WiringFault.MOTOR_REVERSED,
        ["direction", "plate"],
        "--invert mark` and `sonarhw wiring URL --invert motor`",
    ),
]
# with the three wrong wires that look like none; test_emulated_turntable.py has the others
ON_EMULATED_WITH_ONE_SWITCH = (ONE_SWITCH_FAULTS[-1][0] | WiringFault.CAM_OPEN, *ONE_SWITCH_FAULTS[-1][1:])


@pytest.mark.parametrize(("fault", "checks", "advice"), ONE_SWITCH_FAULTS, ids=names(ONE_SWITCH_FAULTS))
def test_faults_of_a_fake_board_with_one_switch(fault: WiringFault, checks: list[str], advice: str) -> None:
    with fake(fault) as url:
        assert_diagnoses_of_one_switch(url, checks, advice)


def test_faults_of_the_emulated_board_with_one_switch() -> None:
    fault, checks, advice = ON_EMULATED_WITH_ONE_SWITCH
    with emulated(fault) as url:
        assert_diagnoses_of_one_switch(url, checks, advice)


def assert_diagnoses_of_one_switch(url: str, checks: list[str], advice: str) -> None:
    """Assert what `assert_diagnoses` asserts, with one switch."""
    made = assert_diagnoses(url, checks, advice, wiring=Wiring.ONE_SWITCH)
    assert not any("cam " in diagnosis.text for diagnosis in made)


def test_the_command_prints_each_check_and_its_exit_status_counts_failures() -> None:
    with fake(WiringFault(0)) as url:
        good = sonarhw("doctor", url, "--plate", "30", "--distance", "1")
    assert (good.returncode, good.stderr) == (0, f"{url}: no check failed\n")
    assert [line.split()[0] for line in good.stdout.splitlines()] == ["pass"] * 13
    with fake(WiringFault.ECHO_LOW) as url:
        bad = sonarhw("doctor", url, "--no-turn")
    assert (bad.returncode, bad.stderr) == (1, f"{url}: 1 check failed\n")
    assert "FAIL  echoes        none in 20 pings\n                    → hold a plate at 1 m" in bad.stdout
    assert "skip  turntable" in bad.stdout


def test_a_missing_thermometer_is_no_failure() -> None:
    with fake(WiringFault.THERMISTOR_OPEN) as url:
        done = sonarhw("doctor", url, "--no-turn")
    assert done.returncode == 0
    assert "skip  thermometer   none, or its wire is open\n" in done.stdout


def test_older_firmware_is_checked_as_far_as_it_allows() -> None:
    board = FakeBoard(HallEchoes(), seed=2, identity=BoardIdentity(minor=1))
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint:
        done = sonarhw("doctor", endpoint.url)
    assert done.returncode == 1
    assert "FAIL  firmware      sonarhw-fake 0.1.0, protocol 1.1; 1.2 has all checks" in done.stdout
    assert "pass  zero" in done.stdout


def test_a_bad_cable_fails_the_line() -> None:
    device = FaultyDevice(lambda boots: FakeBoard(HallEchoes(), seed=2), read_faults("flip=1/400"), seed=3)
    with serve(device, tcp="127.0.0.1:0", pace="max") as endpoint, Scanner.open(endpoint.url) as scanner:
        first = next(examine(scanner, False, None))
    assert (first.check, first.verdict) == ("line", "FAIL")
    assert "short USB cable" in first.advice


def test_what_the_scanner_rejected_before_is_no_failure() -> None:
    board = FakeBoard(HallEchoes(), seed=2)
    board.receive(3 * b"no frame\0", 0.0)
    with serve(board, tcp="127.0.0.1:0", pace="max") as endpoint, Scanner.open(endpoint.url) as scanner:
        first = next(examine(scanner, False, None))
        assert scanner.device_statistics().rejected == 3
    assert (first.check, first.verdict) == ("line", "pass")


class NoisyHall(HallEchoes):
    """The hall, with hum on the tap of the trace."""

    def receive(self, ping: Ping) -> PingResult:
        result = super().receive(ping)
        trace = result.trace and Trace(np.full(len(result.trace.samples), 0.5), result.trace.rate, result.trace.start)
        return replace(result, trace=trace)


def test_noise_at_the_tap_of_the_emulated_board_fails() -> None:
    with emulated_board(NoisyHall(), pace=3.0) as board, Scanner.open(board.url) as scanner:
        made = [*examine(scanner, False, None)]
    assert [one.check for one in made if one.verdict == "FAIL"] == ["noise"]


def test_a_silent_echo_wire_is_told_from_a_silent_board_by_the_traces_of_the_emulated_board() -> None:
    low = WiringFault.ECHO_LOW
    with emulated_board(NoisyHall(), pace=3.0, miswire=low) as board, Scanner.open(board.url) as scanner:
        [echoes] = [one for one in examine(scanner, False, None) if one.check == "echoes"]
    assert "the board transmits and receives: check the wire of ECHO and its pull-up" in echoes.advice


def test_a_jammed_table_and_a_plate_elsewhere_fail_on_the_emulated_board() -> None:
    made = []
    with emulated_board(HallEchoes(), pace=3.0, start_deg=40) as board, Scanner.open(board.url) as scanner:
        for diagnosis in examine(scanner, True, Plate(math.radians(PLATE_DEG), DISTANCE * 1.1)):
            made.append(diagnosis)
            if diagnosis.check == "zero":
                board.wedge(0.5)
    assert [one.check for one in made if one.verdict == "FAIL"] == ["steps", "plate"]


@pytest.mark.parametrize(
    ("combination", "fault", "checks", "advice", "not_checked"),
    [
        ("uno-hc-sr04-28byj", WiringFault(0), [], "", ["BLNK", "noise", "zero"]),
        ("uno-hc-sr04-servo", WiringFault.MOTOR_REVERSED, ["direction", "plate"], "--invert motor", ["BLNK", "noise"]),
        (
            "uno-hc-sr04-28byj",
            WiringFault.MOTOR_OPEN,
            ["echo moves", "direction", "plate"],
            "if the table does not turn, check its motor",
            ["BLNK", "noise", "zero", "steps"],
        ),
    ],
)
def test_cheap_turntables_are_checked_as_far_as_they_allow(
    combination: str, fault: WiringFault, checks: list[str], advice: str, not_checked: list[str]
) -> None:
    with emulated_board(HallEchoes(), pace=3.0, start_deg=0, combination=combination, miswire=fault) as board:
        made = assert_diagnoses(board.url, checks, advice)
    assert [one.check for one in made if one.verdict == "skip"] == not_checked


class JammingHall(HallEchoes):
    """The hall. The turntable of `board` is jammed after the first ping at 150°."""

    board: EmulatedBoard | None = None

    def receive(self, ping: Ping) -> PingResult:
        if self.board and abs(math.degrees(ping.angle) - 150) < 5:
            self.board.wedge(0.5)
            self.board = None
        return super().receive(ping)


def test_steps_lost_by_a_turntable_without_a_mark_change_the_echoes() -> None:
    hall = JammingHall()
    with (
        emulated_board(hall, pace=3.0, start_deg=0, combination="uno-hc-sr04-28byj") as hall.board,
        Scanner.open(hall.board.url) as scanner,
    ):
        made = [*examine(scanner, True, None)]
    assert [one.check for one in made if one.verdict == "FAIL"] == ["steps"]
