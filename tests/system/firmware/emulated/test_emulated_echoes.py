"""Echo times, traces and the timer of the flashed firmware on the emulated board."""

import math

import numpy as np
import pytest
from sonarhw_compare.calibration.plate import calibrate_with_plates
from sonarhw_compare.calibration.plate_readings import plate_readings
from sonarhw_compare.scanner_url import DEMO_PLACE, DEMO_ROOM
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.room_echoes import RoomEchoes
from sonarhw_sim.room.room import Place, load_room

from sonarhw import Scanner, sector
from sonarhw.device.emulated_board import EmulatedBoard
from sonarhw.device.fake_board import FakeBoard
from sonarhw.device.served import serve
from sonarhw.readings import Ping, PingResult, Reading, Trace
from tests.fixtures.plate_scans import ALONE, CONSTANTS, hidden_board, start_board, wall_room
from tests.system.firmware.conftest import Echoes, envelope, scanner_on

TWO_TICKS = 1e-6  # s
REARM = 0.0006  # s; so long that the interrupt of the board never loses an echo that the fake board reports
TIMER_WRAP = 65_536 * 0.5e-6  # s


def demo_echoes() -> RoomEchoes:
    """Return an echo source for the demo room with a fixed seed."""
    room = load_room(DEMO_ROOM)
    echoes = RoomEchoes(room, room.place(DEMO_PLACE), load_board("polaroid-6500"), seed=1)
    echoes.prepare()
    return echoes


def scanned(scanner: Scanner, traces: bool, step: float) -> list[Reading]:
    """Scan a whole turn and return its readings in the order of their numbers."""
    scanner.configure(trace=traces, rearm=REARM)
    return sorted(scanner.scan(sector(0, 360, step)), key=lambda reading: reading.number)


@pytest.mark.parametrize(("traces", "step"), [(False, 15.0), (True, 60.0)])
def test_echo_times_in_the_demo_room_match_the_fake_board_to_two_timer_ticks(traces: bool, step: float) -> None:
    with serve(FakeBoard(demo_echoes()), tcp="127.0.0.1:0", pace="max") as fake, Scanner.open(fake.url) as scanner:
        expected = scanned(scanner, traces, step)
    with scanner_on(demo_echoes()) as (_, scanner):
        before = scanner.statistics
        readings = scanned(scanner, traces, step)
        after = scanner.statistics
        assert after.lost_readings == 0
        # a busy machine may stop the emulator for longer than the driver waits for bytes; the driver then begins again
        # at the first baud rate, at which the next bytes of the board are damaged
        assert after.rejected_blocks == before.rejected_blocks or after.losses > before.losses
    assert [reading.angle for reading in readings] == [reading.angle for reading in expected]
    for ours, theirs in zip(readings, expected, strict=True):
        assert ours.echo_times == pytest.approx(theirs.echo_times, rel=0, abs=TWO_TICKS)
        assert ours.temperature_c == pytest.approx(theirs.temperature_c, abs=0.2)


def test_levels_and_times_of_a_trace_are_correct() -> None:
    with scanner_on(Echoes(0.020)) as (_, scanner):
        (reading,) = scanned(scanner, True, 360)
    trace = reading.trace
    assert trace.rate == pytest.approx(1 / 13e-6)
    assert len(trace.samples) > 4_750
    time = trace.start + np.arange(len(trace.samples)) / trace.rate
    assert np.nanmax(np.abs(trace.samples - envelope(time))) < 0.005


class Sawtooth(Echoes):
    """Echo source whose trace is a sawtooth of 2 ms: its level identifies the time within a tooth to 4 us."""

    def receive(self, ping: Ping) -> PingResult:
        """Return the given echoes and the sawtooth."""
        time = np.arange(0, 0.0655, 1e-6)
        return PingResult(super().receive(ping).echo_times, Trace(0.05 + 450 * (time % 0.002), 1e6, 0.0))


def test_every_sample_is_at_its_time_although_echoes_delay_the_converter() -> None:
    echoes = Sawtooth(*(0.003 + 0.0025 * k for k in range(8)))
    with scanner_on(echoes) as (_, scanner):
        scanner.configure(trace=True, rearm=REARM)
        readings = list(scanner.scan(sector(0, 30, 10)))
    losses = []
    for reading in readings:
        assert len(reading.echo_times) == 8
        expected = reading.trace.times % 0.002
        off = (reading.trace.samples - 0.05) / 450 - expected
        lost = np.isnan(reading.trace.samples)
        losses.append(lost.sum())
        inside = (expected > 0.0001) & (expected < 0.0019) & ~lost
        # one conversion and the resolution of a sample; not one conversion for each echo
        assert np.abs(off[inside]).max() < 13e-6 + 5e-6
        assert len(reading.trace.samples) == 4_800
    # at most one conversion is lost for each echo, and it is marked; more only where bytes of the host arrive meanwhile
    assert 1 <= min(losses) <= 8


def test_echoes_before_the_blanking_and_noise_of_the_transmitter_are_ignored() -> None:
    with scanner_on(Echoes(0.001, 0.007, 0.014)) as (_, scanner):
        for blanking, expected in ((0.0006, [1, 7, 14]), (0.00238, [7, 14]), (0.010, [14]), (0.040, [])):
            scanner.configure(blanking=blanking)
            (reading,) = scanner.scan(sector(0, 5, 5))
            assert reading.echo_times == pytest.approx([ms * 1e-3 for ms in expected], rel=0, abs=TWO_TICKS)


def test_several_echoes_are_detected_by_rearming_the_board() -> None:
    times = np.arange(3, 60) * 1e-3
    with scanner_on(Echoes(*times)) as (_, scanner):
        assert scanner.configure(echoes=122).echoes == 34
        (many,) = scanner.scan(sector(0, 5, 5))
        scanner.configure(echoes=3)
        (three,) = scanner.scan(sector(0, 5, 5))
        scanner.configure(rearm=0.0095)
        (spaced,) = scanner.scan(sector(0, 5, 5))
    assert many.echo_times == pytest.approx(times[:34], rel=0, abs=TWO_TICKS)
    assert three.echo_times == pytest.approx(times[:3], rel=0, abs=TWO_TICKS)
    assert spaced.echo_times == pytest.approx([0.003, 0.013, 0.023, 0.033, 0.043, 0.053], rel=0, abs=TWO_TICKS)


def test_echoes_after_the_wrap_of_the_timer_are_timed_correctly() -> None:
    times = (TIMER_WRAP - 1e-6, TIMER_WRAP + 0.5e-3, 0.0601)
    with scanner_on(Echoes(*times)) as (_, scanner):
        for reading in scanner.scan(sector(0, 6, 1)):
            assert reading.echo_times == pytest.approx(times, rel=0, abs=TWO_TICKS)


class AtTheWrap(Echoes):
    """Echo source with one echo per ping around the wrap of the timer, later at each ping."""

    board: EmulatedBoard
    born = 0.0  # start of the firmware's clock, s of board time
    step = 0.25e-6  # s

    def receive(self, ping: Ping) -> PingResult:
        """Return the echo, and a trace for its interrupts."""
        since = self.board.fired - self.born
        wrap = (since // TIMER_WRAP + 1) * TIMER_WRAP - since
        self._times = (wrap + (len(self.pings) - 8) * self.step,)
        return super().receive(ping)


def test_echoes_at_the_wrap_of_the_timer_are_timed_correctly() -> None:
    echoes = AtTheWrap()
    with scanner_on(echoes) as (echoes.board, scanner):
        scanner.configure(trace=True)
        (first,) = scanner.scan(sector(0, 5, 5))
        echoes.born = echoes.board.fired - first.time
        echoes.pings.clear()
        for reading in scanner.scan(sector(0, 40, 1)):
            since = reading.time % TIMER_WRAP
            if since > TIMER_WRAP - 0.0024:
                continue  # the echo was within the blanking
            expected = TIMER_WRAP - since + (reading.number - 8) * echoes.step
            # fired_us is rounded to a whole number
            assert reading.echo_times == pytest.approx([expected], rel=0, abs=TWO_TICKS + 1e-6)


# the traces of the board are tested above, and the calibration with those of a fake board in test_calibrate.py
@pytest.mark.soak
def test_a_plate_in_front_of_the_emulated_board_gives_its_constants() -> None:
    start, scans = start_board(), []
    for seed, distance in enumerate((0.5, 1.0, 2.0)):
        place = Place("here", (-distance, 0.0), math.radians(1.0))
        echoes = RoomEchoes(wall_room(), place, hidden_board(), seed, ALONE)
        echoes.prepare()
        with scanner_on(echoes) as (_, scanner):
            scanner.configure(0.020, start.blanking, True)
            scanned = list(scanner.scan(sector(-28, 28, 1)))
        assert all(reading.trace is not None for reading in scanned)
        scans.append(plate_readings(f"{distance:g} m", scanned, distance, 0.0, start, start.blanking))
    found = {one.key: one.value for one in calibrate_with_plates(start, scans).findings}
    assert found["aperture_radius"] == pytest.approx(CONSTANTS["aperture_radius"], rel=0.02)
    assert found["gain_step_db"] == pytest.approx(CONSTANTS["gain_step_db"], abs=0.5)
    assert found["threshold_db"] == pytest.approx(CONSTANTS["threshold_db"], abs=0.5)
    assert found["rise_cycles"] == pytest.approx(CONSTANTS["rise_cycles"], rel=0.10)
