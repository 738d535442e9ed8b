"""Run the tests of one mutant, in a copy of the checkout and in a process of its own."""

import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import numba
import pytest

from tests.mutation.mutants import Mutant

ROOTS = (".", "sim", "compare", "gui", "cli")  # of the installed packages
_LIBRARIES = ("numba", "scipy.signal", "scipy.optimize", "scipy.special", "matplotlib.pyplot", "pydantic", "serial")
_LIBRARIES += ("hypothesis.strategies", "PySide6.QtCore", "coverage", "mcap.reader", "tomlkit", "pyarrow.parquet")
_QUIET = ("-W", "ignore:Module already imported:pytest.PytestAssertRewriteWarning")
_STARTUP = 45.0  # s
_SLOWER = 4.0  # times the recorded duration of the tests, then the mutant does not end
_WAIT = 4.0  # times the processor time: a mutant that waits for ever uses none
_POLL = 0.05  # s
_FIRST = 8  # tests that run by themselves first, because they detect most mutants, and few files are collected for them
_OTHER_TIME = 100_000_000_000  # ns, so that Python sees that a source file has changed


class Tree:
    """A private copy of the checkout, in which one file at a time is mutated.

    Compiled kernels are kept: their names contain a digest of their source, so a mutant uses only unchanged ones.
    """

    def __init__(self, folder: Path, startup: float = _STARTUP) -> None:
        """`startup` is the processor time for imports and the compilation of kernels, s."""
        self.folder = folder
        self.startup = startup
        self._kernels = folder.with_name(f"{folder.name}-kernels")
        _add_kernels(folder / "sim" / "sonarhw_sim" / "__pycache__", self._kernels)

    def survives(self, mutant: Mutant, tests: Sequence[str], seconds: float) -> bool:
        """Return whether all `tests` pass with the mutant. They take `seconds` without it."""
        file = self.folder / mutant.path
        source, times = file.read_bytes(), file.stat()
        file.write_bytes(mutant.applied(source))
        os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns - _OTHER_TIME))
        try:
            parts = [[*tests[:_FIRST]], [*tests[_FIRST:]]]
            return all(self._pass(part, _SLOWER * seconds / len(tests)) for part in parts if part)
        finally:
            file.write_bytes(source)
            os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))

    def _pass(self, tests: list[str], each: float) -> bool:
        """Return whether the tests pass. A test that fails once only does not detect the mutant."""
        while (failed := self._failure(tests, each)) is not None:
            if failed not in tests or self._failure([failed], each) is not None:
                return False
            tests.remove(failed)
        return True

    def _failure(self, tests: Sequence[str], each: float) -> str | None:
        """Return the first test that fails; "" if the tests do not run to their end, None if all pass."""
        processor_time = self.startup + each * len(tests)
        scratch = Path(tempfile.mkdtemp(prefix="mutant-"))
        _add_kernels(self._kernels, scratch / "kernels")
        child = os.fork()
        if child == 0:
            _run_tests(self.folder, tests, processor_time, scratch)
        try:
            if _status(child, _WAIT * processor_time) == 0:
                return None
            failed = scratch / "failed"
            return failed.read_text() if failed.exists() else ""
        finally:
            _add_kernels(scratch / "kernels", self._kernels)
            shutil.rmtree(scratch, ignore_errors=True)


def _add_kernels(source: Path, target: Path) -> None:
    """Link the compiled kernels of one folder into another, which deletes and replaces its own links only."""
    target.mkdir(exist_ok=True)
    for kernel in source.glob("*.kernel"):
        with suppress(FileExistsError):
            os.link(kernel, target / kernel.name)


def _status(child: int, seconds: float) -> int:
    """Return the exit status of a process and end everything that it has started; not 0 if it takes longer."""
    deadline = time.monotonic() + seconds
    while True:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended or time.monotonic() > deadline:
            break
        time.sleep(_POLL)
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    if not ended:
        _, status = os.waitpid(child, 0)
    return status


def _run_tests(folder: Path, tests: Sequence[str], processor_time: float, scratch: Path) -> None:
    """Run tests in this process, and exit with status 0 if all pass."""
    os.setsid()
    output = os.open(scratch / "output", os.O_WRONLY | os.O_CREAT)
    for stream in (1, 2):
        os.dup2(output, stream)
    resource.setrlimit(resource.RLIMIT_CPU, (round(processor_time), round(processor_time) + 5))
    sys.dont_write_bytecode = True
    os.chdir(folder)
    roots = [str(folder / root) for root in ROOTS]
    sys.path[:0] = roots
    os.environ["PYTHONPATH"] = os.pathsep.join(roots)
    os.environ["TMPDIR"] = tempfile.tempdir = str(scratch)
    numba.config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"] = str(scratch / "kernels")
    # the tests of this driver are loaded already, from another folder
    for name in [name for name in sys.modules if name.partition(".")[0] == "tests"]:
        del sys.modules[name]
    status = 1
    arguments = ["-x", "-q", "--tb=line", "-p", "no:cacheprovider", "--basetemp", f"{scratch}/t", *_QUIET, *tests]
    try:
        status = pytest.main(arguments, [_Failure(scratch / "failed")])
    except BaseException:
        traceback.print_exc()
        raise
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(int(status))


class _Failure:
    """A plugin of pytest that writes the name of a test that fails to a file."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self._file.write_text(report.nodeid)


def preload() -> None:
    """Import the libraries of the product once, so that each mutant does not import them again."""
    for name in _LIBRARIES:
        import_module(name)
