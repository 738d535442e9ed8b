"""Run every test of this folder with every scanner of `scanners.py`, or with the scanner at `--url` only.

`--url` is a serial port, `socket://HOST:PORT` or `'fake:ROOM?place=NAME&pace=10'`; for the URL of a device that prints
text, or of another plug-in, the tests of `test_own_text_device.py` run. If no scanner answers there, the tests end with
one line. The pace of a fake must not be `max`: it would never detect a silent host.
"""

from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from sonarhw_cli.inputs import resolve
from sonarhw_compare.scanner_url import open_scanner

from sonarhw.errors import SonarError
from sonarhw.host.scanner import Scanner
from sonarhw.link import Link
from sonarhw.plugins.device_plugin import is_plugin
from tests.contract.scanners import LONG, ONE_LINE, SCANNERS
from tests.contract.talk import Talk
from tests.fixtures.text_devices.printing_device import SKETCHES, PrintingDevice


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run each test once per scanner; tests with the mark `one_line` over one kind of line, unless --soak is given."""
    if "url" in metafunc.fixturenames:
        soak = metafunc.config.getoption("--soak")
        usual = ONE_LINE if metafunc.definition.get_closest_marker("one_line") else [*(SCANNERS.keys() - set(LONG))]
        names = ["--url"] if metafunc.config.getoption("--url") else sorted(SCANNERS if soak else usual)
        metafunc.parametrize("url", names, indirect=True, scope="module")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """With `--url`, select only the tests that use the scanner."""
    if given := config.getoption("--url"):
        wanted = "plugin_url" if is_plugin(given) else "url"
        chosen = [item for item in items if isinstance(item, pytest.Function) and wanted in item.fixturenames]
        config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
        items[:] = chosen


@pytest.fixture(scope="module")
def url(request: pytest.FixtureRequest) -> Iterator[str]:
    """Return the URL of the scanner. If no scanner answers at `--url`, end all tests."""
    if request.param == "--url":
        with ExitStack() as exit_stack:
            yield _answering(request.config.getoption("--url"), exit_stack)
    else:
        with SCANNERS[request.param]() as served:
            yield served


def _answering(given: str, exit_stack: ExitStack) -> str:
    """Return the URL to open for the one given, after a scanner has answered there."""
    try:
        served = exit_stack.enter_context(resolve(given))()
        Scanner.open(served).close()
    except SonarError as error:
        pytest.exit(f"--url {given}: no scanner to test: {str(error).removeprefix(f'{given}: ')}", returncode=2)
    return served


@pytest.fixture(scope="package")
def plugin_url(request: pytest.FixtureRequest) -> Iterator[str]:
    """Return the URL of a device that prints text. If none prints at `--url`, end all tests."""
    given = request.config.getoption("--url")
    if given:
        try:
            open_scanner(given).close()
        except SonarError as error:
            pytest.exit(f"--url {given}: no device to test: {str(error).removeprefix(f'{given}: ')}", returncode=2)
        yield given
    else:
        sketch = SKETCHES["radar 15 to 165"]
        with PrintingDevice(sketch.rounds()) as device:
            yield f"lines:{device.port}?{sketch.query}"


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


@pytest.fixture(scope="module")
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
