"""Figure 6: a room like Kuc and Siegel's, predicted by their model of single reflections and by ray following."""

from dataclasses import replace

from matplotlib.figure import Figure
from sonarhw_sim.choices import Model

from sonarhw_compare.paper.drawing import MEASURED, finish_plan, mark_sensor, points, sheet
from sonarhw_compare.paper.exhibit import Claim, Exhibit
from sonarhw_compare.paper.setting import PaperScene, PredictedReading
from sonarhw_compare.pictures.overlay_picture import draw_room

RAY_FOLLOWING = PaperScene("kuc_siegel", "figure6", (0.0, 360.0, 3.0))
KUC_SIEGEL = replace(RAY_FOLLOWING, model=Model.KUC_SIEGEL)


def single_readings_are_theirs(followed: PaperScene = RAY_FOLLOWING, theirs: PaperScene = KUC_SIEGEL) -> Claim:
    """Check that both models agree at headings with one reflection."""
    single = [pair for pair in _pairs(followed, theirs) if len(pair[0].via) == 1]
    apart = [abs(ours.range - other.range) for ours, other in single if ours.range and other.range]
    return Claim(
        "readings by a single reflection are those of Kuc and Siegel's model",
        f"{len(single)} headings with one reflection; their model has an echo at {len(apart)} of them, and differs by "
        f"at most {max(apart, default=0.0) * 1000:.1f} mm",
        len(apart) == len(single) > 0 and max(apart) < 1e-6,
    )


def several_reflections_are_missing(followed: PaperScene = RAY_FOLLOWING, theirs: PaperScene = KUC_SIEGEL) -> Claim:
    """Check that their model has no readings by several reflections."""
    several = [pair for pair in _pairs(followed, theirs) if len(pair[0].via) > 1]
    same = sum(ours.range == other.range for ours, other in several)
    silent = sum(other.range is None for _, other in several)
    return Claim(
        "there are readings by several reflections, which their model does not include",
        f"{len(several)} of {len(followed.readings)} headings; theirs is silent at {silent} of them and agrees at "
        f"{same}",
        len(several) > len(followed.readings) / 4 and same == 0,
    )


def _pairs(followed: PaperScene, theirs: PaperScene) -> list[tuple[PredictedReading, PredictedReading]]:
    return list(zip(followed.readings, theirs.readings, strict=True))


def _draw() -> Figure:
    figure = sheet(9, 7.4)
    axes = figure.add_subplot()
    draw_room(axes, RAY_FOLLOWING.scan.room)
    points(axes, RAY_FOLLOWING, "ray following")
    points(axes, KUC_SIEGEL, "single reflections only (Kuc and Siegel)", MEASURED, "x", 5)
    mark_sensor(axes, RAY_FOLLOWING)
    finish_plan(axes, "One room by two models, every 3°", (-3.8, 5.4, -2.9, 4.9), "upper left")
    return figure


EXHIBITS = (
    Exhibit(
        "figure6",
        "Figure 6: a room in the manner of Kuc and Siegel's",
        "Walls, inner corners and an outer corner. The dimensions are ours. Points far outside the walls are readings "
        "by several reflections.",
        (RAY_FOLLOWING, KUC_SIEGEL),
        _draw,
        (single_readings_are_theirs, several_reflections_are_missing),
    ),
)
