"""The turntable of the emulated board: lost steps, jams, wrong wires, and homing by the mark alone."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sonarhw import sector
from sonarhw.device.fake_board import WiringFault
from sonarhw.errors import DeviceError, LostSteps
from sonarhw.host.scanner import Scanner
from sonarhw.readings import Reading, pings_in_place
from sonarhw.wire.messages import Feature, Input, Outcome, Wiring
from tests.system.firmware.combinations.images import MEGA, UNO
from tests.system.firmware.conftest import Echoes, Mishap, scanner_on


@pytest.mark.parametrize(("combination", "first"), [(MEGA, 40), (UNO, -30)])
def test_a_slipped_table_is_detected_at_the_mark_or_after_the_sweep(combination: str, first: int) -> None:
    echoes = Mishap(0.020, before=1)
    readings: list[Reading] = []
    with scanner_on(echoes, combination=combination) as (board, scanner):
        echoes.act = lambda: board.slip(64)
        with pytest.raises(LostSteps, match="steps were lost"):
            readings.extend(scanner.scan(sector(first, first + 60, 10)))
        assert len(readings) == (6 if first > 0 else 4)
        assert abs(scanner.device_statistics().lost_steps) == pytest.approx(64, abs=2)


def test_steps_lost_in_a_short_jam_are_reported() -> None:
    echoes = Mishap(0.020, before=3)
    readings: list[Reading] = []
    with scanner_on(echoes) as (board, scanner):
        echoes.act = lambda: board.wedge(0.7)
        with pytest.raises(LostSteps, match="steps were lost"):
            readings.extend(scanner.scan(sector(-30, 40, 2)))
        lost = scanner.device_statistics().lost_steps
    # the table itself was left behind by whole periods of the motor's field, and stays behind
    behind = np.degrees([reading.angle - ping.angle for reading, ping in zip(readings, echoes.pings, strict=False)])
    periods = behind[-1] / 3.2
    assert periods >= 1
    assert periods == pytest.approx(round(periods), abs=0.02)
    assert lost


def test_home_with_a_wrong_wire_or_a_blocked_table_names_it() -> None:
    with scanner_on(Echoes(0.020), start_deg=99) as (board, scanner):
        board.miswire(WiringFault.CAM_INVERTED)
        for _ in range(2):
            with pytest.raises(DeviceError, match="the cam never changed"):
                scanner.home()
    with scanner_on(Echoes(0.020)) as (board, scanner):
        board.wedge(60)
        with pytest.raises(DeviceError, match="the zero mark never came; check its wire and the motor"):
            scanner.home()


def test_a_corrected_wire_works_also_after_a_power_failure(tmp_path: Path) -> None:
    faults = WiringFault.CAM_INVERTED | WiringFault.MARK_INVERTED | WiringFault.MOTOR_REVERSED
    echoes = Echoes(0.020)
    kept = tmp_path / "eeprom"
    with scanner_on(echoes, start_deg=30, eeprom=kept, miswire=faults) as (_, scanner):
        assert scanner.configure_wiring(Wiring(7), Wiring(7)) == Wiring(7)
        assert scanner.home() is Outcome.DONE
    with scanner_on(echoes, start_deg=30, eeprom=kept, miswire=faults) as (_, scanner):
        assert scanner.configure_wiring() == Wiring(7)
        list(scanner.scan(sector(10, 30, 10)))
    assert np.degrees([ping.angle for ping in echoes.pings]) == pytest.approx([10, 20], abs=0.01)


def test_a_jog_turns_the_table_before_a_home() -> None:
    echoes = Echoes(0.020)
    with scanner_on(echoes, start_deg=100) as (_, scanner):
        assert scanner.inputs() == Input.MARK | Input.CAM
        for angle in (0.0, 8.0, -3.0):
            assert scanner.jog(np.radians(angle)) is Outcome.DONE
            list(scanner.scan(pings_in_place(1)))
    assert np.degrees([ping.angle for ping in echoes.pings]) == pytest.approx(
        [100 - 0.6, 108 - 0.6, 105 - 0.6], abs=0.7
    )


def test_the_table_is_at_rest_at_the_reported_angle_during_a_ping() -> None:
    echoes = Echoes(0.020)
    with scanner_on(echoes, start_deg=-300) as (_, scanner):
        order = replace(sector(-45, 45, 9), sweeps=2)
        reported = [reading.angle for reading in scanner.scan(order)]
    assert [ping.angle for ping in echoes.pings] == pytest.approx(reported, abs=1e-9)
    assert [ping.sweep for ping in echoes.pings] == [0] * 10 + [1] * 10


# homing by the mark alone


PLAY = 0.7  # degrees; the gear of the emulated turntable


def choose_one_switch(scanner: Scanner) -> None:
    assert scanner.configure_wiring(Wiring.ONE_SWITCH, Wiring.ONE_SWITCH) == Wiring.ONE_SWITCH


@pytest.mark.parametrize(("combination", "start"), [(MEGA, -45), (UNO, 30)])
def test_a_table_near_zero_homes_without_a_cam(combination: str, start: float) -> None:
    echoes = Echoes(0.020)
    options = {"combination": combination, "start_deg": start, "miswire": WiringFault.CAM_OPEN}
    with scanner_on(echoes, **options) as (_, scanner):
        choose_one_switch(scanner)
        assert scanner.home() is Outcome.DONE
        readings = list(scanner.scan(sector(-20, 21, 20)))
    assert np.degrees([ping.angle for ping in echoes.pings]) == pytest.approx([-20, 0, 20], abs=0.06)
    assert [reading.angle for reading in readings] == pytest.approx([ping.angle for ping in echoes.pings], abs=0.001)


# the state of the turntable is the same code on both chips; the test above homes an Uno too
@pytest.mark.parametrize("combination", [MEGA, pytest.param(UNO, marks=pytest.mark.soak)])
def test_all_around_is_scanned_after_a_power_failure_anywhere(combination: str, tmp_path: Path) -> None:
    options = {"combination": combination, "eeprom": tmp_path / "eeprom", "miswire": WiringFault.CAM_OPEN}
    echoes = Echoes(0.020)
    with scanner_on(echoes, start_deg=5, **options) as (_, scanner):
        choose_one_switch(scanner)
        able = scanner.info.capabilities
        assert able.features & Feature.ONE_SWITCH
        assert np.degrees([able.lowest_angle, able.highest_angle]) == pytest.approx([-175, 175])
        list(scanner.scan(sector(-175, 180, 35)))
        assert scanner.device_statistics().lost_steps == 0
    assert np.degrees([ping.angle for ping in echoes.pings]) == pytest.approx(np.arange(-175, 180, 35), abs=0.06)
    echoes = Echoes(0.020)
    with scanner_on(echoes, start_deg=-175, **options) as (_, scanner):
        list(scanner.scan(sector(30, 40, 10)))
    assert np.degrees([ping.angle for ping in echoes.pings]) == pytest.approx([30], abs=0.06)


@pytest.mark.parametrize(
    ("combination", "fault", "text"),
    [
        (UNO, WiringFault.MOTOR_OPEN, "the zero mark never came"),
        (MEGA, WiringFault.MOTOR_REVERSED, "moved the wrong way; invert the mark or the motor"),
    ],
)
def test_a_wrong_wire_is_named_and_home_returns(combination: str, fault: WiringFault, text: str) -> None:
    echoes = Echoes(0.020)
    with scanner_on(echoes, combination=combination, start_deg=30, miswire=fault) as (_, scanner):
        choose_one_switch(scanner)
        with pytest.raises(DeviceError, match=f"{text}.*; begin within 45 degrees of 0; mark [01]"):
            scanner.home()
        list(scanner.scan(pings_in_place(1)))
    assert math.degrees(echoes.pings[-1].angle) == pytest.approx(30, abs=PLAY)


def test_lost_steps_are_detected_on_the_way_clockwise() -> None:
    with scanner_on(Echoes(0.020), start_deg=10) as (board, scanner):
        choose_one_switch(scanner)
        scanner.turn(math.radians(60))
        board.slip(-640)
        with pytest.raises(DeviceError, match="steps were lost; send Home; begin within 45 degrees of 0"):
            scanner.turn(math.radians(-60))
        assert scanner.home() is Outcome.DONE
        assert scanner.device_statistics().lost_steps


def test_a_turntable_without_switches_refuses_one_switch() -> None:
    with (
        scanner_on(Echoes(0.020), combination="uno-hc-sr04-servo", start_deg=0) as (_, scanner),
        pytest.raises(DeviceError, match="change: expected 0 to 7"),
    ):
        scanner.configure_wiring(Wiring.ONE_SWITCH, Wiring.ONE_SWITCH)
