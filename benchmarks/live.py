"""Processor time and memory of a live scan with traces: `python -m benchmarks.live [SECONDS]`.

Runs `sonarhw scan --traces` against `sonarhw fake` in real time, at 10 pings per second, once briefly and once for
SECONDS more (60), and prints the difference in processor time and memory. Both runs include the start of a process.
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

ROOM = Path(__file__).parents[1] / "rooms" / "simple.toml"
SONARHW = (sys.executable, "-c", "from sonarhw_cli.entry import main; main()")
SWEEP = 60  # headings; a turn of one degree takes no longer than a ping


@contextmanager
def fake() -> Iterator[str]:
    """Run a fake scanner in real time; yields its URL."""
    command = [*SONARHW, "fake", str(ROOM), "--place", "figure9", "--tcp", "127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
        process.terminate()


def cost(url: str, sweeps: int) -> tuple[float, float, float]:
    """Return wall clock and processor time of a scan, s, and its peak memory, MB."""
    if sys.platform == "win32":
        raise NotImplementedError("Windows has no wait4")
    with TemporaryDirectory() as folder:
        options = ["--to", str(SWEEP), "--step", "1", "--sweeps", str(sweeps), "--traces"]
        command = [*SONARHW, "scan", url, "--out", f"{folder}/scan.mcap", *options]
        began = time.monotonic()
        process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        assert process.returncode == 0
        return time.monotonic() - began, used.ru_utime + used.ru_stime, used.ru_maxrss / 1000


def main() -> None:
    """Print the figures."""
    more = max(1, round(float(sys.argv[1]) * 10 / SWEEP)) if len(sys.argv) > 1 else 10
    with fake() as url:
        cost(url, 1)  # compiles the kernels
        brief, long = cost(url, 1), cost(url, 1 + more)
    wall, processor, memory = (b - a for a, b in zip(brief, long, strict=True))
    print(f"{more * SWEEP} readings with traces in {wall:.1f} s, {more * SWEEP / wall:.1f} per second")
    print(f"processor {processor:.2f} s: {processor / wall:.3f} of one core")
    print(f"memory    {memory:+.1f} MB on {brief[2]:.0f} MB")


if __name__ == "__main__":
    main()
