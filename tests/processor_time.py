"""The processor time of each test, of its process and of the programs that it ran to their end.

A machine with other work makes tests wait; their processor time stays about the same. `--slowest N` prints the sum of
all tests and the N tests that need most.
"""

import os
from collections import Counter
from collections.abc import Generator

import pytest

_NAME = "processor time"
_last = pytest.StashKey[float]()


def _spent() -> float:
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--slowest`."""
    parser.addoption("--slowest", type=int, default=0, metavar="N", help="print the N tests with most processor time")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Start to count before the fixtures of a test are made."""
    item.stash[_last] = _spent()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add to each report of setup, call and teardown what they needed."""
    report = yield
    now = _spent()
    report.user_properties.append((_NAME, now - item.stash[_last]))
    item.stash[_last] = now
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Print the tests that need most."""
    needed: Counter[str] = Counter()
    for report in (report for reports in terminalreporter.stats.values() for report in reports):
        for name, seconds in getattr(report, "user_properties", ()):
            if name == _NAME:
                needed[report.nodeid] += seconds
    if most := config.getoption("--slowest"):
        terminalreporter.section(f"processor time of all tests: {needed.total():.0f} s; the slowest tests")
        for test, seconds in needed.most_common(most):
            terminalreporter.line(f"{seconds:7.1f} s  {test}")
