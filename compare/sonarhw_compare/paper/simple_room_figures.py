"""Figures 7, 8 and 9: the room of shelving, as the unit measured it and as the paper's simulation predicted it.

Also the robot in the text about figure 9, whose body blocks the sound of the false wall.
"""

import math
from dataclasses import replace

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from sonarhw_sim.air import Receiver, Unit

from sonarhw_compare.paper.drawing import MEASURED, Bounds, finish_plan, note, plan, points, sheet
from sonarhw_compare.paper.exhibit import Claim, Exhibit
from sonarhw_compare.paper.setting import PaperScene, PredictedReading, ranges, span
from sonarhw_compare.pictures.overlay_picture import draw_room, mark_sensors

_ROUND = (0.0, 360.0, 3.0)
FIGURE_7 = PaperScene("simple", "figure7", _ROUND, unit=Unit.REFLECT)
FIGURE_7_BOARD = replace(FIGURE_7, board="polaroid-6500", receiver=Receiver.BOARD)
FIGURE_8 = replace(FIGURE_7, unit=Unit.BLOCK)
FIGURE_9 = PaperScene("simple", "figure9", _ROUND)
# the face is 85 mm from the lower wall, as in figure 9; the reach is limited, because a round body adds many long paths
ROBOT = replace(FIGURE_9, place="0.574,0.237", board="paper-b12", reach=2.0)
_HEIGHT = 0.742  # m, of the room
_NEAR_CIRCLE = 0.005  # m beyond blanking
_VERY_CLOSE = 0.6  # m
_WAVE = 0.05  # m: how far a corner must be behind the wall


def very_close_at_the_right(scene: PaperScene = FIGURE_7) -> Claim:
    """Check for very close readings over a span of headings, by sound between the right wall and the face."""
    reading = scene.at(0.0)
    wall, face = reading.via.count("right"), reading.via.count("unit")
    around = _within(scene, 15.0)
    close = [distance for distance in ranges(around) if distance < _VERY_CLOSE]
    return Claim(
        'on the right the unit reads "very close", where the paper\'s simulation returned infinity',
        f"{_metres(reading)} at 0°: the wall {wall} times and the unit's face {face} times; very close at {len(close)} "
        f"of the {len(around)} headings within 15°: our face is a mirror, which reflects the sound sideways when it is "
        "turned, and a real face, 5.5 wavelengths wide, also spreads it",
        len(close) > len(around) / 2 and wall == face + 1,
    )


def circle_of_minimum_range(scene: PaperScene = FIGURE_7_BOARD) -> Claim:
    """Check for readings at the end of blanking, in several directions."""
    blanked = scene.scan.board.blanked_range(scene.scan.room.air)
    close = [
        reading for reading in scene.readings if reading.range is not None and reading.range < blanked + _NEAR_CIRCLE
    ]
    walls = {reading.via[0] for reading in close}
    found = ranges(close)
    extent = f", at {min(found):.3f} to {max(found):.3f} m, towards {', '.join(sorted(walls))}" if found else ""
    return Claim(
        "a circle of readings of minimum range surrounds the unit",
        f"{len(close)} of {len(scene.readings)} readings within {_NEAR_CIRCLE * 1000:g} mm of the end of blanking"
        f"{extent}",
        len(close) >= 12 and walls >= {"top", "bottom", "right"},
    )


def far_wall_is_wavy(scene: PaperScene = FIGURE_8) -> Claim:
    """Check for two corners and the wall between them."""
    return Claim("the far wall is wavy: two corners, and the wall between them", *_wave(scene))


def far_wall_is_wavy_again(scene: PaperScene = FIGURE_9) -> Claim:
    """Check for the same wave from a place beside the lower wall."""
    found, wavy = _wave(scene)
    beside = scene.scan.place.position[1]
    why = "" if wavy else f"; the lower wall is only {beside * 1000:.0f} mm aside, so that corner hardly stands back"
    return Claim("the far wall is wavy again", found + why, wavy)


def _wave(scene: PaperScene) -> tuple[str, bool]:
    """Return the readings of two corners and the far wall between them, and whether both corners are behind it."""
    parts = [scene.readings_via(*via) for via in (("top", "left"), ("left",), ("bottom", "left"))]
    if not all(parts):
        return "one of its three parts is not detected", False
    upper, wall, lower = (ranges(part)[0] for part in parts)
    found = "; ".join(f"{ranges(part)[0]:.3f} m over {span(part)}" for part in parts)
    behind = (upper - wall, lower - wall)
    in_order = parts[0][-1].degrees < parts[1][0].degrees and parts[1][-1].degrees < parts[2][0].degrees
    return (
        f"{found}: the corners are {behind[0] * 1000:.0f} and {behind[1] * 1000:.0f} mm behind the wall",
        in_order and min(behind) > _WAVE,
    )


def nothing_near_at_the_right(scene: PaperScene = FIGURE_8) -> Claim:
    """Check the side on which the paper's simulation is silent."""
    nearest = min(ranges(_within(scene, 6.0)), default=math.inf)
    return Claim(
        "on the right the simulation returns infinity (our model follows the sound for longer, and a closed room of "
        "reflectance 0.95 always returns an echo: here only echoes that appear far outside the room)",
        f"nearest reading between -6 and 6°: {nearest:.3f} m; the wall is 0.094 m away",
        nearest > 1.5,
    )


def upper_wall_is_true(scene: PaperScene = FIGURE_9) -> Claim:
    """Check the reading of the far wall by one reflection."""
    reading = scene.at(90.0)
    return Claim(
        "the upper wall is at its true distance, 657 mm",
        f"{_metres(reading)} at 90°, {_path_text(reading)}",
        reading.via == ("top",) and reading.range is not None and abs(reading.range - 0.657) < 1e-3,
    )


def lower_wall_is_false(scene: PaperScene = FIGURE_9) -> Claim:
    """Check the reading of the near wall, whose sound goes to the far wall and back."""
    reading = scene.at(270.0)
    false = scene.readings_via("bottom", "top", "bottom")
    return Claim(
        "the lower wall, 85 mm away, is false: sound goes to the lower wall, past the unit to the upper, past the unit "
        "to the lower wall and to the unit",
        f"{_metres(reading)} at 270°, {_path_text(reading)}; the same over {span(false)}",
        reading.via == ("bottom", "top", "bottom")
        and reading.range is not None
        and abs(reading.range - 0.827) < 1e-3
        and len(false) >= 5,
    )


def corridor_of_twice_the_width(scene: PaperScene = FIGURE_9) -> Claim:
    """Check the sum of the readings of both walls."""
    up, down = scene.at(90.0).range, scene.at(270.0).range
    width = math.nan if up is None or down is None else up + down
    return Claim(
        "it looks like a corridor of twice the true width, with the robot nearer the true wall",
        f"{up:.3f} + {down:.3f} = {width:.3f} m; twice {_HEIGHT} m is {2 * _HEIGHT:.3f} m",
        up is not None and down is not None and abs(width - 2 * _HEIGHT) < 1e-3 and up < down,
    )


def body_removes_the_false_wall(scene: PaperScene = ROBOT) -> Claim:
    """Check the reading of the robot in front of the same wall."""
    reading = scene.at(270.0)
    false = [other for other in scene.readings if other.range is not None and abs(other.range - 0.827) < 0.02]
    rattling = set(reading.via) == {"bottom", "body"}
    return Claim(
        "on a B12 robot the body blocks the return, and the chirp travels between body and wall until minimum range",
        f"{_metres(reading)} at 270°, the wall {reading.via.count('bottom')} times and the body "
        f"{reading.via.count('body')} times; {len(false)} readings near 0.827 m",
        rattling and reading.range is not None and reading.range < 0.45 and not false,
    )


def _within(scene: PaperScene, degrees: float) -> list[PredictedReading]:
    """Return the readings at headings within `degrees` of 0°."""
    return [reading for reading in scene.readings if abs((reading.degrees + 180) % 360 - 180) <= degrees]


def _metres(reading: PredictedReading) -> str:
    return "no echo" if reading.range is None else f"{reading.range:.3f} m"


def _path_text(reading: PredictedReading) -> str:
    return f"by {' > '.join(reading.via)}" if reading.via else "by no path"


def _draw_7() -> Figure:
    figure = sheet(11, 5.6)
    left, right = figure.subplots(1, 2)
    bounds = (-0.6, 1.9, -0.9, 1.6)
    plan(left, FIGURE_7, "the paper's receiver, face reflecting", bounds, "center left")
    note(left, "0.470 m:\nwall 5 ×, face 4 ×", (1.304, 0.345), (1.36, 0.66))
    plan(right, FIGURE_7_BOARD, "the ranging board's own receiver", bounds, "center left")
    blanked = FIGURE_7_BOARD.scan.board.blanked_range(FIGURE_7_BOARD.scan.room.air)
    right.add_patch(Circle((0.834, 0.345), blanked, fill=False, ec=MEASURED, ls="--", lw=1.2))
    note(right, "minimum range", (0.834 - blanked * 0.71, 0.345 - blanked * 0.71), (0.1, -0.5))
    return figure


def _draw_8() -> Figure:
    figure = sheet(7.5, 6.5)
    axes = figure.add_subplot()
    plan(axes, FIGURE_8, "Figure 8: as the paper's simulation predicts it", (-0.7, 1.7, -0.75, 1.5))
    note(axes, "wavy far wall", (-0.02, 0.2), (-0.42, -0.35))
    note(axes, "nothing near", (0.928, 0.345), (1.35, 0.345))
    return figure


def _draw_9() -> Figure:
    figure = sheet(11, 5.8)
    left, right = figure.subplots(1, 2)
    bounds = (-0.8, 1.8, -1.2, 1.4)
    plan(left, FIGURE_9, "Figure 9", bounds)
    note(left, "true wall", (0.72, 0.742), (0.3, 1.1))
    note(left, "false wall", (0.75, -0.742), (0.3, -0.98))
    _draw_robot(right, bounds)
    return figure


def _draw_robot(axes: Axes, bounds: Bounds) -> None:
    draw_room(axes, ROBOT.scan.room)
    points(axes, ROBOT, "predicted")
    mark_sensors(axes, ROBOT.scan.place.position, "centre of its body")
    note(axes, "0.425 m: multiple reflections", (0.574, 0.085 - 0.425), (0.574, -0.9))
    finish_plan(axes, "the same wall in front of a B12 robot", bounds, "upper left")


_SETUP = (
    "Room and places are the paper's: 928 × 742 mm of shelving. The reflectance, 0.95, is ours. One reading every 3°."
)

EXHIBITS = (
    Exhibit(
        "figure7",
        "Figure 7: the simple room, as the unit measured it",
        f"{_SETUP} The sensor is 397 mm from the top and 94 mm from the right. The unit's face reflects. Left: the "
        "first echo above the threshold. Right: the ranging board's own receiver, which integrates, so that sound that "
        "arrives at the end of blanking is read there.",
        (FIGURE_7, FIGURE_7_BOARD),
        _draw_7,
        (very_close_at_the_right, circle_of_minimum_range),
    ),
    Exhibit(
        "figure8",
        "Figure 8: the simple room, as the paper's simulation predicts it",
        f"{_SETUP} The place is that of figure 7. The unit blocks the sound that returns to its face.",
        (FIGURE_8,),
        _draw_8,
        (far_wall_is_wavy, nothing_near_at_the_right),
    ),
    Exhibit(
        "figure9",
        "Figure 9: a false wall, and a robot that does not detect it",
        f"{_SETUP} The sensor is 657 mm from the top and 154 mm from the right; sound passes it. The robot of the "
        "text has a round body of 152 mm radius (this radius and its position along the wall are ours). Its face is "
        "also 85 mm from the lower wall when it points there.",
        (FIGURE_9, ROBOT),
        _draw_9,
        (
            upper_wall_is_true,
            far_wall_is_wavy_again,
            lower_wall_is_false,
            corridor_of_twice_the_width,
            body_removes_the_false_wall,
        ),
    ),
)
