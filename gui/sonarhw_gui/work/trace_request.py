"""A request for the measured and the predicted trace of one reading, and its answer."""

from dataclasses import dataclass

from sonarhw_sim.predict.predicted_scan import PredictedScan

from sonarhw.readings import Reading
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.work.chosen_trace import ChosenTrace, chosen_trace


@dataclass(frozen=True)
class TraceFound:
    """The traces of a reading."""

    generation: int
    trace: ChosenTrace


@dataclass(frozen=True)
class TraceRequest:
    """Read the trace of a reading and predict it."""

    generation: int
    scene: Scene
    reading: Reading
    prediction: PredictedScan | None
    index: int  # among the prediction's headings

    def answer(self) -> TraceFound:
        """Read and predict the trace; this takes some milliseconds."""
        return TraceFound(self.generation, chosen_trace(self.scene, self.reading, self.prediction, self.index))
