"""Random mixtures of faults: every scan is complete and every reading is correct."""

import random

from tests.conftest import Count
from tests.fixtures.bench import Bench
from tests.fixtures.faulty_boards import faulty
from tests.fixtures.plain_echoes import assert_scanned
from tests.unit.sonarhw.device.test_faults import SECTOR

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
