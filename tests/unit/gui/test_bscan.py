"""The B-scan as arrays, checked against known positions of echoes and gaps."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from sonarhw_compare.pictures import (
    CELLS,
    BScan,
    RangeCells,
    bscan_of,
    cells_for,
    difference,
    echo_row,
    envelope_of,
    heading_key,
    in_db,
    newest_by_heading,
    predicted_row,
    trace_row,
)
from sonarhw_gui.jobs.traces import (
    Arm,
    BScanPixels,
    BScanRows,
    BScans,
    BScanSettings,
    ColourScale,
    Pane,
    bscan_slice,
    colour_scale,
    draw_bscan,
    flat_area,
    polar_area,
)
from sonarhw_gui.model.look import LIGHT
from sonarhw_gui.model.scene import Scene
from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Mount, load_board
from sonarhw_sim.predict.predicted_scan import PredictedScan, arm
from sonarhw_sim.predict.prediction import predict_scan
from sonarhw_sim.room.room import Place, Room, load_room

from sonarhw.errors import NotALog
from sonarhw.readings import FloatArray, Reading, Trace
from tests.fixtures.window_scene import ROOM

SPEED = 343.2
RATE = 50_000.0
FLAT = BScanSettings((Pane.MEASURED, Pane.PREDICTED, Pane.DIFFERENCE), polar=False, decibels=True)
BLACK = ColourScale(np.full((256, 4), 255, dtype=np.uint8), 0.0, 1.0, "")


def spike(distance: float, reach: float = 3.0, level: float = 1.0) -> Trace:
    """Return a silent trace with one sample, at the time of an echo from `distance`."""
    trace = Trace(np.zeros(math.ceil(2 * reach / SPEED * RATE)), RATE, 0.0)
    trace.samples[round(2 * distance / SPEED * RATE)] = level
    return trace


def reading(number: int, degrees: float, trace: Trace | None = None, ranges: tuple[float, ...] = ()) -> Reading:
    times = tuple(2 * distance / SPEED for distance in ranges)
    return Reading(number, 0, 0, math.radians(degrees), 0.1 * number, times, SPEED, trace=trace)


def loudest_at(levels: FloatArray, cells: RangeCells) -> float:
    return float(cells.middles[np.nanargmax(levels)])


@pytest.mark.parametrize("distance", [0.2, 1.0, 2.7])
def test_an_echo_lies_in_the_cell_of_its_range(distance: float) -> None:
    cells = cells_for(3.0, 0.004)
    assert loudest_at(trace_row(spike(distance), SPEED, cells), cells) == pytest.approx(distance, abs=cells.width)


def test_an_echo_keeps_its_level_for_any_cell_width() -> None:
    for cells in (RangeCells(0.005, 600), RangeCells(0.3, 10)):
        assert np.nanmax(trace_row(spike(1.0, level=0.25), SPEED, cells)) == 0.25


def test_exactly_the_cells_within_a_trace_have_a_level() -> None:
    cells = cells_for(5.0, SPEED / 2 / RATE)
    row = trace_row(spike(1.0, reach=3.0), SPEED, cells)
    assert cells.count <= CELLS
    assert np.isfinite(row[cells.middles < 3.0 - cells.width]).all()
    assert np.isnan(row[cells.middles > 3.0 + cells.width]).all()


@pytest.mark.parametrize("samples", [1, 7, 100, 599, 600, 601, 5000])
def test_no_cell_of_a_whole_trace_is_empty(samples: int) -> None:
    cells = cells_for(samples * 0.004, 0.004)
    assert cells.reach == pytest.approx(samples * 0.004)
    row = cells.loudest(np.arange(samples) * 0.004, np.ones(samples))
    assert np.isfinite(row).all()


def test_lost_samples_are_a_gap_in_the_row() -> None:
    trace = spike(1.0)
    trace.samples[(trace.times * SPEED / 2 > 2.0) & (trace.times * SPEED / 2 < 2.2)] = np.nan
    cells = cells_for(3.0, 0.004)
    row = trace_row(trace, SPEED, cells)
    assert np.isnan(row[(cells.middles > 2.01) & (cells.middles < 2.19)]).all()
    assert loudest_at(row, cells) == pytest.approx(1.0, abs=cells.width)


def test_the_envelope_of_an_undersampled_carrier_is_correct() -> None:
    rate, carrier = 76_923.0, 49_400.0
    times = np.arange(1500) / rate
    swell = 0.8 * np.exp(-(((times - 0.01) / 0.001) ** 2))
    found = envelope_of(Trace(swell * np.cos(math.tau * carrier * times), rate, 0.0, carrier=True))
    assert np.abs(found - swell).max() < 0.01


def test_the_predicted_echo_of_a_wall_lies_where_the_wall_is() -> None:
    wall = ((1.0, -3.0), (1.0, 3.0))
    room = load_room(ROOM)
    room = one_wall(room, wall)
    place, board = Place("here", (0.0, 0.0)), load_board("polaroid-6500")
    scan = predict_scan(room, place, board, np.array([0.0]))
    cells = cells_for(3.0, 0.004)
    row = predicted_row(scan, 0.0, cells)
    # the echo starts at this range and rises over some cycles
    beyond_ringing = cells.middles > 0.6
    first = cells.middles[beyond_ringing & (row >= 0.1 * np.nanmax(row[beyond_ringing]))][0]
    assert first == pytest.approx(1.0, abs=0.03)


def one_wall(room: Room, wall: tuple[tuple[float, float], tuple[float, float]]) -> Room:
    return replace(room, walls=np.array([[*wall]]).reshape(room.walls[:1].shape), air=Air())


def test_a_transducer_off_the_axis_is_predicted_at_the_headings_of_its_prediction() -> None:
    board = replace(load_board("polaroid-6500"), max_range=2.0, mount=Mount(ahead=0.05))
    room = one_wall(load_room(ROOM), ((1.0, -3.0), (1.0, 3.0)))
    scan = predict_scan(room, Place("here", (0.0, 0.0)), board, np.radians([0.0, 20.0, 340.0]))
    assert scan.only_at is not None
    cells = cells_for(2.0, 0.004)
    speed = room.air.speed_of_sound
    for k, heading in enumerate(scan.headings):
        expected = trace_row(scan.ping(k).signal(2 * cells.reach / speed).envelope(), speed, cells)
        np.testing.assert_array_equal(predicted_row(scan, heading + 1e-4 - math.tau, cells), expected)


def test_a_reading_lies_at_its_heading_in_the_room() -> None:
    cells = cells_for(3.0, 0.004)
    zero = math.radians(30.0)
    rows = newest_by_heading([reading(0, 350.0, spike(1.0))], load_board("paper"), zero)
    bscan = bscan_of({key: trace_row(one.trace, SPEED, cells) for key, one in rows.items() if one.trace}, cells)
    assert np.degrees(bscan.headings) == pytest.approx([20.0])
    assert bscan.row_at(math.radians(20.0)) == 0
    assert bscan.row_at(math.radians(380.0)) == 0
    assert bscan.row_at(math.radians(200.0)) is None


def test_the_newest_of_several_readings_at_a_heading_is_drawn() -> None:
    old, new = reading(0, 90.0), reading(7, 90.0)
    assert newest_by_heading([old, reading(3, 180.0), new], load_board("paper"), 0.0)[heading_key(math.pi / 2)] is new


def test_missing_headings_are_gaps_and_other_headings_are_contiguous() -> None:
    cells = RangeCells(0.1, 10)
    degrees = [d for d in range(0, 360, 5) if d not in (100, 105)]
    bscan = bscan_of({heading_key(math.radians(d)): np.ones(10) for d in degrees}, cells)
    drawn = draw_bscan(bscan, BLACK, None, polar=None)[:, :, 3].T > 0
    left, _, width, _ = flat_area(cells)
    at = left + (np.arange(len(drawn)) + 0.5) / len(drawn) * width
    gap = (at > 98) & (at < 107)
    assert not drawn[gap].any()
    assert drawn[(at < 97) | (at > 108)].all()


@pytest.mark.parametrize("mount", [Mount(), Mount(ahead=0.1, aside=0.2, separation=0.04)])
@pytest.mark.parametrize("degrees", [0.0, 60.0, 135.0, 290.0])
def test_a_polar_picture_shows_an_echo_in_front_of_the_transducer_at_its_range(degrees: float, mount: Mount) -> None:
    cells, middle, along = cells_for(2.0, 0.004), (0.5, -0.25), math.radians(degrees)
    bscan = bscan_of({heading_key(along): echo_row([1.0], cells)}, cells)
    polar = Arm(*arm(replace(load_board("polaroid-6500"), mount=mount)))
    x, y = middle_of(draw_bscan(bscan, BLACK, None, polar), polar_area(cells, middle, polar))
    position = mount.pose(Place("here", middle), along).receiver
    assert (x, y) == pytest.approx((position[0] + math.cos(along), position[1] + math.sin(along)), abs=0.02)
    heading, far = polar.headings_and_ranges(np.array(x - middle[0]), np.array(y - middle[1]))
    assert (math.remainder(heading - along, math.tau), far) == pytest.approx((0.0, 1.0), abs=0.02)


def middle_of(pixels: BScanPixels, area: tuple[float, float, float, float]) -> tuple[float, float]:
    """Return the centre of the opaque pixels, in the coordinates of the area."""
    left, bottom, width, height = area
    rows, columns = np.nonzero(pixels[:, :, 3])
    return (
        float(left + (columns.mean() + 0.5) / pixels.shape[1] * width),
        float(bottom + (rows.mean() + 0.5) / pixels.shape[0] * height),
    )


def test_the_difference_is_in_decibels_and_limited_by_the_floor() -> None:
    cells = RangeCells(0.1, 3)
    measured = BScan(np.array([1.0]), cells, np.array([[0.1, 1e-5, np.nan]]), 0.1)
    predicted = BScan(np.array([1.02]), cells, np.array([[0.01, 1e-4, 0.5]]), 0.1)
    result = difference(measured, predicted, -40.0)
    np.testing.assert_allclose(result.levels, [[20.0, 0.0, np.nan]])
    np.testing.assert_allclose(difference(measured, predicted, None).levels[0, :2], [0.09, -9e-5])


def test_headings_without_prediction_have_no_difference() -> None:
    cells = RangeCells(0.1, 3)
    measured = BScan(np.array([1.0, 2.0]), cells, np.ones((2, 3)), 0.1)
    predicted = BScan(np.array([2.0]), cells, np.ones((1, 3)), 0.1)
    assert difference(measured, predicted, -40.0).headings.tolist() == [2.0]


@pytest.mark.parametrize(("heading", "row"), [(1.04, 0), (1.06, -1), (1.94, -1), (1.96, 1), (2.04 - math.tau, 1)])
def test_a_heading_has_a_row_up_to_half_a_step_from_it(heading: float, row: int) -> None:
    scan = BScan(np.array([1.0, 2.0]), RangeCells(0.1, 3), np.ones((2, 3)), 0.1)
    assert scan.rows_at(np.array([heading])).tolist() == [row]


def test_each_heading_has_the_nearest_of_many_rows() -> None:
    headings = np.radians([5.0, 100.0, 200.0, 280.0, 355.0])
    scan = BScan(headings, RangeCells(0.1, 3), np.ones((5, 3)), math.radians(10.0))
    degrees = [[-4.0, 356.0, -359.0, 1.0, 6.0], [96.0, 104.0, 198.0, 284.0, 160.0]]
    assert scan.rows_at(np.radians(degrees[0])).tolist() == [4, 4, 0, 0, 0]
    assert scan.rows_at(np.radians(degrees[1])).tolist() == [1, 1, 2, 3, -1]


def test_higher_levels_are_lighter_in_every_scale() -> None:
    """Lightness alone shows the level, also to colour-blind readers."""
    for decibels, levels in ((True, np.array([-40.0, -30, -20, -10, 0])), (False, np.linspace(0, 1, 5))):
        scale = colour_scale(Pane.MEASURED, decibels, -40.0, LIGHT)
        red, green, blue, _ = scale.of(levels).view(np.uint8).reshape(5, 4).astype(float).T
        assert (np.diff(0.2126 * red + 0.7152 * green + 0.0722 * blue) > 0).all()


def test_unknown_levels_have_no_colour() -> None:
    scale = colour_scale(Pane.DIFFERENCE, True, -40.0, LIGHT)
    assert scale.of(np.array([np.nan]))[0] == 0
    assert in_db(np.array([0.0]), -40.0)[0] == -40.0


@dataclass(frozen=True)
class Content:
    """The arguments of a slice of the B-scan."""

    scene: Scene
    readings: tuple[Reading, ...]
    outline: PredictedScan

    def slice(self, before: BScanRows | None = None) -> BScans:
        return bscan_slice(self.scene, self.readings, self.outline, FLAT, LIGHT, before)


def completed(content: Content) -> BScans:
    """Compute slices until the B-scan is complete, as the window does."""
    answer = content.slice()
    while answer.rows.done < 1:
        answer = content.slice(answer.rows)
    return answer


@pytest.fixture(scope="module")
def content(scene: Scene) -> Content:
    outline = predict_scan(scene.room, scene.pose, scene.board, np.radians(np.arange(0.0, 360.0, 20.0)))
    readings = tuple(reading(k, 20.0 * k, spike(1.0)) for k in range(18))
    return Content(scene, readings, outline)


def test_computation_in_slices_gives_the_same_rows_as_single_predictions(content: Content) -> None:
    answer = completed(content)
    cells = answer.rows.cells
    headings = content.outline.headings
    expected = [content.outline.ping(k).signal(2 * cells.reach / SPEED) for k in range(len(headings))]
    speed = content.scene.room.air.speed_of_sound
    np.testing.assert_allclose(answer.predicted.headings, headings, atol=1e-9)
    for row, signal in zip(answer.predicted.levels, expected, strict=True):
        np.testing.assert_allclose(row[:-1], trace_row(signal.envelope(), speed, cells)[:-1])
    assert set(answer.pictures) == set(Pane)


def test_a_row_is_computed_again_only_for_another_reading(content: Content) -> None:
    first = completed(content).rows
    again = replace(content, readings=(*content.readings[1:], reading(99, 0.0, spike(2.0)))).slice(first)
    kept = [key for key in first.measured if again.rows.measured[key][1] is first.measured[key][1]]
    assert len(kept) == len(content.readings) - 1
    assert all(again.rows.predicted[key] is first.predicted[key] for key in first.predicted)
    cells = again.rows.cells
    assert loudest_at(again.rows.measured[0][1], cells) == pytest.approx(2.0, abs=cells.width)


def test_another_prediction_replaces_only_the_predicted_rows(content: Content) -> None:
    first = completed(content).rows
    again = replace(content, outline=replace(content.outline)).slice(first).rows
    assert all(again.measured[key] is first.measured[key] for key in first.measured)
    assert not any(row is first.predicted.get(key) for key, row in again.predicted.items())


def test_without_traces_the_measured_picture_shows_only_the_ranges(content: Content) -> None:
    answer = completed(replace(content, readings=(reading(0, 40.0, ranges=(0.5, 1.5)), reading(1, 60.0))))
    assert not answer.rows.traced
    cells, row = answer.rows.cells, answer.measured.levels[answer.measured.row_at(math.radians(40.0)) or 0]
    assert cells.middles[np.isfinite(row)] == pytest.approx([0.5, 1.5], abs=cells.width)
    assert np.isnan(answer.measured.levels[1]).all()


def test_an_unreadable_trace_is_a_gap_and_is_reported(content: Content) -> None:
    class Torn(Trace):
        @property
        def times(self) -> FloatArray:
            raise NotALog("scan.mcap: the trace of reading 3 cannot be read")

    broken = replace(content.readings[3], trace=Torn(np.zeros(1), RATE, 0.0))
    readings = (*content.readings[:3], broken, *content.readings[4:])
    answer = completed(replace(content, readings=readings))
    assert "reading 3" in answer.rows.unreadable
    silent = [np.isnan(row).all() for row in answer.measured.levels]
    assert silent == [k == 3 for k in range(18)]


def test_the_level_at_a_point_is_that_of_its_row_and_cell() -> None:
    levels = np.array([[0.1, 0.2, 0.3, math.nan], [0.5, 0.6, 0.7, 0.8]])
    scan = BScan(np.radians([10.0, 100.0]), RangeCells(0.5, 4), levels, math.radians(6.0))
    assert scan.cells.reach == 2.0
    assert scan.level_at(math.radians(12.0), 0.6) == 0.2
    assert scan.level_at(math.radians(100.0 - 360.0), 0.0) == 0.5
    assert scan.level_at(math.radians(100.0), 1.99) == 0.8
    for degrees, distance in ((10.0, 1.6), (100.0, 2.0), (100.0, -0.1), (50.0, 1.0)):
        assert scan.level_at(math.radians(degrees), distance) is None
