"""A request to compute the B-scan for a short time and to draw the result so far; the answer is `BScans`."""

from dataclasses import dataclass

from sonarhw_compare.pictures import BScan, difference, floor_of
from sonarhw_sim.predict.predicted_scan import PredictedScan, arm

from sonarhw.readings import Reading
from sonarhw_gui.look.palette import Palette
from sonarhw_gui.scene.scene import Scene
from sonarhw_gui.work.bscan_picture import Arm, BScans, BScanSettings, Pane, PanePicture, colour_scale, draw_bscan
from sonarhw_gui.work.bscan_rows import BScanRows, more_rows

SLICE = 0.05  # s


@dataclass(frozen=True)
class BScanRequest:
    """Compute and draw the B-scan of these readings."""

    generation: int
    scene: Scene
    readings: tuple[Reading, ...]
    outline: PredictedScan | None
    settings: BScanSettings
    palette: Palette
    before: BScanRows | None  # earlier rows of the same scan

    def answer(self) -> BScans:
        """Compute rows for `SLICE` s and draw all rows so far."""
        rows = more_rows(self.scene, self.readings, self.outline, self.before, SLICE)
        measured, predicted = rows.images()
        pictures = {pane: self._drawn(pane, measured, predicted) for pane in self.settings.panes}
        return BScans(self.generation, self.settings, rows, measured, predicted, pictures)

    def _drawn(self, pane: Pane, measured: BScan, predicted: BScan) -> PanePicture:
        floor = floor_of(self.scene.board)
        scale = colour_scale(pane, self.settings.decibels, floor, self.palette)
        floor_db = floor if self.settings.decibels else None
        polar = Arm(*arm(self.scene.board)) if self.settings.polar else None
        if pane is Pane.DIFFERENCE:
            apart = difference(measured, predicted, floor_db)
            return PanePicture(draw_bscan(apart, scale, None, polar), scale)
        image = measured if pane is Pane.MEASURED else predicted
        return PanePicture(draw_bscan(image, scale, floor_db, polar), scale)
