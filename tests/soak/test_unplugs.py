"""Cables pulled at random moments: each unplug is detected within a second, and every scan completes."""

import random

from tests.conftest import Count
from tests.fixtures.bench import Bench
from tests.fixtures.faulty_boards import faulty
from tests.fixtures.plain_echoes import assert_scanned
from tests.unit.sonarhw.device.test_faults import SECTOR

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
