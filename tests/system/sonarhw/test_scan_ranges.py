"""The ranges of a scan are right in air of any temperature, without `configure`."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.predict.room_echoes import Disturbance, RoomEchoes
from sonarhw_sim.room.room import load_room

from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import serve
from sonarhw.host.scanner import Scanner
from sonarhw.readings import EchoSource, Reading, ScanOrder, sector
from sonarhw.sound_speed import speed_of_sound
from tests.checkout import CHECKOUT
from tests.fixtures.plain_echoes import PlainEchoes, echo_time

ONE = ScanOrder(0.0, 1.0, 1)
ANY_AIR = Disturbance(0.0, 20.0, 0.0, 0.0, 0.0, 0.0, False)  # only the temperature differs from that of the room file
BOARD = replace(load_board("polaroid-6500"), max_range=3.0)


def scanned(echoes: EchoSource, order: ScanOrder, **settings: float) -> list[Reading]:
    with serve(FakeBoard(echoes), tcp="127.0.0.1:0", pace="max") as endpoint, Scanner.open(endpoint.url) as scanner:
        if settings:
            scanner.configure(**settings)
        return list(scanner.scan(order))


def test_the_median_error_of_a_scan_is_below_a_millimetre() -> None:
    room = load_room(CHECKOUT / "rooms" / "simple.toml")
    place = room.place("figure9")
    echoes = RoomEchoes(room, place, BOARD, 1, ANY_AIR)
    echoes.prepare()
    assert echoes.temperature_c is not None
    assert abs(echoes.temperature_c - room.air.temperature_c) > 3
    readings = scanned(echoes, sector())
    true_ranges = predict_scan(room, place, BOARD, np.radians(np.arange(0, 360, 5))).ranges
    measured = np.array([math.nan if reading.range is None else reading.range for reading in readings])
    assert np.nanmedian(np.abs(measured - true_ranges)) < 1e-3


@pytest.mark.parametrize(("thermometer", "assumed"), [(5.0, 5.0), (35.0, 35.0), (None, 20.0)])
@pytest.mark.parametrize("settings", [{}, {"listen": 0.05}], ids=["not configured", "configured"])
def test_a_scan_uses_the_thermometer_or_20_degrees(
    thermometer: float | None, assumed: float, settings: dict[str, float]
) -> None:
    (reading,) = scanned(PlainEchoes(thermometer), ONE, **settings)
    assert reading.range == pytest.approx(speed_of_sound(assumed) * echo_time(0.0) / 2, rel=1e-5)
