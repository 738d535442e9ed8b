"""Readings and logs that several tests begin with."""

import math
from pathlib import Path

import numpy as np

from sonarhw.encode import write_scan
from sonarhw.log import LogMetadata
from sonarhw.readings import Reading, Trace

SPEED = 343.987
STARTED = 1_790_000_000.25
METADATA = LogMetadata("simulate", STARTED, "simple.toml", 'name = "Simple"\n', "figure9", "paper")


def example_reading(number: int, *, trace: bool = False, sweep: int = 0, angle: float | None = None) -> Reading:
    """Reading `number` at 5° steps; every third has no echo."""
    echoes = () if number % 3 == 2 else (0.002 + 1e-5 * number, 0.0111)
    samples = (np.arange(600) + number) % 256 / 255
    return Reading(
        number=number,
        sweep=sweep,
        ping=0,
        angle=math.radians(5 * number) if angle is None else angle,
        time=0.1 * number,
        echo_times=echoes,
        speed_of_sound=SPEED,
        temperature_c=21.37,
        trace=Trace(samples, 50_000.0, 0.0005) if trace else None,
    )


def write_example(path: Path, count: int = 12, *, trace: bool = False) -> list[Reading]:
    """Write a log of `count` readings; returns them."""
    readings = [example_reading(number, trace=trace) for number in range(count)]
    write_scan(path, METADATA, readings)
    return readings


def assert_readings_close(read: Reading, written: Reading) -> None:
    """What a log gives back is what was written, to what the wire carries."""
    assert (read.number, read.sweep, read.ping) == (written.number, written.sweep, written.ping)
    assert abs(read.angle - written.angle) <= math.radians(0.51e-6)
    assert abs(read.time - written.time) <= 0.51e-6
    assert len(read.echo_ranges) == len(written.echo_ranges)
    for got, wanted in zip(read.echo_ranges, written.echo_ranges, strict=True):
        assert abs(got - wanted) <= 0.2e-6
    assert (read.temperature_c is None) == (written.temperature_c is None)
    if written.temperature_c is not None:
        assert abs((read.temperature_c or 0.0) - written.temperature_c) <= 0.0051
    assert (read.trace is None) == (written.trace is None)
    if read.trace is not None and written.trace is not None:
        assert abs(read.trace.rate - written.trace.rate) < 1e-6 * written.trace.rate
        assert abs(read.trace.start - written.trace.start) <= 1e-9
        assert np.abs(read.trace.samples - written.trace.samples).max() <= 0.5 / 255 + 1e-12
