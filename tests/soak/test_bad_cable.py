"""One flipped bit and one lost byte per 10 000: a scan is complete and correct, and the statistics show the damage."""

import numpy as np

from sonarhw.wire.messages import StartScan
from tests.conftest import Count
from tests.fixtures.bench import Bench
from tests.fixtures.faulty_boards import faulty
from tests.fixtures.plain_echoes import assert_scanned

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
