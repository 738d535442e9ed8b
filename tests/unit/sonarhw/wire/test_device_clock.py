"""The fitted line matches the true relation of both clocks, with drift, late frames and resets."""

import math
import random

import pytest

from sonarhw.wire.readings_of_frames import MOST_DRIFT, DeviceClock

EPOCH = 1_700_000_000.0


def frames(
    chance: random.Random, start: float, seconds: float, drift: float, since: float = 0.0
) -> list[tuple[int, float]]:
    """Device time (µs) and arrival (s) of ten frames per second, at least 1 ms late and sometimes much later."""
    sent = []
    for number in range(round(seconds * 10)):
        device = since + number * 0.1
        late = 0.001 + chance.expovariate(1 / 0.004) + (0.2 if chance.random() < 0.05 else 0.0)
        sent.append((round(device * 1e6), start + (device - since) * (1 + drift) + late))
    return sent


@pytest.mark.parametrize("drift", [-0.005, -5e-5, 0.0, 1e-4, 0.005])
def test_device_times_are_mapped_to_the_host_within_two_milliseconds(drift: float) -> None:
    clock = DeviceClock()
    for device_us, arrived in frames(random.Random(3), EPOCH, 120.0, drift):
        clock.add_frame(device_us, arrived)
    assert clock.drift == pytest.approx(drift, abs=3e-5)
    for device in (60.0, 90.0, 119.0):
        host = clock.host_time(device)
        assert host is not None
        # the least delay of 1 ms shifts the line by 1 ms
        assert host == pytest.approx(EPOCH + device * (1 + drift) + 0.001, abs=0.002)


def test_no_host_time_before_the_first_frame() -> None:
    clock = DeviceClock()
    assert not clock.known
    assert clock.host_time(1.0) is None


def test_without_a_reset_continued_time_is_the_time_of_the_device() -> None:
    clock = DeviceClock()
    clock.add_frame(7_000_000, EPOCH)
    assert (clock.continued(7_500_000), clock.resets) == (7.5, 0)


def test_few_late_frames_at_the_beginning_cause_no_drift() -> None:
    clock = DeviceClock()
    clock.add_frame(0, EPOCH + 0.5)
    clock.add_frame(1_500_000, EPOCH + 1.5)
    assert clock.drift == 0.0
    assert clock.host_time(1.5) == pytest.approx(EPOCH + 1.5)


@pytest.mark.parametrize("counted", [True, False], ids=["boot counter", "clock ran back"])
def test_time_continues_across_a_reset(counted: bool) -> None:
    chance, clock, drift = random.Random(4), DeviceClock(), 2e-4
    clock.set_boot(1 if counted else 0)
    for device_us, arrived in frames(chance, EPOCH, 60.0, drift):
        clock.add_frame(device_us, arrived)
    # five seconds off, then a clock from zero; with a boot counter, the new clock may even be ahead of the old one
    since = 100.0 if counted else 0.0
    if counted:
        clock.set_boot(2)
    for device_us, arrived in frames(chance, EPOCH + 65.0, 60.0, drift, since):
        clock.add_frame(device_us, arrived)
    assert clock.resets == 1
    after = clock.continued(round((since + 30.0) * 1e6))
    assert after == pytest.approx(65.0 / (1 + drift) + 30.0, abs=0.25)
    assert clock.host_time(after) == pytest.approx(EPOCH + 65.0 + 30.0 * (1 + drift), abs=0.01)


def test_an_unchanged_boot_count_is_no_reset() -> None:
    clock = DeviceClock()
    for boot in (5, 5, 0):
        clock.set_boot(boot)
        clock.add_frame(1_000_000 * (boot + 1), EPOCH)
    assert clock.resets in (0, 1)  # the last one ran back


@pytest.mark.parametrize("drift", [-0.05, 0.05])
def test_a_drift_that_no_clock_has_is_limited(drift: float) -> None:
    clock = DeviceClock()
    for second in range(30):
        clock.add_frame(second * 1_000_000, EPOCH + second * (1 + drift))
    assert clock.drift == pytest.approx(math.copysign(MOST_DRIFT, drift))


@pytest.mark.parametrize("drift", [-0.01, 0.0, 0.01])
def test_time_across_a_reset_is_that_of_a_clock_that_was_never_reset(drift: float) -> None:
    """Without jitter, the continued time follows exactly from the arrival and the drift."""
    clock = DeviceClock()
    clock.set_boot(1)
    for tenth in range(200):
        clock.add_frame(tenth * 100_000, EPOCH + tenth * 0.1 * (1 + drift))
    clock.set_boot(2)
    clock.add_frame(3_000_000, EPOCH + 50.0)
    assert clock.resets == 1
    assert clock.continued(3_000_000) == pytest.approx(50.0 / (1 + drift), abs=1e-5)
    assert clock.continued(4_500_000) == pytest.approx(50.0 / (1 + drift) + 1.5, abs=1e-5)


def test_time_never_runs_back_at_a_reset() -> None:
    clock = DeviceClock()
    clock.set_boot(1)
    # one second late, but for the last, so the fitted line says that less time has passed than the last frame shows
    for second in range(10):
        clock.add_frame(second * 1_000_000 + 500_000, EPOCH + second + 0.5 + (0.0 if second == 9 else 1.0))
    clock.set_boot(2)
    clock.add_frame(0, EPOCH + 9.6)
    assert clock.continued(0) >= 9.5


@pytest.mark.parametrize(("back", "resets"), [(0.9, 0), (1.1, 1)])
def test_only_a_large_step_back_is_a_reset(back: float, resets: int) -> None:
    clock = DeviceClock()
    clock.add_frame(10_000_000, EPOCH)
    clock.add_frame(10_000_000 - round(back * 1e6), EPOCH + 0.01)
    assert clock.resets == resets


@pytest.mark.parametrize(("boots", "resets"), [((1, 2), 1), ((2, 1), 1), ((1, 1), 0), ((0, 1), 0), ((1, 0), 0)])
def test_only_a_changed_boot_count_is_a_reset(boots: tuple[int, int], resets: int) -> None:
    clock = DeviceClock()
    for second, boot in enumerate(boots):
        clock.set_boot(boot)
        clock.add_frame(second * 1_000_000, EPOCH + second)
        clock.add_frame(second * 1_000_000 + 1000, EPOCH + second + 0.001)
    assert clock.resets == resets


def test_of_each_second_only_the_frame_with_the_least_delay_counts() -> None:
    clock = DeviceClock()
    for tenth in range(300):
        clock.add_frame(tenth * 100_000, EPOCH + tenth * 0.1 + (0.002 if tenth % 10 == 4 else 0.3 + 0.001 * tenth))
    assert clock.drift == pytest.approx(0.0, abs=1e-9)
    assert clock.host_time(29.4) == pytest.approx(EPOCH + 29.4 + 0.002, abs=1e-6)


def test_only_the_last_minute_is_fitted() -> None:
    clock = DeviceClock()
    host = EPOCH
    for second in range(200):
        clock.add_frame(second * 1_000_000, host)
        host += 1.0 + (0.001 if second < 100 else -0.001)
    assert clock.drift == pytest.approx(-0.001, abs=1e-6)


@pytest.mark.parametrize(("seconds", "drift"), [(4, 0.0), (5, 0.01)])
def test_drift_is_fitted_from_five_seconds_on(seconds: int, drift: float) -> None:
    clock = DeviceClock()
    for second in range(seconds):
        clock.add_frame(second * 1_000_000, EPOCH + second * 1.01)
    assert clock.drift == pytest.approx(drift, abs=1e-6)
