"""Run every test of this folder with every scanner of `scanners.py`, or with the scanner at `--url` only."""

from collections.abc import Iterator

import pytest

from sonarhw.link.serial_link import Link
from tests.contract.scanners import SCANNERS
from tests.contract.talk import Talk


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run each test once per scanner."""
    if "url" in metafunc.fixturenames:
        names = ["--url"] if metafunc.config.getoption("--url") else [*SCANNERS]
        metafunc.parametrize("url", names, indirect=True, scope="package")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """With `--url`, select only the tests that use the scanner."""
    if config.getoption("--url"):
        chosen = [item for item in items if isinstance(item, pytest.Function) and "url" in item.fixturenames]
        config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
        items[:] = chosen


@pytest.fixture(scope="package")
def url(request: pytest.FixtureRequest) -> Iterator[str]:
    """Return the URL of the scanner."""
    if request.param == "--url":
        yield request.config.getoption("--url")
    else:
        with SCANNERS[request.param]() as served:
            yield served


class OpenLink:
    """One link shared by many tests, because opening is slow on some lines."""

    def __init__(self, url: str) -> None:
        self.url = url
        self._link: Link | None = None

    def link(self) -> Link:
        """Return the link; open it if necessary."""
        if self._link is None:
            self._link = Link(self.url)
        return self._link

    def close(self) -> None:
        """Close the link, so that another client can open the line."""
        if self._link is not None:
            self._link.close()
            self._link = None


@pytest.fixture(scope="package")
def open_link(url: str) -> Iterator[OpenLink]:
    """Provide the shared link."""
    shared = OpenLink(url)
    yield shared
    shared.close()


@pytest.fixture
def talk(open_link: OpenLink) -> Iterator[Talk]:
    """Provide a conversation with the scanner, already greeted."""
    talk = Talk(open_link.link())
    talk.greet()
    yield talk
    talk.stop()


@pytest.fixture
def free_url(open_link: OpenLink) -> str:
    """Return the URL of the scanner, with no client connected."""
    open_link.close()
    return open_link.url
