"""Every test here runs against every scanner of `scanners.py`, or against the one at `--url`."""

from collections.abc import Iterator

import pytest

from sonarhw.link.serial_link import Link
from tests.contract.scanners import SCANNERS
from tests.contract.talk import Talk


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """One run of each test a scanner."""
    if "url" in metafunc.fixturenames:
        names = ["--url"] if metafunc.config.getoption("--url") else [*SCANNERS]
        metafunc.parametrize("url", names, indirect=True, scope="package")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """With `--url`, only what concerns that scanner."""
    if config.getoption("--url"):
        chosen = [item for item in items if isinstance(item, pytest.Function) and "url" in item.fixturenames]
        config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
        items[:] = chosen


@pytest.fixture(scope="package")
def url(request: pytest.FixtureRequest) -> Iterator[str]:
    """Where the scanner is."""
    if request.param == "--url":
        yield request.config.getoption("--url")
    else:
        with SCANNERS[request.param]() as served:
            yield served


class OpenLink:
    """One link for many tests: opening one takes long on some lines."""

    def __init__(self, url: str) -> None:
        self.url = url
        self._link: Link | None = None

    def link(self) -> Link:
        """The link, open."""
        if self._link is None:
            self._link = Link(self.url)
        return self._link

    def close(self) -> None:
        """Leave the line to somebody else."""
        if self._link is not None:
            self._link.close()
            self._link = None


@pytest.fixture(scope="package")
def open_link(url: str) -> Iterator[OpenLink]:
    """The link that tests share."""
    shared = OpenLink(url)
    yield shared
    shared.close()


@pytest.fixture
def talk(open_link: OpenLink) -> Iterator[Talk]:
    """A conversation with the scanner, after its greeting."""
    talk = Talk(open_link.link())
    talk.greet()
    yield talk
    talk.stop()


@pytest.fixture
def free_url(open_link: OpenLink) -> str:
    """Where the scanner is, with nobody on the line."""
    open_link.close()
    return open_link.url
