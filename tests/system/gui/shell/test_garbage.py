"""Garbage of the window is freed in its own thread, even if another thread reaches the collector's threshold.

Large blocks of freed memory go back to the system.
"""

import gc
import subprocess
import sys
import threading
import weakref

import pytest
from pytestqt.qtbot import QtBot
from sonarhw_gui.window.garbage import collected_between_events

from tests.system.gui.driving import until

# the resident memory, MiB, that 100 arrays of 1 MiB leave when they are freed; small arrays between them stay
_FREED = """
import numpy as np
from pathlib import Path
from sonarhw_gui.window.garbage import return_large_blocks

def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 2**20

{setting}
np.ones(3 * 2**20)  # 24 MiB, freed at once: glibc raises its limit for blocks that it returns
before = resident()
pairs = [(np.ones(2**17), np.ones(1000)) for _ in range(100)]
kept = [small for _, small in pairs]
del pairs
print(resident() - before)
"""


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


def test_objects_from_before_the_window_and_of_imports_are_not_searched(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def is_searched(ring: _Ring) -> bool:
        return any(known is ring for known in gc.get_objects())

    early = _Ring()
    assert is_searched(early)
    with collected_between_events():
        late = _Ring()
        assert not is_searched(early)
        assert is_searched(late)
        for number in range(20):
            monkeypatch.setitem(sys.modules, f"imported_{number}", sys)
        until(qtbot, lambda: not is_searched(late))


@pytest.mark.skipif(sys.platform != "linux", reason="a setting of glibc")
def test_freed_arrays_between_small_objects_go_back_to_the_system() -> None:
    def left(setting: str) -> float:
        command = [sys.executable, "-c", _FREED.format(setting=setting)]
        return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)

    assert left("return_large_blocks()") < 10
    assert left("") > 50  # otherwise the setting is not needed
