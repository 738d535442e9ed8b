"""Faults of every kind, mixed at random: every scan completes, every reading right."""

import random

from tests.conftest import Count
from tests.fixtures.faulty_boards import faulty
from tests.fixtures.plugged import Plugged
from tests.unit.sonarhw.device.test_under_faults import SECTOR, assert_right

LASTING = ("drop=1/2000", "flip=1/2000", "insert=1/2000", "drift=300", "drift=-3000", "protocol=1.9")
PASSING = ("stall", "deaf", "mute", "reset", "nonsense", "unplug", "move")


def schedule(chance: random.Random) -> str:
    """Some of what lasts, and up to three kinds of what passes; each leaves the scan time to go on."""
    entries = chance.sample(LASTING, chance.randrange(3))
    for name in chance.sample(PASSING, chance.randrange(1, 4)):
        size = chance.choice((0.05, 0.3, 0.7, 0.8, 1.5, 3.0))
        moment = chance.choice((f"@r{chance.randrange(1, 80)}", f"@{chance.uniform(0, 12):.3f}", "@~15"))
        entries.append(f"{name}={size}{moment}")
    # each lasting fault once, as a schedule wants it
    return ",".join({entry.partition("=")[0]: entry for entry in entries}.values())


def test_a_scan_recovers_from_every_mixture_of_faults(count: Count) -> None:
    chance = random.Random(23)
    for run in range(count(15, 1500)):
        faults = schedule(chance)
        plugged = Plugged(faulty(faults, seed=run), vanishes=run % 2 == 0, seed=run)
        if not plugged.meet():
            continue  # lost before it was met: nobody waits for it
        try:
            readings = plugged.scan(SECTOR, trace=run % 3 == 0)
            assert sorted(reading.number for reading in readings) == list(range(80))
            assert_right(readings)
        except BaseException as error:
            error.add_note(f"faults {faults}, run {run}")
            raise
