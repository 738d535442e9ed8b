"""Finding where the scanner stood: a fit in a thread of its own, with its progress, and what has come of it.

Takes scene, readings and what is free; hands on how far it is, then the answers, each with the scene it leads to. The
window's session asks it every tick for what is new.
"""

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal, Slot
from sonarhw_compare.matching.match import compare_readings
from sonarhw_sim.room.model import Room

from sonarhw.readings import Reading
from sonarhw_gui.scene.fit_scene import fitted
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import furnished
from sonarhw_gui.work.worker import Failure, Worker

if TYPE_CHECKING:
    from sonarhw_compare.fit import FitResult, Parameter

NEAR = 0.25  # m: how far off a place may be that somebody put there by hand
_SAMPLES = 8000  # of the posterior: some 300 of them are independent
_MOST_READINGS = 720  # the newest: more tell no more about one place


@dataclass(frozen=True)
class FitWish:
    """What a fit may choose, in words of `values.parameters`, and whether the whole room is searched."""

    free: tuple[str, ...] = ("position", "heading", "offset")
    everywhere: bool = False


@dataclass(frozen=True)
class Answer:
    """One answer of a fit."""

    values: "Mapping[Parameter, float]"
    within_5cm: float | None  # share of the echoes, in the scene that it leads to


@dataclass(frozen=True, eq=False)
class Found:
    """What a fit has come to."""

    request: "FitRequest"
    result: "FitResult"
    within_5cm: float | None  # share of the echoes, in the scene it was made in
    answers: tuple[Answer, ...]  # the best first


@dataclass(frozen=True)
class FitState:
    """How it stands: nothing asked for, at work, or done."""

    running: bool = False
    share: float = 0.0
    doing: str = ""
    found: Found | None = None


class Watch:
    """What a fit at work and whoever waits for it tell each other."""

    def __init__(self) -> None:
        self.share, self.doing = 0.0, "beginning"
        self._stop = threading.Event()

    def tell(self, share: float, doing: str) -> None:
        """So far it is."""
        self.share, self.doing = share, doing

    def cancel(self) -> None:
        """Nobody waits for it any more."""
        self._stop.set()

    @property
    def cancelled(self) -> bool:
        """Whether it should end."""
        return self._stop.is_set()


@dataclass(frozen=True)
class FitRequest:
    """Where did the scanner stand?"""

    scene: Scene
    readings: tuple[Reading, ...]
    wish: FitWish
    watch: Watch = field(compare=False)

    def answer(self) -> Found:
        """Find it, in some ten seconds. Raises InputError, Cancelled."""
        from sonarhw_compare.fit import (  # half a second, which only the first fit takes
            FitOptions,
            PlacedScan,
            fit_scans,
        )

        scene, watch = self.scene, self.watch
        room, place = furnished(scene)
        result = fit_scans(
            [PlacedScan(self.readings, place, "this scan")],
            room,
            scene.board,
            self._free(room),
            options=FitOptions(scene.options, samples=_SAMPLES),
            progress=watch.tell,
            cancelled=lambda: watch.cancelled,
        )
        answers = tuple(self._answer(values) for values in _values(result))
        return Found(self, result, self._within_5cm(scene), answers)

    def _free(self, room: Room) -> "tuple[Parameter, ...]":
        from sonarhw_compare.fit import free_parameters

        parameters = free_parameters(self.wish.free, ["this scan"], room, self.scene.board)
        if self.wish.everywhere:
            return parameters
        at = dict(zip("xy", self.scene.standing.position, strict=True))
        return tuple(
            replace(one, lower=at[one.kind] - NEAR, upper=at[one.kind] + NEAR) if one.kind in at else one
            for one in parameters
        )

    def _answer(self, values: "Mapping[Parameter, float]") -> Answer:
        scene, _ = fitted(self.scene, values, self.scene.board)
        return Answer(values, self._within_5cm(scene))

    def _within_5cm(self, scene: Scene) -> float | None:
        room, _ = furnished(scene)
        compared = compare_readings(self.readings, room, scene.standing, scene.board, options=scene.options)
        return compared.summary().within_5cm


def _values(result: "FitResult") -> "list[Mapping[Parameter, float]]":
    """The values of every answer; of the best the estimates, which are surer than its peak."""
    best = {one: result.estimates[one.name].value for one in result.parameters}
    return [best, *({one: mode.values[one.name] for one in result.parameters} for mode in result.modes[1:])]


class Fitting(QObject):
    """At most one fit at a time."""

    changed = Signal(object)  # FitState
    failed = Signal(str)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self.state = FitState()
        self._watch: Watch | None = None
        self._worker: Worker | None = None

    def start(self, wish: FitWish, scene: Scene, readings: tuple[Reading, ...]) -> None:
        """Begin; one that is at work is given up."""
        self.forget()
        if self._worker is None:
            self._worker = Worker("fit")
        self._watch = Watch()
        self._worker.ask(FitRequest(scene, readings[-_MOST_READINGS:], wish, self._watch))
        self._tell(FitState(running=True, doing=self._watch.doing))

    @Slot()
    def forget(self) -> None:
        """Give up what is at work, and put away what was found."""
        if self._watch is not None:
            self._watch.cancel()
        self._watch = None
        self._tell(FitState())

    def tick(self) -> None:
        """Tell what has happened."""
        if self._worker is None:
            return
        for answer in self._worker.take():
            self._take(answer)
        if self._watch is not None:
            self._tell(FitState(running=True, share=self._watch.share, doing=self._watch.doing))

    def close(self) -> None:
        """End the thread."""
        self.forget()
        if self._worker is not None:
            self._worker.close()

    def _take(self, answer: Found | Failure) -> None:
        request = answer.request
        if not isinstance(request, FitRequest) or request.watch is not self._watch:
            return  # given up meanwhile
        if isinstance(answer, Found):
            self._watch = None
            self._tell(FitState(found=answer))
        else:
            self.forget()
            self.failed.emit(answer.message)

    def _tell(self, state: FitState) -> None:
        if state != self.state:
            self.state = state
            self.changed.emit(state)
