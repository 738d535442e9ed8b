"""Starts, observes, cancels and continues the search for the room, which runs in a thread; at most one at a time."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal, Slot
from sonarhw_compare.room_edit import remove_surface
from sonarhw_sim.air import Air
from sonarhw_sim.room.model import Room

from sonarhw_gui.finding.find_request import (
    Accuracy,
    FindProgress,
    FindRequest,
    Hypotheses,
    LoadedScan,
    NextAnswer,
    NextRequest,
    RoomAnswer,
)
from sonarhw_gui.finding.loaded_scans import loaded_scans
from sonarhw_gui.shown.shown import Shown
from sonarhw_gui.work.worker import Failure, Worker

if TYPE_CHECKING:
    from sonarhw_compare.room_finding.draft import DraftPost, DraftWall
    from sonarhw_compare.room_finding.next_place import NextPlace


@dataclass(frozen=True, eq=False)
class FindState:
    """State of the search."""

    running: str = ""  # what runs: "searching" or "planning"; empty: nothing
    share: float = 0.0
    tried: int = 0  # rooms
    hypotheses: Hypotheses | None = None  # without those rejected
    answer: RoomAnswer | None = None  # of a complete search, also after walls of it were rejected
    refused: "tuple[DraftWall | DraftPost, ...]" = ()
    places: "tuple[NextPlace, ...]" = ()  # to scan next, best first
    accepted: bool = False  # whether `answer` was made the room of the window

    @property
    def whole(self) -> bool:
        """Whether there is a complete result, of which nothing was rejected."""
        return self.answer is not None and self.hypotheses is self.answer.hypotheses

    @property
    def room(self) -> Room | None:
        """The room that was found, without what was rejected; None without a complete result, or without walls."""
        if self.answer is None or self.hypotheses is None or not self.hypotheses.draft.walls:
            return None
        room, kept = self.answer.room, {support.name for support in self.hypotheses.supports}
        for name in self.answer.room.names:
            if name not in kept:
                room = remove_surface(room, room.names.index(name))
        return room


class FindControl(QObject):
    """At most one search at a time."""

    changed = Signal(object)  # FindState
    failed = Signal(str)

    def __init__(self, shown: Callable[[], Shown], name: Callable[[], str], parent: QObject) -> None:
        """`shown` returns what the window shows, `name` the name of the scan in it."""
        super().__init__(parent)
        self._shown, self._name = shown, name
        self.state = FindState()
        self._progress: FindProgress | None = None
        self._newest: Hypotheses | None = None  # that `state` has
        self._worker: Worker | None = None
        self._request: FindRequest | None = None  # the newest search

    @Slot(object)
    def start(self, accuracy: Accuracy) -> None:
        """Start a search without walls in the loaded scans; a running one is cancelled."""
        if scans := self._scans:
            self._search(FindRequest(scans, self._air, accuracy, None, (), FindProgress()), FindState())

    @Slot(object)
    def go_on(self, accuracy: Accuracy) -> None:
        """Continue from the accepted and edited room, or else from the list; rejected walls are not found again."""
        state, scans, room = self.state, self._scans, self._shown().scene.room
        if state.hypotheses is None or not scans:
            return
        refused, found = state.refused, state.answer
        # edits of a room keep its name
        if state.accepted and found is not None and room is not None and room.name == found.room.name:
            from sonarhw_compare.room_finding.draft import draft_of_room

            start = draft_of_room(room)
            named = zip(state.hypotheses.shapes, state.hypotheses.supports, strict=True)
            refused += tuple(shape for shape, support in named if support.name not in room.names)
        else:
            start = state.hypotheses.draft
        request = FindRequest(scans, self._air, accuracy, start, refused, FindProgress())
        self._search(request, replace(state, refused=refused))

    @Slot(int)
    def reject(self, row: int) -> None:
        """Remove a wall or post from the list; a running search is continued without it."""
        state = self.state
        if state.hypotheses is None or not 0 <= row < len(state.hypotheses.supports):
            return
        rest, refused = state.hypotheses.without(row), (*state.refused, state.hypotheses.shapes[row])
        self._set_state(replace(state, hypotheses=rest, refused=refused, places=()))
        if state.running and self._request is not None:
            again = replace(self._request, start=rest.draft, refused=refused, progress=FindProgress())
            self._search(again, self.state)

    @Slot()
    def plan_next(self) -> None:
        """Find where to scan next."""
        if self.state.answer is not None and not self.state.running:
            request = NextRequest(self.state.answer, FindProgress())
            self._run(request, replace(self.state, running="planning", places=()))

    @Slot()
    def note_accepted(self) -> None:
        """Note that the result was made the room of the window."""
        self._set_state(replace(self.state, accepted=True))

    @Slot()
    def cancel(self) -> None:
        """End what runs; walls found so far stay in the list."""
        if self._progress is not None:
            self._progress.cancel()
            self._progress = None
            self._set_state(replace(self.state, running=""))

    def tick(self) -> None:
        """Emit progress and result."""
        if self._worker is None:
            return
        for answer in self._worker.take():
            self._accept(answer)
        if self._progress is not None:
            self._follow(self._progress)

    def close(self) -> None:
        """End the thread."""
        self.cancel()
        if self._worker is not None:
            self._worker.close()

    @property
    def _scans(self) -> tuple[LoadedScan, ...]:
        return loaded_scans(self._shown(), self._name())

    @property
    def _air(self) -> Air:
        room = self._shown().scene.room
        return Air() if room is None else room.air

    def _search(self, request: FindRequest, state: FindState) -> None:
        self._request = request
        self._run(request, replace(state, running="searching", places=()))

    def _run(self, request: FindRequest | NextRequest, state: FindState) -> None:
        self.cancel()
        if self._worker is None:
            self._worker = Worker("find the room")
        self._progress, self._newest = request.progress, None
        self._worker.submit(request)
        self._set_state(replace(state, share=0.0, tried=0))

    def _follow(self, progress: FindProgress) -> None:
        state = replace(self.state, share=progress.share, tried=progress.tried)
        newest = progress.newest
        if newest is not self._newest:
            self._newest = newest
            state = replace(state, hypotheses=newest, answer=None, accepted=False)
        if (state.share, state.tried, state.hypotheses) != self._followed:
            self._set_state(state)

    @property
    def _followed(self) -> tuple[float, int, Hypotheses | None]:
        return self.state.share, self.state.tried, self.state.hypotheses

    def _accept(self, answer: RoomAnswer | NextAnswer | Failure) -> None:
        request = answer.request
        if not isinstance(request, FindRequest | NextRequest) or request.progress is not self._progress:
            return  # cancelled in the meantime
        self._progress = None
        match answer:
            case RoomAnswer():
                state = replace(self.state, hypotheses=answer.hypotheses, answer=answer, accepted=False)
                self._set_state(replace(state, running="", share=1.0))
            case NextAnswer():
                self._set_state(replace(self.state, running="", places=answer.places))
            case Failure():
                self._set_state(replace(self.state, running=""))
                self.failed.emit(answer.message)

    def _set_state(self, state: FindState) -> None:
        self.state = state
        self.changed.emit(state)
