"""Lost steps are reported, and no reading with a wrong angle is reported as verified."""

import math
import random
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from sonarhw.errors import LostSteps
from sonarhw.host.scripts import homing, scanning
from sonarhw.log import LogWriter, copy_log, read_log
from sonarhw.readings import Reading, first_unverified, lost_steps_clause, split_at_homings, unverified_clause
from sonarhw.wire.messages import StartScan
from tests.fixtures.bench import Bench
from tests.fixtures.example_logs import METADATA
from tests.fixtures.faulty_boards import faulty
from tests.fixtures.plain_echoes import echo_time

WHOLE_TURN = StartScan(0, 5_000_000, 72, 1, 1)
FAULTS = ["wedge@r5", "wedge=0.3@r30", "slip=40@r5", "slip=-3@r70", "slip@r72"]


def scan_that_loses_steps(bench: Bench, order: StartScan) -> tuple[list[Reading], str]:
    """Run a scan that loses steps; return its readings and the text of the error."""
    job = scanning(order)
    with pytest.raises(LostSteps) as error:
        bench.do(job, within=600)
    return [*job.readings], str(error.value)


def whole_torn_and_copied(log: Path) -> list[Path]:
    """Return the log, a torn copy of it, and a repaired copy of that."""
    torn, copied = log.with_name("torn.mcap"), log.with_name("copied.mcap")
    torn.write_bytes(log.read_bytes()[:-30])
    copy_log(read_log(torn), copied)
    return [log, torn, copied]


@pytest.mark.parametrize("faults", FAULTS)
def test_steps_lost_in_a_single_sweep_are_reported(faults: str, tmp_path: Path) -> None:
    path, bench = tmp_path / "scan.mcap", Bench(faulty(faults))
    with LogWriter(path, METADATA) as log:
        bench.session.recording.use(log)
        readings, message = scan_that_loses_steps(bench, WHOLE_TURN)
    assert len(readings) == 72
    assert "microsteps from its place" in message
    assert "72 readings are kept; all 72 angles may be wrong, from 0° on" in message
    assert "\n" not in message
    for file in whole_torn_and_copied(path):
        (scan,) = read_log(file).scans
        assert len(scan.readings) == 72
        assert scan.angle_warning == "the turntable lost steps; all 72 angles may be wrong, from 0° on"


@pytest.mark.parametrize("seed", range(12))
def test_no_verified_reading_has_a_wrong_angle(seed: int) -> None:
    choice = random.Random(seed)
    step = choice.choice([-1, 1]) * choice.choice([2, 5, 7.5])
    order = StartScan(
        start=choice.randrange(-400, 400) * 1_000_000,
        step=round(step * 1e6),
        headings=choice.randrange(2, 40),
        sweeps=choice.randrange(1, 5),
        pings=choice.randrange(1, 3),
    )
    total = order.headings * order.sweeps * order.pings
    fault = choice.choice(["wedge=0.4", "wedge", "slip=3", "slip=-200"])
    readings, message = scan_that_loses_steps(Bench(faulty(f"{fault}@r{choice.randrange(1, total + 1)}")), order)
    angles = np.array([reading.angle for reading in readings])
    assert str(lost_steps_clause([angles])) in message
    for reading in readings[: first_unverified(angles)]:
        assert reading.echo_times[0] == pytest.approx(echo_time(reading.angle), abs=2e-9)


@pytest.mark.parametrize("seed", range(6))
def test_only_reported_readings_before_a_homing_have_wrong_angles(seed: int) -> None:
    choice = random.Random(seed)
    order = StartScan(choice.randrange(-400, 0) * 1_000_000, choice.choice([5, 7]) * 1_000_000, 40, 2, 1)
    slip = choice.randrange(1, 40)
    reset = slip + choice.randrange(1, 8)
    bench = Bench(faulty(f"slip=30@r{slip},reset@r{reset}"))
    job = scanning(order)
    with suppress(LostSteps):  # the turntable may pass the mark before the reset
        bench.do(job, within=600)
    times, angles = zip(*((reading.time, reading.angle) for reading in job.readings), strict=True)
    correct = [reading.echo_times[0] == pytest.approx(echo_time(reading.angle), abs=2e-9) for reading in job.readings]
    if job.error:
        assert all(correct[: first_unverified(np.array(angles))])
        return
    before, after = split_at_homings(times, angles, [times[reset - 1]])
    first = first_unverified(before)
    assert (len(before), len(after)) == (reset, 80 - reset)
    assert str(job.unverified_angles).startswith(
        f"{reset - first} of 80 angles, from {math.degrees(before[first]):.6g}° on"
    )
    assert all(correct[:first] + correct[reset:])
    assert not all(correct)


def test_readings_are_split_at_a_homing() -> None:
    times, angles = [0.0, 1.0, 2.0, 5.0, 3.0], np.radians([-20.0, -10.0, 0.0, 30.0, 20.0])
    runs = split_at_homings(times, [*angles], [1.0])
    assert [run.tolist() for run in runs] == [[*angles[:2]], [angles[2], angles[4], angles[3]]]
    assert unverified_clause(runs[:1]) is None
    assert "2 of 5 angles, from -20° on" in str(unverified_clause(runs))
    assert lost_steps_clause(runs) == "the last 3 of 5 angles may be wrong, from 0° on"
    assert lost_steps_clause([angles, angles[:0]]) is None


def test_steps_lost_before_the_first_reading_are_an_error_without_angles() -> None:
    bench = Bench(faulty("slip=40@6"))
    bench.do(homing())
    bench.wait(6.5 - bench.now)
    # the turntable passes the mark at 360° on its way to the first heading
    with pytest.raises(LostSteps) as error:
        bench.do(scanning(StartScan(400_000_000, 1_000_000, 3, 1, 1)))
    assert "40 microsteps" in str(error.value)
    assert "kept" not in str(error.value)
