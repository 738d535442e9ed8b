"""Options of the whole suite: how long the long tests run, and a scanner of one's own."""

from collections.abc import Callable

import pytest

pytest_plugins = ["tests.fixtures.window_scene"]

Count = Callable[[int, int], int]


def pytest_addoption(parser: pytest.Parser) -> None:
    """`--soak` and `--url`."""
    parser.addoption("--soak", action="store_true", help="run the long tests in full: hours instead of minutes")
    parser.addoption("--url", help="hold the contract suite against the scanner at this URL, and no other")


@pytest.fixture(scope="session")
def count(request: pytest.FixtureRequest) -> Count:
    """Of two counts, the one for every day and the one for a soak, the one asked for."""
    soak = request.config.getoption("--soak")
    return lambda everyday, full: full if soak else everyday
