"""Movements have constant acceleration, compared with the closed form and not with the table."""

import ctypes
from pathlib import Path

import numpy as np
import pytest

TICK = 0.5e-6  # s


class Ramp(ctypes.Structure):
    """`struct ramp` of C."""

    _fields_ = [(name, ctypes.c_uint16) for name in ("left", "index", "top", "first")]


def ramp_of(built: Path, steps: int, acceleration: int, speed: int) -> tuple[ctypes.CDLL, Ramp]:
    """Return the library, and a movement from rest."""
    library = ctypes.CDLL(str(built / "libsonar.so"))
    library.ramp_of.restype, library.ramp_next.restype = Ramp, ctypes.c_uint16
    return library, library.ramp_of(ctypes.c_uint16(steps), ctypes.c_uint32(acceleration), ctypes.c_uint16(speed))


def ticks_of(library: ctypes.CDLL, ramp: Ramp) -> list[int]:
    """Return the ticks of each step that is left of a movement."""
    return [*iter(lambda: library.ramp_next(ctypes.byref(ramp)), 0)]


def step_times(built: Path, steps: int, acceleration: int, speed: int) -> np.ndarray:
    """Return the duration of each step of a movement, s."""
    return np.array(ticks_of(*ramp_of(built, steps, acceleration, speed))) * TICK


@pytest.mark.parametrize("acceleration", [2_000, 36_000, 80_000])
def test_step_n_from_rest_ends_at_the_root_of_2_n_over_a(built: Path, acceleration: int) -> None:
    made = np.cumsum(step_times(built, 400, acceleration, 65_000)[:200])
    assert made == pytest.approx(np.sqrt(2 * np.arange(1, 201) / acceleration), rel=2e-3)


@pytest.mark.parametrize("steps", [1, 2, 3, 4, 5, 99, 100, 5_000])
def test_deceleration_mirrors_acceleration(built: Path, steps: int) -> None:
    times = step_times(built, steps, 80_000, 3_600)
    assert len(times) == steps
    assert times == pytest.approx(times[::-1])


def test_a_long_movement_reaches_full_speed_and_a_short_one_does_not(built: Path) -> None:
    assert step_times(built, 5_000, 80_000, 3_600).min() == pytest.approx(1 / 3_600, rel=0.01)
    # a movement of n steps is fastest in its middle: v = sqrt(a n)
    assert step_times(built, 50, 80_000, 3_600).min() == pytest.approx(1 / np.sqrt(80_000 * 50), rel=0.05)


def test_a_very_slow_movement_has_constant_speed(built: Path) -> None:
    times = step_times(built, 30, 80_000, 40)
    assert times == pytest.approx(1 / 40, rel=1e-3)


def test_a_halt_needs_as_many_steps_as_the_acceleration(built: Path) -> None:
    library, ramp = ramp_of(built, 5_000, 80_000, 3_600)
    up = [library.ramp_next(ctypes.byref(ramp)) for _ in range(60)]
    library.ramp_halt(ctypes.byref(ramp))
    down = ticks_of(library, ramp)
    assert down[1:] == up[::-1][: len(down) - 1]
    assert len(down) == 61
