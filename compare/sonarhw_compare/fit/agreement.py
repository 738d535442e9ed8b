"""How well scans agree with the prediction from what a fit found.

Takes the scans that were fitted and a `FitResult`; hands on the figures of one comparison for each.
"""

from collections.abc import Sequence
from dataclasses import replace

from sonarhw_sim.predict.prediction import PredictionOptions

from sonarhw.readings import Reading
from sonarhw_compare.fit.values.fit_result import FitResult, PlacedScan
from sonarhw_compare.fit.values.quantities import AirQuantity
from sonarhw_compare.matching.match import Summary, compare_readings


def agreement(scans: Sequence[PlacedScan], result: FitResult, prediction: PredictionOptions) -> tuple[Summary, ...]:
    """The figures of each scan over the prediction from its place, room and board as they were found."""
    return tuple(
        compare_readings(_ranged(scan.readings, result), result.room, place, result.board, options=prediction).summary()
        for scan, place in zip(scans, result.places, strict=True)
    )


def _ranged(readings: Sequence[Reading], result: FitResult) -> Sequence[Reading]:
    """The readings, with ranges by the speed of sound that was found where the air was free."""
    if not any(isinstance(parameter.quantity, AirQuantity) for parameter in result.parameters):
        return readings
    return [replace(reading, speed_of_sound=result.room.air.speed_of_sound) for reading in readings]
