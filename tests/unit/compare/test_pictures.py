"""Pictures: what they show is at its place, nothing is cut off, and no text covers another."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.signal import hilbert
from sonarhw_compare import report
from sonarhw_compare.drawings import draw_comparison, draw_found_room, draw_located, draw_plan
from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.fit.starting import Scores
from sonarhw_compare.locate import Located, Pose
from sonarhw_compare.match import Comparison, Kind, compare_readings
from sonarhw_compare.pictures import envelope_of
from sonarhw_compare.report import CLASSES, bscan_png, plan_svg, ranges_svg
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, load_room

from sonarhw.readings import FloatArray, Reading, Trace
from tests.fixtures.predicted_readings import SPEED, predicted_readings, readings_of
from tests.fixtures.rooms_for_tests import polygon_room

SIMPLE = load_room("rooms/simple.toml")


FIGURE_9 = SIMPLE.places["figure9"]


PAPER = load_board("paper")


# added to the predicted ranges, m; one reading is far outside the room, one is missing
ADDED = (0.0, -0.1, 0.1, -0.3, 0.4, 30.0, math.nan)


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    """Return a comparison with readings of every class, the first ones where an echo is predicted."""
    angles = np.radians(np.arange(0.0, 360.0, 10.0)) - 1.0  # some headings are negative
    ranges = predict_scan(SIMPLE, FIGURE_9, PAPER, angles).ranges
    assert np.isfinite(ranges).all()
    ranges[: len(ADDED)] += ADDED
    return compare_readings(readings_of(angles, ranges), SIMPLE, FIGURE_9, PAPER)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[Comparison], bytes], Comparison], Figure]:
    """Return a function that returns the figure of a picture."""
    figures: list[Figure] = []
    monkeypatch.setattr(report, "picture_bytes", lambda figure, _, **_tight: figures.append(figure) or b"")

    def draw(picture: Callable[[Comparison], bytes], comparison: Comparison) -> Figure:
        picture(comparison)
        return figures.pop()

    return draw


def of_class(axes: Axes, kind: Kind) -> list[tuple[float, float]]:
    """Return the points that are drawn for a class."""
    lines = [line for line in axes.lines if str(line.get_label()).startswith(f"{kind.value} (")]
    points = [pair for line in lines for pair in np.asarray(line.get_xydata()).tolist()]
    assert not lines or lines[0].get_label() == f"{kind.value} ({len(points)})"
    return [(float(x), float(y)) for x, y in points]


def test_ranges_and_residuals_are_drawn_at_their_headings(
    drawn: Callable[[Callable[[Comparison], bytes], Comparison], Figure], comparison: Comparison
) -> None:
    ranges, residuals = drawn(ranges_svg, comparison).axes
    kinds = {row.kind for row in comparison.rows}
    assert kinds == set(CLASSES) - {Kind.EXTRA, Kind.OWN_BODY}
    (band,) = residuals.patches  # within 5 cm, mm
    assert band.get_extents().transformed(residuals.transData.inverted()).intervaly == pytest.approx((-50.0, 50.0))
    for kind in CLASSES:
        rows = [row for row in comparison.rows if row.kind is kind]
        degrees = [math.degrees(row.heading) % 360 for row in rows]
        at = [row.predicted if row.measured is None else row.measured for row in rows]
        np.testing.assert_allclose(of_class(ranges, kind), list(zip(degrees, at, strict=True)))
        both = [row for row in rows if row.measured is not None and row.predicted is not None]
        # in mm, at most 250
        expected = [
            (math.degrees(row.heading) % 360, min(max(1000 * (row.measured - row.predicted), -250.0), 250.0))
            for row in both
        ]
        np.testing.assert_allclose(of_class(residuals, kind), expected, atol=1e-9)


def test_the_plan_has_the_points_in_the_room_and_counts_those_outside(
    drawn: Callable[[Callable[[Comparison], bytes], Comparison], Figure], comparison: Comparison
) -> None:
    (axes,) = drawn(plan_svg, comparison).axes
    x, y = FIGURE_9.position
    for kind in CLASSES:
        expected = []
        for row in (row for row in comparison.rows if row.kind is kind):
            at = row.predicted if row.measured is None else row.measured
            assert at is not None
            expected.append((x + at * math.cos(row.heading), y + at * math.sin(row.heading)))
        np.testing.assert_allclose(of_class(axes, kind), expected)
    # the plan ends 30 % of the longer side of the room outside it
    corners = SIMPLE.walls.reshape(-1, 2)
    beyond = 0.3 * np.ptp(corners, axis=0).max()
    low, high = corners.min(axis=0) - beyond, corners.max(axis=0) + beyond
    np.testing.assert_allclose([axes.get_xlim(), axes.get_ylim()], np.transpose([low, high]))
    drawn_points = np.vstack([of_class(axes, kind) for kind in CLASSES if of_class(axes, kind)])
    outside = ((drawn_points < low) | (drawn_points > high)).any(axis=1).sum()
    assert 0 < outside < len(drawn_points) == len(comparison.rows)
    assert axes.get_title(loc="right") == f"{outside} of {len(comparison.rows)} are outside this plan"


def test_traces_have_one_scale(drawn: Callable[[Callable[[Comparison], bytes | None], Comparison], Figure]) -> None:
    """Traces every 90°, each with one echo; the rest of the circle has none."""
    angles, rate = np.radians([0.0, 90.0, 180.0, 270.0]), 50_000.0
    readings = []
    for number, angle in enumerate(angles):
        samples = np.zeros(600)
        samples[200 + 100 * number] = 0.5
        trace = Trace(samples, rate, 0.0)
        readings.append(Reading(number, 0, 0, float(angle), 0.0, (0.004,), SPEED, trace=trace))
    comparison = compare_readings(readings, SIMPLE, FIGURE_9, PAPER)
    measured, predicted, bar = drawn(bscan_png, comparison).axes
    reach = 600 / rate * SPEED / 2
    for axes in (measured, predicted):
        (image,) = axes.images
        assert image.get_extent() == pytest.approx((0.0, 360.0, 0.0, reach), rel=0.01)
        assert image.get_clim()[1] == 0.0
    assert bar.get_ylabel() == "dB of full scale"
    levels = np.ma.filled(measured.images[0].get_array(), np.nan)
    for number, degrees in enumerate((0.5, 90.0, 180.0, 270.0)):
        column = levels[:, int(degrees / 360 * levels.shape[1])]
        loudest = (np.nanargmax(column) + 0.5) / len(column) * reach
        assert loudest == pytest.approx((200 + 100 * number) / rate * SPEED / 2, abs=0.02)
        assert np.nanmax(column) == pytest.approx(20 * math.log10(0.5), abs=0.01)


# plans of nearly equal width and height, whose labels and legends were cut off; a wide one; and a tall one
@pytest.mark.parametrize(
    ("room_name", "place", "board"),
    [
        ("right_corner", "figure12", "polaroid-6500"),
        ("arena", "p1", "paper"),
        ("arena", "p4", "lego-nxt"),
        ("laboratory", "bench", "polaroid-6500"),
    ],
)
def test_labels_and_legend_are_inside_the_picture(room_name: str, place: str, board: str) -> None:
    room = load_room(f"rooms/{room_name}.toml")
    scan = predict_scan(room, room.places[place], load_board(board), np.radians(np.arange(0.0, 360.0, 3.0)))
    figure = draw_plan(scan, [(0.0, 1.0)])
    figure.canvas.draw()
    picture = np.asarray(figure.canvas.buffer_rgba())[:, :, :3]  # type: ignore[attr-defined]
    for name, edge in {
        "left": picture[:, 0],
        "right": picture[:, -1],
        "top": picture[0],
        "bottom": picture[-1],
    }.items():
        assert (edge == 255).all(), name


def legend_of(figure: Figure) -> list[str]:
    """Return the texts of the legend of a figure."""
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_title_states_the_pose_that_is_drawn() -> None:
    here = replace(SIMPLE.place("0.5,0.4,30"), position=(0.48, 0.4), heading=math.radians(-95.04))  # as after a fit
    moved = replace(FIGURE_9, heading=0.1)
    titles = [
        draw_comparison(compare_readings(readings_of([0.0], [0.3]), SIMPLE, place, PAPER)).axes[0].get_title()
        for place in (here, FIGURE_9, moved)
    ]
    x, y = FIGURE_9.position
    assert titles == [
        "Simple room, at 0.48, 0.4 m, step 0 at -95.0°",
        "Simple room, place figure9",
        f"Simple room, at {x:g}, {y:g} m, step 0 at 5.7°",
    ]


def test_a_plan_shows_room_and_measured_points_and_counts_predicted_ones_outside() -> None:
    room = polygon_room([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0)])
    place = Place("", (1.0, 0.7), math.radians(20))
    angles = np.radians(np.arange(0.0, 360.0, 4.0))
    readings = readings_of(angles[:3], np.array([2.0, 2.1, 2.4]))
    readings += readings_of(angles[3:], np.full(len(angles) - 3, np.nan))
    comparison = compare_readings(readings, room, place, load_board("polaroid-6500"))
    figure = draw_comparison(comparison)
    (axes,) = figure.axes
    headings = comparison.prediction.headings
    away = np.column_stack((np.cos(headings), np.sin(headings)))
    predicted = place.position + comparison.prediction.ranges[:, None] * away
    farthest = place.position[0] + 2.4 * math.cos(headings[2])
    assert farthest > 3.0
    assert (axes.get_xlim(), axes.get_ylim()) == (
        pytest.approx((-0.05 * farthest, 1.05 * farthest)),
        pytest.approx((-0.05 * farthest, 2.0 + 0.05 * farthest)),
    )
    low, high = np.transpose((axes.get_xlim(), axes.get_ylim()))
    outside = int(((predicted < low) | (predicted > high)).any(axis=1).sum())
    assert outside > 10
    assert legend_of(figure)[:2] == [f"predicted ({outside} more outside)", "measured"]
    # the arrow of step 0
    (arrow,) = (one for one in axes.texts if one.arrow_patch is not None)  # type: ignore[attr-defined]
    (x, y), (from_x, from_y) = arrow.xy, arrow.get_position()  # type: ignore[attr-defined]
    assert math.atan2(y - from_y, x - from_x) == pytest.approx(place.heading)
    assert legend_of(figure)[-1] == "sensor, step 0 along the arrow"


@pytest.mark.parametrize("size", [(8.0, 1.5), (3.0, 3.0), (1.2, 5.0)])
def test_nothing_covers_another_thing_in_the_picture_of_located_poses(size: tuple[float, float]) -> None:
    width, depth = size
    room = polygon_room([(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)])
    room = replace(room, places={"scanner": Place("scanner", (0.6, 0.7))})
    poses = [((0.6, 0.71), 0.0, 0.41), ((0.6, 0.7), 0.1, 0.31), ((0.61, 0.7), -0.1, 0.15), ((0.9, 1.2), 3.0, 0.004)]
    angles = np.radians(np.arange(0.0, 360.0, 10.0))
    scores = Scores(np.array([[0.5, 0.5], [0.6, 0.5]]), np.zeros(1), np.zeros((2, 1)), 0.1)
    found = Located(
        room,
        PAPER,
        tuple(readings_of(angles, np.full(36, 0.5))),
        tuple(Pose(position, heading, 0.0, share, (0.01, 0.01, 0.01)) for position, heading, share in poses),
        scores,
        1.0,
        1.0,
    )
    figure = draw_located(found)
    figure.canvas.draw()
    axes = figure.axes[0]
    texts = [one for one in axes.texts if one.get_text()]
    assert sorted(one.get_text() for one in texts) == ["41%, 31%, 15%", "scanner"]  # no pose of 0 %
    (legend,) = figure.legends
    boxes = [one.get_window_extent() for one in texts]
    boxes += [one.get_window_extent() for one in axes.lines if one.get_marker() == "o" and len(one.get_xdata()) == 1]
    boxes += [legend.get_window_extent(), axes.xaxis.label.get_window_extent(), axes.title.get_window_extent()]
    assert not [(k, j) for k, one in enumerate(boxes) for j in range(k) if j not in (2, 3) and one.overlaps(boxes[j])]
    bar = figure.axes[1].yaxis.label.get_window_extent()
    assert figure.bbox.y0 <= bar.y0 < bar.y1 <= figure.bbox.y1
    # no empty band: the plan takes most of the height
    assert axes.get_window_extent().height > 0.45 * figure.bbox.height


KNOWN = polygon_room([(0.0, 0.0), (3.0, 0.0), (3.0, 2.0), (0.0, 2.0)])


IN_KNOWN = Place("", (1.0, 0.7))


@pytest.fixture(scope="module")
def false_scan() -> PlacedScan:
    """A predicted false_scan whose first reading is false: its echo has no path."""
    readings = predicted_readings(KNOWN, IN_KNOWN, PAPER)
    return PlacedScan([replace(readings[0], echo_times=(2.6 / KNOWN.air.speed_of_sound,)), *readings[1:]], IN_KNOWN)


def line_of(figure: Figure, plan: int, label: str) -> FloatArray:
    """Return the points of the line with this label, (n, 2) m."""
    axes: Axes = figure.axes[plan]
    (line,) = (one for one in axes.lines if one.get_label() == label)
    return np.asarray(line.get_xydata())


def test_echoes_are_drawn_by_the_kind_of_their_path(false_scan: PlacedScan) -> None:
    figure = draw_found_room([false_scan], KNOWN, PAPER)
    assert len(figure.axes) == 2
    np.testing.assert_allclose(line_of(figure, 0, "echo: no path in the found room"), [[2.3, 0.7]])
    once = line_of(figure, 0, "echo: one reflection")
    # the wall that the place faces at 0.7 m: a range of 0.7 m at 270 degrees
    assert np.abs(once - (1.0, 0.0)).max(axis=1).min() < 1e-3
    echoes = sum(reading.range is not None for reading in false_scan.readings)
    several = line_of(figure, 0, "echo: several reflections")
    assert len(once) + len(several) + 1 == echoes


@pytest.mark.parametrize("count", [200, 201])
def test_the_envelope_of_a_carrier_is_the_magnitude_of_its_analytic_signal(count: int) -> None:
    samples = 0.3 * np.random.default_rng(1).standard_normal(count).clip(-2, 2)
    trace = Trace(samples, 200_000.0, 0.0, carrier=True)
    assert envelope_of(trace) == pytest.approx(np.abs(hilbert(samples)).clip(max=1.0))
