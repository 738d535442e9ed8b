"""A request to find where the scanner stood by a fit, its progress, and its answer."""

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from sonarhw_compare.matching.match import compare_readings
from sonarhw_sim.room.model import Room

from sonarhw.readings import Reading
from sonarhw_gui.scene.fit_scene import fitted
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import room_and_place

if TYPE_CHECKING:
    from sonarhw_compare.fit import FitResult, Parameter

NEAR = 0.25  # m: how far off a place may be that somebody put there by hand
_SAMPLES = 8000  # of the posterior: some 300 of them are independent


@dataclass(frozen=True)
class FitSettings:
    """What a fit may choose, in words of `values.quantities`, and whether the whole room is searched."""

    free: tuple[str, ...] = ("position", "heading", "offset")
    everywhere: bool = False


@dataclass(frozen=True)
class FitAnswer:
    """One answer of a fit."""

    values: "Mapping[Parameter, float]"
    within_5cm: float | None  # share of the echoes, in the scene that it leads to


@dataclass(frozen=True, eq=False)
class FitFound:
    """What a fit has come to."""

    request: "FitRequest"
    result: "FitResult"
    within_5cm: float | None  # share of the echoes, in the scene it was made in
    answers: tuple[FitAnswer, ...]  # the best first


class FitProgress:
    """What a fit at work and whoever waits for it tell each other."""

    def __init__(self) -> None:
        self.share, self.doing = 0.0, "beginning"
        self._stop = threading.Event()

    def report(self, share: float, doing: str) -> None:
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
    settings: FitSettings
    progress: FitProgress = field(compare=False)

    def answer(self) -> FitFound:
        """Find it, in some ten seconds. Raises InputError, Cancelled."""
        from sonarhw_compare.fit import (  # half a second, which only the first fit takes
            FitOptions,
            PlacedScan,
            fit_scans,
        )

        scene, progress = self.scene, self.progress
        room, place = room_and_place(scene)
        result = fit_scans(
            [PlacedScan(self.readings, place, "this scan")],
            room,
            scene.board,
            self._free(room),
            options=FitOptions(scene.options, samples=_SAMPLES),
            progress=progress.report,
            cancelled=lambda: progress.cancelled,
        )
        answers = tuple(self._answer(values) for values in _values(result))
        return FitFound(self, result, self._within_5cm(scene), answers)

    def _free(self, room: Room) -> "tuple[Parameter, ...]":
        from sonarhw_compare.fit import free_parameters

        parameters = free_parameters(self.settings.free, ["this scan"], room, self.scene.board)
        if self.settings.everywhere:
            return parameters
        at = dict(zip("xy", self.scene.pose.position, strict=True))
        return tuple(
            replace(one, lower=at[name] - NEAR, upper=at[name] + NEAR) if name in at else one
            for name, one in ((one.quantity.name, one) for one in parameters)
        )

    def _answer(self, values: "Mapping[Parameter, float]") -> FitAnswer:
        scene, _ = fitted(self.scene, values, self.scene.board)
        return FitAnswer(values, self._within_5cm(scene))

    def _within_5cm(self, scene: Scene) -> float | None:
        room, _ = room_and_place(scene)
        compared = compare_readings(self.readings, room, scene.pose, scene.board, options=scene.options)
        return compared.summary().within_5cm


def _values(result: "FitResult") -> "list[Mapping[Parameter, float]]":
    """The values of every answer; of the best the estimates, which are surer than its peak."""
    best = {one: result.estimates[one.name].value for one in result.parameters}
    return [best, *({one: mode.values[one.name] for one in result.parameters} for mode in result.modes[1:])]
