"""Comparison of fitted scans with the prediction from the fitted place, room and board."""

from collections.abc import Sequence
from dataclasses import replace

from sonarhw_sim.predict.prediction import PredictionOptions

from sonarhw.readings import Reading
from sonarhw_compare.fit.values.fit_result import FitResult, PlacedScan
from sonarhw_compare.fit.values.quantities import AirQuantity
from sonarhw_compare.matching.match import Summary, compare_readings


def agreement(scans: Sequence[PlacedScan], result: FitResult, prediction: PredictionOptions) -> tuple[Summary, ...]:
    """Return one summary for each scan, compared with the prediction from its fitted place, room and board."""
    return tuple(
        compare_readings(_ranged(scan.readings, result), result.room, place, result.board, options=prediction).summary()
        for scan, place in zip(scans, result.places, strict=True)
    )


def _ranged(readings: Sequence[Reading], result: FitResult) -> Sequence[Reading]:
    """Return the readings, with ranges from the fitted speed of sound if the air was fitted."""
    if not any(isinstance(parameter.quantity, AirQuantity) for parameter in result.parameters):
        return readings
    return [replace(reading, speed_of_sound=result.room.air.speed_of_sound) for reading in readings]
