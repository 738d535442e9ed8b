"""The request for the paths of a scene, and its answer."""

import time
from dataclasses import dataclass

import numpy as np
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, paths_serve_all_headings, predict_scan
from sonarhw_sim.rays.paths import Paths

from sonarhw.readings import FloatArray
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
