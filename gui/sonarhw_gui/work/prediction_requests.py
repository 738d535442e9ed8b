"""Requests for the paths of a scene and for the comparison with readings, and their answers."""

import time
from dataclasses import dataclass

import numpy as np
from sonarhw_compare.matching.match import Comparison, Matched, compare_readings
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, paths_serve_all_headings, predict_scan
from sonarhw_sim.rays.paths import Paths

from sonarhw.readings import FloatArray, Reading
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.scene.scene_edit import room_and_place

OUTLINE_HEADINGS = 360


@dataclass(frozen=True)
class PathsFound:
    """The paths of a scene and the predicted outline."""

    generation: int
    scene: Scene
    options: PredictionOptions
    outline: PredictedScan
    draft: bool
    took: float  # s

    @property
    def paths(self) -> Paths:
        """The paths that are received at any heading."""
        return self.outline.paths


@dataclass(frozen=True)
class PathsRequest:
    """Find the paths from the scene's place back to it."""

    generation: int
    scene: Scene  # with a room
    options: PredictionOptions
    headings: int = OUTLINE_HEADINGS

    def answer(self) -> PathsFound:
        """Find the paths; in a room with many echoes this takes seconds."""
        began = time.perf_counter()
        scene = self.scene
        room, _ = room_and_place(scene)
        outline = predict_scan(room, scene.pose, scene.board, self._headings(), self.options)
        draft = self.options != scene.options or self.headings < OUTLINE_HEADINGS
        return PathsFound(self.generation, scene, self.options, outline, draft, time.perf_counter() - began)

    def _headings(self) -> FloatArray:
        board = self.scene.board
        if board.ring is not None:
            return board.ring.headings(self.scene.pose)
        one_search = paths_serve_all_headings(board, self.options.unit)
        count = OUTLINE_HEADINGS if one_search else self.headings
        return np.linspace(0, 2 * np.pi, count, endpoint=False)


@dataclass(frozen=True)
class Compared:
    """A range of consecutive readings, compared with the prediction."""

    generation: int
    comparison: Comparison
    first: int  # number of the reading in row 0
    draft: bool
    scene_generation: int = 0

    @property
    def end(self) -> int:
        """The number after the last compared reading."""
        return self.first + len(self.comparison.rows)

    def row(self, reading: int) -> Matched | None:
        """Return the row of a reading; None if it was not compared."""
        row = reading - self.first
        return self.comparison.rows[row] if 0 <= row < len(self.comparison.rows) else None


@dataclass(frozen=True)
class CompareRequest:
    """Compare readings with the prediction from these paths."""

    generation: int
    found: PathsFound
    readings: tuple[Reading, ...]
    first: int

    def answer(self) -> Compared:
        """Compare the readings."""
        found, scene = self.found, self.found.scene
        room, _ = room_and_place(scene)
        comparison = compare_readings(
            self.readings, room, scene.pose, scene.board, options=found.options, paths=found.paths
        )
        return Compared(self.generation, comparison, self.first, found.draft, found.generation)
