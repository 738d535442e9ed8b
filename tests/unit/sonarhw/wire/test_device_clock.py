"""The line through what frames tell is the true relation of the two clocks, drift, late frames and resets or not."""

import random

import pytest

from sonarhw.wire.device_clock import DeviceClock

EPOCH = 1_700_000_000.0


def frames(
    chance: random.Random, start: float, seconds: float, drift: float, since: float = 0.0
) -> list[tuple[int, float]]:
    """Device time (µs) and arrival of frames, ten a second: a millisecond late at least, now and then much later."""
    told = []
    for number in range(round(seconds * 10)):
        device = since + number * 0.1
        late = 0.001 + chance.expovariate(1 / 0.004) + (0.2 if chance.random() < 0.05 else 0.0)
        told.append((round(device * 1e6), start + (device - since) * (1 + drift) + late))
    return told


@pytest.mark.parametrize("drift", [-0.005, -5e-5, 0.0, 1e-4, 0.005])
def test_device_times_are_mapped_to_the_host_within_two_milliseconds(drift: float) -> None:
    clock = DeviceClock()
    for device_us, arrived in frames(random.Random(3), EPOCH, 120.0, drift):
        clock.heard(device_us, arrived)
    assert clock.drift == pytest.approx(drift, abs=3e-5)
    for device in (60.0, 90.0, 119.0):
        told = clock.host_time(device)
        assert told is not None
        # a frame that is never less than a millisecond late shifts the line by that
        assert told == pytest.approx(EPOCH + device * (1 + drift) + 0.001, abs=0.002)


def test_before_anything_was_heard_nothing_is_known() -> None:
    clock = DeviceClock()
    assert not clock.known
    assert clock.host_time(1.0) is None


def test_a_few_late_frames_at_the_beginning_are_no_drift() -> None:
    clock = DeviceClock()
    clock.heard(0, EPOCH + 0.5)
    clock.heard(1_500_000, EPOCH + 1.5)
    assert clock.drift == 0.0
    assert clock.host_time(1.5) == pytest.approx(EPOCH + 1.5)


@pytest.mark.parametrize("told", [True, False], ids=["told by the boot counter", "seen by the clock"])
def test_time_goes_on_over_a_reset(told: bool) -> None:
    chance, clock, drift = random.Random(4), DeviceClock(), 2e-4
    clock.greeted(1 if told else 0)
    for device_us, arrived in frames(chance, EPOCH, 60.0, drift):
        clock.heard(device_us, arrived)
    # five seconds off, then a clock that begins at zero; one that tells its boots may have run for longer than before
    since = 100.0 if told else 0.0
    if told:
        clock.greeted(2)
    for device_us, arrived in frames(chance, EPOCH + 65.0, 60.0, drift, since):
        clock.heard(device_us, arrived)
    assert clock.resets == 1
    after = clock.continued(round((since + 30.0) * 1e6))
    assert after == pytest.approx(65.0 / (1 + drift) + 30.0, abs=0.25)
    assert clock.host_time(after) == pytest.approx(EPOCH + 65.0 + 30.0 * (1 + drift), abs=0.01)


def test_the_same_boot_told_again_is_no_reset() -> None:
    clock = DeviceClock()
    for boot in (5, 5, 0):
        clock.greeted(boot)
        clock.heard(1_000_000 * (boot + 1), EPOCH)
    assert clock.resets in (0, 1)  # the last one ran back
