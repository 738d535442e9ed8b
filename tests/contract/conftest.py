"""Every test here runs against every scanner of `scanners.py`, or against the one at `--url`."""

from collections.abc import Iterator

import pytest

from sonarhw.link import Link
from tests.contract.scanners import SCANNERS
from tests.contract.talk import Talk


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """One run of each test a scanner."""
    if "url" in metafunc.fixturenames:
        names = ["--url"] if metafunc.config.getoption("--url") else [*SCANNERS]
        metafunc.parametrize("url", names, indirect=True, scope="session")


@pytest.fixture(scope="session")
def url(request: pytest.FixtureRequest) -> Iterator[str]:
    """Where the scanner is."""
    if request.param == "--url":
        yield request.config.getoption("--url")
    else:
        with SCANNERS[request.param]() as served:
            yield served


@pytest.fixture
def talk(url: str) -> Iterator[Talk]:
    """A conversation with the scanner, after its greeting."""
    with Link(url) as link:
        talk = Talk(link)
        talk.greet()
        yield talk
        talk.stop()
