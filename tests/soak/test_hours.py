"""Memory during long scans with traces: a minute in a normal run, with `--soak` an hour, on a virtual clock."""

import sys
from contextlib import nullcontext
from pathlib import Path

import pytest

from sonarhw.host.scripts import configuring
from sonarhw.log import LogWriter, read_log
from sonarhw.wire.messages import StartScan
from tests.conftest import Count
from tests.fixtures.bench import TRACES, Bench
from tests.fixtures.example_logs import METADATA

SWEEP = 180  # headings, some 18 s
SLACK = 1000  # temporary allocated blocks
INDEX = 24  # allocated blocks per reading in the index that closes a log, less than a kilobyte


@pytest.mark.parametrize("recorded", [False, True], ids=["scanning", "recording"])
def test_memory_grows_only_by_the_index_of_the_log(tmp_path: Path, count: Count, recorded: bool) -> None:
    sweeps = count(4, 200)
    path = tmp_path / "hour.mcap"
    bench = Bench().connect()
    with LogWriter(path, METADATA) if recorded else nullcontext() as writer:
        bench.session.recording.use(writer)
        half, end = blocks_while_scanning(bench, sweeps)
    readings = (sweeps - 1 - sweeps // 2) * SWEEP
    assert end - half < SLACK + (INDEX * readings if recorded else 0)
    if recorded:
        log = read_log(path)
        assert log.torn is None
        assert len(log.readings) == sweeps * SWEEP


def blocks_while_scanning(bench: Bench, sweeps: int) -> tuple[int, int]:
    """Return the numbers of allocated blocks after half of the sweeps and after all but one."""
    bench.do(configuring(TRACES))
    scan, sizes = bench.scan(StartScan(0, 1_000_000, SWEEP, sweeps, 1)), []
    for sweep in (sweeps // 2, sweeps - 1):
        while not scan.readings or scan.readings[-1].number < sweep * SWEEP:
            bench.echoes.pings.clear()
            while len(scan.readings) > 1:
                scan.readings.popleft()
            bench.step()
        sizes.append(sys.getallocatedblocks())
    bench.until(lambda: scan.done)
    return sizes[0], sizes[1]
