"""The fitted line matches the true relation of both clocks, with drift, late frames and resets."""

import random

import pytest

from sonarhw.wire.device_clock import DeviceClock

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
