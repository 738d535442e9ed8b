"""Options of all tests: `--soak` for long runs, `--url` for your own scanner."""

from collections.abc import Callable

import pytest

pytest_plugins = ["tests.fixtures.window_scene"]

Count = Callable[[int, int], int]


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--soak` and `--url`."""
    parser.addoption("--soak", action="store_true", help="run the long tests completely: hours instead of minutes")
    parser.addoption("--url", help="run the contract tests with the scanner at this URL only")


@pytest.fixture(scope="session")
def count(request: pytest.FixtureRequest) -> Count:
    """Return a function that selects the second of two counts with --soak, and else the first."""
    soak = request.config.getoption("--soak")
    return lambda normal, full: full if soak else normal
