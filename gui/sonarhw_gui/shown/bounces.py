"""The path that explains the selected reading, or the predicted one, and its losses bounce by bounce."""

from dataclasses import dataclass

import numpy as np
from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw.readings import FloatArray
from sonarhw_gui.scene.plan_geometry import bounce_losses, decibels_text
from sonarhw_gui.shown.shown import Shown


@dataclass(frozen=True)
class ChosenPath:
    """The path of the selected reading."""

    corners: FloatArray  # (n, 2) m, begins and ends at the sensor
    names: tuple[str, ...]  # of the walls, posts and edges at its bounces, in order
    losses: tuple[float | None, ...]  # of each bounce, dB; None: contained in the loss of a later one
    explains: bool  # whether it explains the reading; otherwise it is predicted only

    @property
    def text(self) -> str:
        """The number, name and loss of each bounce."""
        parts = []
        for number, (name, loss) in enumerate(zip(self.names, self.losses, strict=True), start=1):
            parts.append(f"{number} {name}" if loss is None else f"{number} {name} {decibels_text(loss)}")
        return " · ".join(parts)


def chosen_path(shown: Shown) -> ChosenPath | None:
    """Return the path of the asked heading or the selected reading; None without one, or after the sensor was moved."""
    if shown.asked is not None:
        winner = -1 if shown.answer is None else int(shown.answer.winners[0])
        return None if shown.answer is None else _path(shown, shown.answer, winner, explains=False)
    row, prediction = shown.chosen_row, shown.prediction
    if row is None or prediction is None:
        return None
    path = row.path if row.path is not None else int(prediction.winners[row.index])
    return _path(shown, prediction, path, explains=row.path is not None)


def _path(shown: Shown, prediction: PredictedScan, path: int, explains: bool) -> ChosenPath | None:
    if path < 0 or prediction.place.position != shown.scene.pose.position:
        return None
    names, losses = prediction.paths.via(path, prediction.room), dict(bounce_losses(prediction, path))
    by_bounce = tuple(losses.get(number) for number in range(1, len(names) + 1))
    corners = np.asarray(prediction.paths.outline(path))
    return ChosenPath(corners, tuple(names), by_bounce, explains)


def bounces_text(shown: Shown) -> str:
    """Return the bounces of the selected reading's path on one line; empty without a path."""
    path = chosen_path(shown)
    return "" if path is None else path.text
