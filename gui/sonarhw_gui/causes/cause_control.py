"""Starts, observes and cancels the search for causes, which runs in a thread; at most one at a time."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Slot

from sonarhw.readings import Reading
from sonarhw_gui.run_control import RunControl
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import room_and_place
from sonarhw_gui.shown.shown import Shown
from sonarhw_gui.work.run_progress import RunProgress

if TYPE_CHECKING:
    from sonarhw_compare.rooms.causes import FoundCauses

_MOST_READINGS = 360  # the newest ones; the time of a search is proportional to their number


@dataclass(frozen=True, eq=False)
class CausesAnswer:
    """The result of a search."""

    request: "CauseRequest"
    found: "FoundCauses"


@dataclass(frozen=True)
class CauseRequest:
    """Search for the causes of misfits."""

    scene: Scene
    readings: tuple[Reading, ...]
    first: int  # number of the first of them among the readings shown
    progress: RunProgress = field(compare=False)

    def answer(self) -> CausesAnswer:
        """Run the search, which takes about ten seconds. Raises InputError."""
        from sonarhw_compare.rooms.causes import find_causes  # takes half a second

        room, place = room_and_place(self.scene)
        progress = self.progress
        found = find_causes(
            self.readings,
            room,
            place,
            self.scene.board,
            tick=lambda share: progress.report(share, "searching"),
            cancelled=lambda: progress.cancelled,
        )
        return CausesAnswer(self, found)


@dataclass(frozen=True)
class CausesState:
    """State of the search: none, running, or finished."""

    running: bool = False
    share: float = 0.0
    answer: CausesAnswer | None = None


class CauseControl(RunControl):
    """At most one search at a time."""

    def __init__(self, shown: Callable[[], Shown], parent: QObject) -> None:
        """`shown`: returns what the window shows."""
        super().__init__("causes", CausesState(), parent)
        self._shown = shown

    @Slot()
    def start(self) -> None:
        """Search for changes of the room that explain misfits of the readings shown; a running search is cancelled."""
        shown = self._shown()
        newest = shown.readings[-_MOST_READINGS:]
        request = CauseRequest(shown.scene, newest, len(shown.readings) - len(newest), RunProgress())
        self._run(request, self._running(request.progress))

    def _running(self, progress: RunProgress) -> CausesState:
        return CausesState(running=True, share=progress.share)

    def _finished(self, answer: CausesAnswer) -> CausesState:
        return CausesState(answer=answer)
