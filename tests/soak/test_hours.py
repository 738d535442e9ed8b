"""Memory during long scans with traces: a minute in a normal run, with `--soak` an hour, on a virtual clock."""

import sys
from pathlib import Path

import pytest

from sonarhw.log import LogWriter, read_log
from sonarhw.wire.messages import StartScan
from tests.conftest import Count
from tests.fixtures.example_logs import METADATA
from tests.fixtures.joined import Joined

SWEEP = 180  # headings, some 18 s
SLACK = 1000  # temporary allocated blocks
INDEX = 24  # allocated blocks per reading in the index that closes a log, less than a kilobyte


@pytest.mark.parametrize("recorded", [False, True], ids=["scanning", "recording"])
def test_memory_grows_only_by_the_index_of_the_log(tmp_path: Path, count: Count, recorded: bool) -> None:
    sweeps = count(4, 200)
    path = tmp_path / "hour.mcap"
    if recorded:
        with LogWriter(path, METADATA) as writer:
            half, end = blocks_while_scanning(Joined(recorder=writer), sweeps)
    else:
        half, end = blocks_while_scanning(Joined(), sweeps)
    readings = (sweeps - 1 - sweeps // 2) * SWEEP
    assert end - half < SLACK + (INDEX * readings if recorded else 0)
    if recorded:
        log = read_log(path)
        assert log.torn is None
        assert len(log.readings) == sweeps * SWEEP


def blocks_while_scanning(joined: Joined, sweeps: int) -> tuple[int, int]:
    """Return the numbers of allocated blocks after half of the sweeps and after all but one."""
    joined.greet(trace=True)
    scan, sizes = joined.ask(StartScan(0, 1_000_000, SWEEP, sweeps, 1)), []
    for sweep in (sweeps // 2, sweeps - 1):
        while not joined.readings or joined.readings[-1].number < sweep * SWEEP:
            joined.echoes.pings.clear()
            del joined.readings[:-1]
            joined.step()
        sizes.append(sys.getallocatedblocks())
    joined.until(lambda: scan.finished is not None)
    return sizes[0], sizes[1]
