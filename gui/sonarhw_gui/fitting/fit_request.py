"""A request to fit the pose of the scanner to its readings, and its answer."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from sonarhw_compare.match import compare_readings
from sonarhw_sim.room.room import Room

from sonarhw.readings import Reading
from sonarhw_gui.fitting.fit_scene import fitted
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import room_and_place
from sonarhw_gui.work.run_progress import RunProgress

if TYPE_CHECKING:
    from sonarhw_compare.fit import FitResult, Parameter, PlacedScan

NEAR = 0.25  # m; maximum error of a place that was set by hand
_SAMPLES = 8000  # samples of the posterior; about 300 of them are independent


@dataclass(frozen=True)
class FitSettings:
    """The free parameters of a fit, by their names in `values.quantities`, and whether to search the whole room."""

    free: tuple[str, ...] = ("position", "heading", "offset")
    everywhere: bool = False


@dataclass(frozen=True)
class FitSolution:
    """One solution of a fit."""

    values: "Mapping[Parameter, float]"
    within_5cm: float | None  # share of the echoes, in the fitted scene


@dataclass(frozen=True, eq=False)
class FitFound:
    """The result of a fit."""

    request: "FitRequest"
    result: "FitResult"
    within_5cm: float | None  # share of the echoes, before the fit
    solutions: tuple[FitSolution, ...]  # the best first


@dataclass(frozen=True)
class FitRequest:
    """Fit the pose of the scanner."""

    scene: Scene
    readings: tuple[Reading, ...]
    settings: FitSettings
    progress: RunProgress = field(compare=False)

    @property
    def scan(self) -> "PlacedScan":
        """The scan at its place in the room. Raises InputError without a room."""
        from sonarhw_compare.fit import PlacedScan  # takes half a second; only the first fit needs it

        return PlacedScan(self.readings, room_and_place(self.scene)[1], "this scan")

    def answer(self) -> FitFound:
        """Run the fit, which takes about ten seconds. Raises InputError, Cancelled."""
        from sonarhw_compare.fit import FitOptions, fit_scans

        scene, progress = self.scene, self.progress
        room, _ = room_and_place(scene)
        result = fit_scans(
            [self.scan],
            room,
            scene.board,
            self._free(room),
            options=FitOptions(scene.options, samples=_SAMPLES),
            progress=progress.report,
            cancelled=lambda: progress.cancelled,
        )
        solutions = tuple(self._solution(values) for values in _values(result))
        return FitFound(self, result, self._within_5cm(scene), solutions)

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

    def _solution(self, values: "Mapping[Parameter, float]") -> FitSolution:
        scene, _ = fitted(self.scene, values, self.scene.board)
        return FitSolution(values, self._within_5cm(scene))

    def _within_5cm(self, scene: Scene) -> float | None:
        room, _ = room_and_place(scene)
        compared = compare_readings(self.readings, room, scene.pose, scene.board, scene.options)
        return compared.summary().within_5cm


def _values(result: "FitResult") -> "list[Mapping[Parameter, float]]":
    """Return the values of every solution. The best one has the estimates, which are more accurate than its peak."""
    best = {one: result.estimates[one.name].value for one in result.parameters}
    return [best, *({one: mode.values[one.name] for one in result.parameters} for mode in result.modes[1:])]
