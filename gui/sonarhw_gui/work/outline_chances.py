"""The probability of ranges at each heading of the predicted outline, as an image for the range view."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from sonarhw_gui.scene.scene_edit import room_and_place
from sonarhw_gui.work.prediction_requests import PathsFound

if TYPE_CHECKING:
    from sonarhw_compare.pictures import RangeShading


@dataclass(frozen=True)
class OutlineChances:
    """The probabilities of ranges at the headings of the outline."""

    generation: int  # of the scene
    shading: "RangeShading"


@dataclass(frozen=True)
class ChancesRequest:
    """Find the probabilities for the outline of these paths."""

    found: PathsFound

    def answer(self) -> OutlineChances:
        """Search the fainter paths, and weigh the possible readings at every heading of the outline."""
        # slow to load, and few boards state a spread
        from sonarhw_compare.pictures import shading_of
        from sonarhw_sim.predict.probability import possible_readings, scan_with_fainter_paths

        found, scene = self.found, self.found.scene
        room, _ = room_and_place(scene)
        headings = found.outline.headings
        scan = scan_with_fainter_paths(room, scene.pose, scene.board, headings, found.options)
        possible = [possible_readings(scan, index) for index in range(len(headings))]
        return OutlineChances(found.generation, shading_of(possible, headings))
