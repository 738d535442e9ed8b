"""When the model of the views updates them."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QObject
from sonarhw_gui.jobs.jobs import Jobs
from sonarhw_gui.model.look import Look
from sonarhw_gui.model.scene import Scene
from sonarhw_gui.session import showing
from sonarhw_gui.session.kept import NoteStore
from sonarhw_gui.session.notices import Notices
from sonarhw_gui.session.scanner import Live, ScanSettings
from sonarhw_gui.session.showing import ShownModel
from sonarhw_sim.board.profile import load_board


class Clock:
    """A clock that the test sets."""

    now = 100.0  # s

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(showing, "time", clock)
    return clock


@pytest.fixture
def model(tmp_path: Path) -> Iterator[ShownModel]:
    owner = QObject()
    jobs, notices = Jobs(owner), Notices(owner)
    live = Live(None, ScanSettings(tmp_path), notices, lambda: None)
    scene = Scene(None, None, load_board("polaroid-6500"))
    yield ShownModel(scene, Look(), lambda: live, jobs, NoteStore(None, notices), notices.warn, owner)
    jobs.close()


def test_results_of_a_fast_scan_are_shown_with_its_next_readings(
    model: ShownModel, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    updates: list[float] = []
    model.changed.connect(lambda _: updates.append(clock.now))
    finished = iter((False, True, False, True, False, False))
    monkeypatch.setattr(model.forecast, "take", lambda: next(finished))
    for now, readings in ((0.0, True), (0.02, False), (0.03, True), (0.05, False), (0.06, False), (0.08, False)):
        clock.now = now
        model.tick(readings)
    assert updates == [0.0, 0.03, 0.08]  # the last results come without further readings
