"""An hour of scanning as a log: `python -m benchmarks.logs [HOURS]`.

Writes 36 000 readings per hour with traces of 3 250 samples, as a scanner with 10 pings per second sends them. Prints
the share of one core and the memory that writing needs, and the duration of opening and seeking for a closed log, one
torn at its end, and one damaged in its middle. Each step is a separate process with its own memory.
"""

import math
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from sonarhw.device.replayed_log import Playback
from sonarhw.log import Log, LogMetadata, LogWriter, read_log
from sonarhw.readings import Reading, Trace
from sonarhw.wire.frames import Frame, encode_frame
from sonarhw.wire.messages import Info, Message, Settings, Started
from sonarhw.wire.readings_of_frames import reading_message, trace_chunks

PERIOD = 0.1  # s from ping to ping
HEADINGS = 360
SPEED = 343.2
SEEKS = 200
STARTED = 1_790_000_000.0


def conversation(hours: float) -> Iterator[tuple[float, list[bytes], Reading | None]]:
    """Yield time, frames, and the reading that they complete: a greeting, then a scan of many sweeps."""
    count = round(hours * 3600 / PERIOD)
    sequence = 0

    def frame(message: Message, at: float) -> bytes:
        nonlocal sequence
        sequence = (sequence + 1) % 0x10000
        return encode_frame(Frame(message.TYPE, sequence, round(at * 1e6), message.pack()))

    greeting = (
        Info(0, 1, 0, "benchmark", "", "", 2000, 50_000, 3200),
        Settings(1, 65_000, 2380, 1, round(SPEED * 1000)),
        Started(2, count),
    )
    yield STARTED, [frame(message, 0.0) for message in greeting], None
    echoes = np.exp(-np.linspace(0, 8, 3250)) * np.random.default_rng(1).random((64, 3250))
    for number in range(count):
        at = PERIOD * number
        reading = Reading(
            number=number,
            sweep=number // HEADINGS,
            ping=0,
            angle=math.tau * (number % HEADINGS) / HEADINGS,
            time=at,
            echo_times=(0.004 + 1e-6 * (number % 977), 0.011),
            speed_of_sound=SPEED,
            temperature_c=20.0,
            trace=Trace(echoes[number % 64], 50_000.0, 0.0005),
        )
        assert reading.trace is not None
        messages = [reading_message(reading, round(SPEED * 1000)), *trace_chunks(number, reading.trace)]
        yield STARTED + at, [frame(message, at + 0.07) for message in messages], reading


def memory() -> float:
    """Return the peak memory of this process, MB."""
    if sys.platform == "win32":
        raise NotImplementedError("Windows, which has no getrusage")
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def write(path: Path, hours: float) -> list[str]:
    """Write the log; the time is that of the writer only."""
    spent, before = 0.0, 0.0
    with path.open("wb") as file, LogWriter(file, LogMetadata("scan", STARTED)) as log:
        for number, (at, frames, reading) in enumerate(conversation(hours)):
            began = time.perf_counter()
            for wire in frames:
                log.frame(True, at, wire)
            if reading is not None:
                log.reading(reading)
            spent += time.perf_counter() - began
            if number == 1000:
                before = memory()
        grown = memory() - before
        began = time.perf_counter()
    closed = time.perf_counter() - began
    return [
        f"{path.stat().st_size / 1e6:.0f} MB",
        f"writing takes {spent / (hours * 3600):.1%} of one core",
        f"its memory grows by {grown:.0f} MB",
        f"closing takes {closed:.2f} s",
    ]


def opened(path: Path) -> list[str]:
    """Open the log and seek in it, by time, by sweep and by reading, each with its trace."""
    before = memory()
    began = time.perf_counter()
    log = read_log(path)
    took = time.perf_counter() - began
    longest = max(seek_times(log))
    return [
        f"opens in {took:.2f} s",
        f"{len(log.readings)} readings",
        f"longest of {SEEKS} seeks {longest * 1e3:.1f} ms",
        f"{memory() - before:.0f} MB",
        log.torn or "whole",
    ]


def seek_times(log: Log) -> Iterator[float]:
    """Yield the duration of many random seeks, including the trace, s."""
    playback, chance = Playback(log), random.Random(1)
    seeks = (
        lambda: playback.seek(chance.uniform(0, playback.duration)),
        lambda: playback.seek_sweep(0, chance.randrange(log.readings[-1].sweep)),
        lambda: playback.seek_reading(chance.randrange(len(log.readings))),
    )
    for number in range(SEEKS):
        began = time.perf_counter()
        seeks[number % 3]()
        trace = log.readings[playback.count - 1].trace
        assert trace is not None
        assert len(trace.samples) == 3250
        yield time.perf_counter() - began


def in_its_own_process(step: str, path: Path, hours: float) -> None:
    """Run a step in its own process and print its row."""
    command = [sys.executable, "-m", "benchmarks.logs", str(hours), step, str(path)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    print(f"{path.stem:12}{done.stdout.strip()}", flush=True)


def main() -> None:
    """Print a row for each log."""
    hours = float(sys.argv[1]) if len(sys.argv) > 1 else 1.0
    if len(sys.argv) > 2:
        step, path = sys.argv[2], Path(sys.argv[3])
        print("; ".join(write(path, hours) if step == "write" else opened(path)))
        return
    with tempfile.TemporaryDirectory() as folder:
        closed, torn, damaged = (Path(folder) / f"{name}.mcap" for name in ("closed", "torn", "damaged"))
        in_its_own_process("write", closed, hours)
        in_its_own_process("open", closed, hours)
        size = closed.stat().st_size
        for copy in (torn, damaged):
            shutil.copyfile(closed, copy)
        os.truncate(torn, size * 19 // 20)
        in_its_own_process("open", torn, hours)
        with damaged.open("r+b") as file:
            file.seek(size // 2)
            file.write(bytes(4096))
        in_its_own_process("open", damaged, hours)


if __name__ == "__main__":
    main()
