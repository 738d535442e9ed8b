"""Homing by the mark alone on the emulated Mega and Uno, whose motor, gear and light barriers are modelled."""

import math
from pathlib import Path

import numpy as np
import pytest

from sonarhw import sector
from sonarhw.device.fake_board import WiringFault
from sonarhw.errors import DeviceError
from sonarhw.host.scanner import Scanner
from sonarhw.readings import pings_in_place
from sonarhw.wire.messages import Feature, Outcome, Wiring
from tests.system.firmware.combinations.images import MEGA, UNO
from tests.system.firmware.conftest import Echoes, scanner_on

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
def test_all_around_is_scanned_and_a_power_failure_anywhere_winds_the_cable_no_further(
    combination: str, tmp_path: Path
) -> None:
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
def test_a_wrong_wire_is_named_and_home_returns_to_where_it_began(
    combination: str, fault: WiringFault, text: str
) -> None:
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
