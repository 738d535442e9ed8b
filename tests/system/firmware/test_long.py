"""Long runs of the firmware, and hostile bytes in a build with sanitizers.

A soak is longer than 36 minutes, after which the ticks of the timer wrap.
"""

import subprocess
from pathlib import Path

import numpy as np
import pytest

from sonarhw import sector
from tests.conftest import Count
from tests.system.firmware.combinations.images import FREE_STACK as FREE_STACK_UNO
from tests.system.firmware.combinations.images import MEGA, UNO
from tests.system.firmware.conftest import Echoes, scanner_on
from tests.system.firmware.emulated.test_emulated_board import FREE_STACK
from tests.system.firmware.emulated.test_emulated_echoes import TWO_TICKS


@pytest.mark.parametrize(("combination", "traces", "free"), [(MEGA, True, FREE_STACK), (UNO, False, FREE_STACK_UNO)])
def test_repeated_scans_stay_correct(count: Count, combination: str, traces: bool, free: int) -> None:
    times = (0.0151, 0.0337, 0.0604)
    with scanner_on(Echoes(*times), combination=combination) as (_, scanner):
        scanner.configure(trace=traces)
        fired = []
        for _ in range(count(1, 1_500)):
            readings = list(scanner.scan(sector(0, 60, 5)))
            assert sorted(reading.number for reading in readings) == [*range(12)]
            for reading in readings:
                assert reading.echo_times == pytest.approx(times, rel=0, abs=TWO_TICKS)
                assert (reading.trace is not None) == traces
                # echoes, the end of re-arming, the clock and bytes from the host cost a few samples
                assert reading.trace is None or np.isnan(reading.trace.samples).sum() <= 16
                fired.append(reading.time)
        statistics = scanner.device_statistics()
        assert statistics.rejected == statistics.overruns == statistics.lost_steps == 0
        assert statistics.stack_free >= free
    assert np.diff(fired).min() > 0.0999


def test_hostile_sessions_cause_no_error(built: Path, count: Count) -> None:
    for seed in range(count(2, 200)):
        assert subprocess.run([built / "fuzz", "1000", str(seed)], check=False).returncode == 0


def test_random_bytes_cause_no_error(built: Path) -> None:
    noise = b"".join(bytes([(n * n * 2654435761 >> 13) & 0xFF]) for n in range(60_000))
    assert subprocess.run([built / "fuzz"], input=noise, check=False).returncode == 0
