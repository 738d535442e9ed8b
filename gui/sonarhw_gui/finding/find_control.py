"""Starts, observes, cancels and continues the search for the room, which runs in a thread; at most one at a time."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal, Slot
from sonarhw_compare.edits import remove_surface
from sonarhw_sim.air import Air
from sonarhw_sim.room.room import Room

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
from sonarhw_gui.run_control import RunControl
from sonarhw_gui.scene.scene import Scene, room_name
from sonarhw_gui.shown.overlaid_scan import OverlaidScan
from sonarhw_gui.shown.shown import Shown

if TYPE_CHECKING:
    from sonarhw_compare.rooms.draft import DraftPost, DraftWall
    from sonarhw_compare.rooms.outcome import NextPlace


@dataclass(frozen=True, eq=False)
class FindState:
    """State of the search."""

    running: str = ""  # what runs: "searching" or "planning"; empty: nothing
    share: float = 0.0
    hypotheses: Hypotheses | None = None  # without those rejected
    answer: RoomAnswer | None = None  # of a complete search, also after walls of it were rejected
    refused: "tuple[DraftWall | DraftPost, ...]" = ()
    places: "tuple[NextPlace, ...]" = ()  # to scan next, best first; of those tried so far
    accepted: bool = False  # whether `answer` was made the room of the window
    searched_in: tuple[str, str] = ("", "")  # name and file of the room shown when the search began

    def is_in(self, scene: Scene) -> bool:
        """Return whether the walls belong to the room of a scene: that of the search, or the accepted one."""
        found = self.answer is not None and self.accepted and room_name(scene) == self.answer.room.name
        return found or room_of(scene) == self.searched_in

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


class FindControl(RunControl):
    """At most one search at a time."""

    state: FindState
    settled = Signal()  # the scans or the scene of a search that has failed were changed

    def __init__(self, shown: Callable[[], Shown], name: Callable[[], str], parent: QObject) -> None:
        """`shown` returns what the window shows, `name` the name of the scan in it."""
        super().__init__("find the room", FindState(), parent)
        self._shown, self._name = shown, name
        self._newest: Hypotheses | None = None  # that `state` has
        self._request: FindRequest | None = None  # the newest search
        self._failed_with: tuple[Scene, tuple[OverlaidScan, ...]] | None = None
        self.failed.connect(self._note_failure)

    def tick(self) -> None:
        """Emit progress and result, and whether the cause of a failure may be gone."""
        super().tick()
        failed, now = self._failed_with, self._searched
        if failed is not None and any(one is not other for one, other in zip(failed, now, strict=True)):
            self._failed_with = None
            self.settled.emit()

    @Slot()
    def _note_failure(self) -> None:
        self._failed_with = self._searched

    @property
    def _searched(self) -> tuple[Scene, tuple[OverlaidScan, ...]]:
        return self._shown().scene, self._shown().overlays

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
            from sonarhw_compare.rooms.draft import draft_of_room

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
            self._begin(request, replace(self.state, running="planning", places=()))

    @Slot()
    def note_accepted(self) -> None:
        """Note that the result was made the room of the window."""
        self._set_state(replace(self.state, accepted=True))

    @property
    def _scans(self) -> tuple[LoadedScan, ...]:
        return loaded_scans(self._shown(), self._name())

    @property
    def _air(self) -> Air:
        room = self._shown().scene.room
        return Air() if room is None else room.air

    def _search(self, request: FindRequest, state: FindState) -> None:
        self._request = request
        self._begin(request, replace(state, running="searching", places=(), searched_in=room_of(self._shown().scene)))

    def _begin(self, request: FindRequest | NextRequest, state: FindState) -> None:
        self._newest = None
        self._run(request, replace(state, share=0.0))

    def _idle(self) -> FindState:
        """Return the state with the walls found so far."""
        return replace(self.state, running="") if self.state.running else self.state

    def _running(self, progress: FindProgress) -> FindState:
        state = self.state
        if progress.newest is not self._newest:
            self._newest = progress.newest
            state = replace(state, hypotheses=progress.newest, answer=None, accepted=False)
        if (progress.share, progress.places) != (state.share, state.places):
            state = replace(state, share=progress.share, places=progress.places)
        return state

    def _finished(self, answer: RoomAnswer | NextAnswer) -> FindState:
        if isinstance(answer, NextAnswer):
            return replace(self.state, running="", places=answer.places)
        found = replace(self.state, hypotheses=answer.hypotheses, answer=answer, accepted=False)
        return replace(found, running="", share=1.0)


def room_of(scene: Scene) -> tuple[str, str]:
    """Return name and file of the room of a scene, which edits do not change; empty without a room."""
    return room_name(scene), scene.room_file if scene.room is not None else ""
