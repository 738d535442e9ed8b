"""Processor time and response times of the window: `python -m benchmarks.window [--full] [JOB ...]`.

Opens real windows, on Xvfb if there is no display, and prints a table: dragging the sensor with all views open among
many walls and in the laboratory, a live scan with traces, a log of an hour, its replay at 50×, thousands of repaints,
the first window, and the files that a reading and a drag cross. With `--full` the replay runs for an hour. Every job
is a separate process.

Times by the wall clock are valid only on an idle machine. Processor times are therefore printed too, and the load at
the start. With the necessary permission, `nice -n -10` approaches an idle machine.
"""

import argparse
import json
import os
import platform
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from importlib.metadata import version

from sonarhw_gui.window.display import NoDisplay, check_display

from benchmarks.cases.window_jobs import Figure, dragging, first_window, journeys, laboratory, live, long_log, repaints

_XVFB = ("xvfb-run", "--auto-servernum", "--server-args=-screen 0 1920x1080x24 -noreset")
_LIBRARIES = ("PySide6-Essentials", "pyqtgraph", "numpy", "numba")
_FULL_HOUR = 3600.0  # s


def jobs(full: bool) -> dict[str, Callable[[], list[Figure]]]:
    """Return the jobs by name."""
    return {
        "start": lambda: first_window(float(os.environ[_BEGAN])),
        "drag": lambda: dragging(20.0 if full else 8.0),
        "laboratory": laboratory,
        "live": lambda: live(60.0 if full else 15.0),
        "log": lambda: long_log(_FULL_HOUR if full else 40.0),
        "repaints": lambda: repaints(10_000),
        "journeys": journeys,
    }


_BEGAN = "SONARHW_BENCHMARK_BEGAN"
# `sonarhw gui` and `sonarhw demo` collect no garbage while they import
_AS_COMMAND = "import gc; gc.disable(); from benchmarks.window import main; main()"


def in_its_own_process(job: str, full: bool) -> list[Figure]:
    """Run a job in its own process. Raises CalledProcessError if it fails."""
    command = [sys.executable, "-c", _AS_COMMAND, "--only", job, *(["--full"] if full else [])]
    # some container images forbid bytecode: then each start compiles all modules again, as no user's does
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    environment[_BEGAN] = str(time.time())
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, env=environment, text=True)
    return [Figure(**figure) for figure in json.loads(done.stdout.splitlines()[-1])]


def machine() -> str:
    """Return the machine, the versions and the load."""
    if sys.platform == "win32":
        raise NotImplementedError("Windows, which has no load")
    with_what = ", ".join(f"{name} {version(name)}" for name in _LIBRARIES)
    load = " ".join(f"{share:.1f}" for share in os.getloadavg())
    return (
        f"{platform.machine()}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}, "
        f"{with_what}\nload when it began, over 1, 5 and 15 minutes: {load}"
    )


def row(figure: Figure) -> str:
    """Return a row of the table."""
    target, verdict = "", ""
    if figure.target is not None:
        met = figure.measured >= figure.target if figure.at_least else figure.measured <= figure.target
        target = f"{'≥' if figure.at_least else '≤'} {figure.target:g}"
        verdict = "yes" if met else "NO"
    return (
        f"{figure.what:<84} {figure.measured:>9.3g} {figure.unit:<13} {target:>7} {verdict:<4} {figure.note}".rstrip()
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.window")
    parser.add_argument("jobs", nargs="*", metavar="JOB", help=f"of {', '.join(jobs(False))}; default: all")
    parser.add_argument("--full", action="store_true", help="play the long log for an hour")
    parser.add_argument("--only", choices=jobs(False), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.only:
        print(json.dumps([asdict(figure) for figure in jobs(options.full)[options.only]()]))
        return
    try:
        check_display()
    except NoDisplay:
        if shutil.which(_XVFB[0]) is None:
            raise
        os.execvp(_XVFB[0], [*_XVFB, sys.executable, "-m", "benchmarks.window", *sys.argv[1:]])
    print(machine(), flush=True)
    chosen = options.jobs or list(jobs(options.full))
    if "start" in chosen:
        in_its_own_process("start", options.full)  # compiles the kernels and modules
    for job in chosen:
        for figure in in_its_own_process(job, options.full):
            print(row(figure), flush=True)


if __name__ == "__main__":
    main()
