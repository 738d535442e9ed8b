"""Garbage of the window is freed in its own thread, even if another thread reaches the collector's threshold."""

import gc
import threading
import weakref

import pytest
from pytestqt.qtbot import QtBot
from sonarhw_gui.shell.garbage import collected_between_events

from tests.system.gui.driving import until


class _Ring:
    """A reference cycle, which only the collector frees."""

    def __init__(self) -> None:
        self.myself = self


@pytest.fixture
def freed_by() -> list[threading.Thread]:
    return []


def leave_garbage(freed_by: list[threading.Thread]) -> None:
    weakref.finalize(_Ring(), lambda: freed_by.append(threading.current_thread()))


def overflow(kept: list[list[int]]) -> None:
    """Allocate enough objects to start automatic collection."""
    kept.extend([] for _ in range(200_000))


def test_an_allocating_thread_does_not_free_objects_of_the_window(
    qtbot: QtBot, freed_by: list[threading.Thread]
) -> None:
    kept: list[list[int]] = []
    with collected_between_events():
        leave_garbage(freed_by)
        thread = threading.Thread(target=overflow, args=(kept,))
        thread.start()
        thread.join()
        assert freed_by == []
        until(qtbot, lambda: freed_by == [threading.main_thread()])


def test_automatic_collection_is_enabled_afterwards() -> None:
    with collected_between_events():
        assert not gc.isenabled()
    assert gc.isenabled()
