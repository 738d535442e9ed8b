"""Options of all tests: `--soak` for long runs, `--url` for your own scanner."""

import gc
import signal
from collections.abc import Callable, Generator
from pathlib import Path

import pytest
from hypothesis import settings

pytest_plugins = ["tests.fixtures.leaks", "tests.fixtures.window_scene", "tests.processor_time"]

Count = Callable[[int, int], int]
# These tests repeat what others cover, and Python code runs at half of its speed while coverage is measured.
NOT_MEASURED = (
    "contract/test_lines.py",
    "contract/test_scanner.py",
    "soak",
    "system/cli/comparison/test_calibrate.py",
    "system/cli/prediction/test_figures_command.py",
    "system/compare/test_fit.py",
    "system/compare/test_locate.py",
    "system/docs",
    "system/firmware",
    "system/sim",
    "system/test_notebook.py",
)


def pytest_configure(config: pytest.Config) -> None:
    """Repeat the same generated examples in every run but --soak, on a machine of any speed.

    Let the commands under test be interrupted: a shell may have started pytest with these signals ignored.
    """
    settings.register_profile("any speed", derandomize=not config.getoption("--soak"), deadline=None, print_blob=True)
    settings.load_profile("any speed")
    for number in (signal.SIGINT, signal.SIGHUP):
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--soak` and `--url`."""
    parser.addoption("--soak", action="store_true", help="run the long tests completely: hours instead of minutes")
    parser.addoption("--url", help="run the contract tests with the scanner at this URL only")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Leave the collected tests out of garbage collection, which would take a third of the time of collecting them."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Import no file without the word of `-k`, so that it is answered in seconds; computed names are not found."""
    word = config.getoption("keyword").lower()
    if not word.isidentifier() or not collection_path.match("test_*.py"):
        return None
    return word not in f"{collection_path}\n{collection_path.read_text(encoding='utf-8')}".lower() or None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect the tests with the mark `soak`, unless --soak is given."""
    if not config.getoption("--soak"):
        long = [item for item in items if item.get_closest_marker("soak")]
        config.hook.pytest_deselected(items=long)
        items[:] = [item for item in items if item not in long]


def pytest_itemcollected(item: pytest.Item) -> None:
    """Exclude the tests in NOT_MEASURED from the measurement of coverage."""
    path = item.path.relative_to(Path(__file__).parent).as_posix()
    if path.startswith(NOT_MEASURED):
        item.add_marker("no_cover")


@pytest.fixture(scope="session")
def count(request: pytest.FixtureRequest) -> Count:
    """Return a function that selects the second of two counts with --soak, and else the first."""
    soak = request.config.getoption("--soak")
    return lambda normal, full: full if soak else normal
