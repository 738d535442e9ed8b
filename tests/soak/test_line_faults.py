"""Faults of the line: damaged bytes, random mixtures of faults, and cables pulled at random moments."""

import random

import numpy as np

from sonarhw.wire.messages import StartScan
from tests.conftest import Count
from tests.fixtures.bench import Bench
from tests.fixtures.faulty_boards import faulty
from tests.fixtures.plain_echoes import assert_scanned
from tests.unit.sonarhw.device.test_faults import SECTOR

# one flipped bit and one lost byte per 10 000


SHARE = 1 / 10_000
WHOLE_TURN = StartScan(start=0, step=1_000_000, headings=360, sweeps=1, pings=1)


def test_a_scan_over_a_bad_cable_is_complete_and_correct_and_the_statistics_show_it(count: Count) -> None:
    for seed in range(count(2, 200)):
        bench = Bench(faulty(f"flip={SHARE},drop={SHARE}", seed)).connect()
        readings = bench.scanned(WHOLE_TURN, trace=True)
        assert_scanned(readings, WHOLE_TURN)
        gaps = sum(reading.trace is None or np.isnan(reading.trace.samples).any() for reading in readings)
        books = bench.session.statistics
        damages = 2 * SHARE * books.bytes_received
        assert damages / 2 < books.rejected_blocks < 1.5 * damages
        assert damages / 2 < books.missing_frames < 3 * damages
        assert damages / 2 < gaps < 1.5 * damages
        assert books.lost_readings == 0


# random mixtures of faults: every scan is complete and every reading is correct


LASTING = ("drop=1/2000", "flip=1/2000", "insert=1/2000", "drift=300", "drift=-3000", "protocol=1.9")
SHORT = ("stall", "deaf", "mute", "reset", "nonsense", "unplug", "move")


def schedule(chance: random.Random) -> str:
    """Return a random schedule of lasting faults and of one to three kinds of short faults that a scan survives."""
    entries = chance.sample(LASTING, chance.randrange(3))
    for name in chance.sample(SHORT, chance.randrange(1, 4)):
        size = chance.choice((0.05, 0.3, 0.7, 0.8, 1.5, 3.0))
        moment = chance.choice((f"@r{chance.randrange(1, 80)}", f"@{chance.uniform(0, 12):.3f}", "@~15"))
        entries.append(f"{name}={size}{moment}")
    # a schedule may contain each lasting fault only once
    return ",".join({entry.partition("=")[0]: entry for entry in entries}.values())


def test_a_scan_recovers_from_every_mixture_of_faults(count: Count) -> None:
    chance = random.Random(23)
    for run in range(count(15, 1500)):
        faults = schedule(chance)
        bench = Bench(faulty(faults, seed=run), vanishes=run % 2 == 0, seed=run)
        if bench.connect().session.failed:
            continue  # a loss before the first greeting is an error and is not retried
        try:
            readings = bench.scanned(SECTOR, trace=run % 3 == 0)
            assert_scanned(readings, SECTOR)
        except BaseException as error:
            error.add_note(f"faults {faults}, run {run}")
            raise


# each unplug is detected within a second, and every scan completes


WITHIN = 1.0  # s


def test_every_pulled_cable_is_detected_within_a_second_and_every_scan_completes(count: Count) -> None:
    chance, noticed, unnoticed = random.Random(8), [0.0], [0.0]
    run = 0
    while len(noticed) + len(unnoticed) < 2 + count(12, 200):
        # a board powered by its cable is reset too; the port may vanish, stay, or return under another name
        fault, seconds = chance.choice(("unplug", "move")), chance.choice((0.1, 0.5, 1.5, 4.0))
        powered = f",reset={seconds + 0.5}@~15" if run % 3 == 0 else ""
        bench = Bench(faulty(f"{fault}={seconds}@~10{powered}", seed=run), vanishes=run % 2 == 0, seed=run)
        readings = bench.scanned(SECTOR, trace=run % 4 == 0)
        assert_scanned(readings, SECTOR)
        noticed += bench.noticed
        unnoticed += bench.unnoticed
        run += 1
    assert max(noticed) <= WITHIN
    assert max(unnoticed) <= WITHIN
