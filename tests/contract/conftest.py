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
from tests.contract.scanners import DIRECT, LONG, ONE_LINE, SCANNERS
from tests.contract.talk import DirectLine, Talk
from tests.fixtures.text_devices.printing_device import SKETCHES, PrintingDevice


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run each test once per scanner; with the mark `one_line`, over one kind of line, unless --soak is given.

    The devices without a port have the tests of single messages, and alone those with the mark `direct`.
    """
    if "line" in metafunc.fixturenames:
        metafunc.parametrize("line", _scanners_of(metafunc), indirect=True, scope="module")


def _scanners_of(metafunc: pytest.Metafunc) -> list[str]:
    direct = [] if "free_url" in metafunc.fixturenames else [*DIRECT]
    if metafunc.config.getoption("--url"):
        return ["--url"]
    if metafunc.config.getoption("--soak"):
        return sorted([*SCANNERS, *direct])
    if metafunc.definition.get_closest_marker("direct"):
        return direct
    if metafunc.definition.get_closest_marker("one_line"):
        return [*direct, ONE_LINE]
    return sorted(SCANNERS.keys() - set(LONG))


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """With `--url`, select only the tests that use the scanner."""
    if given := config.getoption("--url"):
        wanted = "plugin_url" if is_plugin(given) else "line"
        chosen = [item for item in items if isinstance(item, pytest.Function) and wanted in item.fixturenames]
        config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
        items[:] = chosen


class OpenLine:
    """A line to the scanner, which many tests share, because opening is slow on some lines."""

    def __init__(self, url: str = "", direct: DirectLine | None = None) -> None:
        self.url = url
        self._direct, self._link = direct, None if direct else Link(url)

    def talk(self) -> Talk:
        """Return a new conversation."""
        if self._direct:
            return Talk(self._direct, self._direct.clock)
        self._link = self._link or Link(self.url)
        return Talk(self._link)

    @property
    def baud(self) -> int:
        """The baud rate of a device without a port."""
        assert self._direct
        return self._direct.baud()

    def close(self) -> None:
        """Close the line, so that another client can open it."""
        if self._link is not None:
            self._link.close()
            self._link = None


@pytest.fixture(scope="module")
def line(request: pytest.FixtureRequest) -> Iterator[OpenLine]:
    """Provide the line to the scanner. If no scanner answers at `--url`, end all tests."""
    with ExitStack() as exit_stack:
        if request.param in DIRECT:
            yield OpenLine(direct=exit_stack.enter_context(DIRECT[request.param]()))
            return
        if request.param == "--url":
            url = _answering(request.config.getoption("--url"), exit_stack)
        else:
            url = exit_stack.enter_context(SCANNERS[request.param]())
        shared = OpenLine(url)
        yield shared
        shared.close()


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


@pytest.fixture
def talk(line: OpenLine) -> Iterator[Talk]:
    """Provide a conversation with the scanner, already greeted."""
    talk = line.talk()
    talk.greet()
    yield talk
    talk.greet()  # some tests let the conversation end
    talk.stop()


@pytest.fixture
def free_url(line: OpenLine) -> str:
    """Return the URL of the scanner, with no client connected."""
    line.close()
    return line.url
