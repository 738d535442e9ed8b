"""The content of the window without a window: edits, texts, scans for searches, traces and B-scans."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from sonarhw_compare import pictures
from sonarhw_compare.edits import add_post
from sonarhw_compare.fit import PlacedScan
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.rooms.evidence import FINE, evidence_of
from sonarhw_gui.jobs import traces
from sonarhw_gui.jobs.searches import loaded_scans
from sonarhw_gui.model.edits import Grip, GripPart, dragged, room_grip, sensor_at, sensor_grip, sensor_turned
from sonarhw_gui.model.look import LIGHT, LengthUnit
from sonarhw_gui.model.scene import Scene, scene_of_log
from sonarhw_gui.model.shown import Shown, overlaid
from sonarhw_gui.session.scanner import PackedTrace, packed, start_recording
from sonarhw_gui.views.echoes import EchoList
from sonarhw_sim.air import Air, Receiver
from sonarhw_sim.board.profile import Mount, OwnBodyPart, load_board, parse_board
from sonarhw_sim.board.signal import CONVERTER_RATE
from sonarhw_sim.predict.predicted_scan import PredictedScan, arm
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import Place, Room, load_room

from sonarhw.errors import InputError, NotALog
from sonarhw.log import read_log
from sonarhw.readings import FloatArray, Reading, Trace
from tests.fixtures.window_scene import ROOM

SIMPLE = load_room(ROOM)
SCENE = Scene(SIMPLE, SIMPLE.places["figure9"], load_board("polaroid-6500"))
NOWHERE = Scene(None, None, SCENE.board)


@pytest.fixture
def crowded(scene: Scene) -> Scene:
    """The simple room with a post in the middle."""
    return replace(scene, room=add_post(scene.room, (0.4, 0.4), 0.1, "shelving"))


# edits


def test_the_sensor_cannot_be_inside_a_post_but_above_a_low_one(crowded: Scene) -> None:
    with pytest.raises(InputError, match="cannot be inside post 1"):
        sensor_at(crowded, (0.45, 0.4))
    beside, _ = sensor_at(crowded, (0.6, 0.4))
    post = Grip(GripPart.POST, (0.4, 0.4), crowded.room.names.index("post 1"))
    with pytest.raises(InputError, match="cannot be inside post 1"):
        dragged(beside, post, (0.58, 0.4))
    smaller, label = dragged(beside, replace(post, part=GripPart.RIM, point=(0.5, 0.4)), (0.45, 0.4))
    assert smaller.room.posts[0, 2] == pytest.approx(0.05)
    assert label == "resizing post 1"
    room = load_room(ROOM.with_name("doorstep.toml"))
    assert sensor_at(Scene(room, room.place("tripod"), SCENE.board), (0.5, 1.5))[0].pose.position == (0.5, 1.5)
    with pytest.raises(InputError, match="inside bin"):
        sensor_at(Scene(room, room.place("robot"), SCENE.board), (0.5, 1.5))


@pytest.mark.parametrize(
    ("point", "part"),
    [
        ((0.91, 0.7), GripPart.SENSOR),
        ((0.912, 0.7), None),
        ((0.9, 0.59), GripPart.BEAM),
        ((0.9, 0.588), None),
        ((0.4, 0.4), GripPart.POST),
        ((0.49, 0.4), GripPart.POST),
        ((0.492, 0.4), GripPart.RIM),
        ((0.508, 0.4), GripPart.RIM),
        ((0.51, 0.4), None),
        ((0.92, 0.3), GripPart.WALL),
        ((0.918, 0.3), None),
    ],
)
def test_parts_are_gripped_within_pixels(crowded: Scene, point: tuple[float, float], part: GripPart | None) -> None:
    pixel, at = 0.001, sensor_at(crowded, (0.9, 0.7))[0]
    grip = sensor_grip(at, (0.9, 0.6), point, pixel) or room_grip(crowded.room, point, pixel)
    assert part is (grip and grip.part)
    start = crowded.room.walls.reshape(-1, 2, 2)[0, 0]
    assert room_grip(crowded.room, tuple(start + 0.006), pixel).part is GripPart.CORNER


@pytest.mark.parametrize("receiver", Receiver)
def test_a_recording_contains_pose_and_receiver(scene: Scene, tmp_path: Path, receiver: Receiver) -> None:
    profile = SCENE.board.text.replace('receiver = "board"', f'receiver = "{receiver}"')
    moved, _ = sensor_turned(sensor_at(scene, (0.5, 0.5))[0], math.radians(30.14))
    log, path = start_recording(tmp_path, replace(moved, board=parse_board(profile, "mine.toml")), warn=print)
    log.close()
    again = scene_of_log(read_log(path).metadata)
    assert again.pose.position == (0.5, 0.5)
    assert math.degrees(again.pose.heading) == pytest.approx(30.1)  # rounded, for the file
    assert again.room.places.keys() == {*scene.room.places, "0.5,0.5"}
    assert again.options.receiver_of(again.board) is receiver


# texts


def test_all_rows_of_the_list_of_echoes_state_half_of_the_path_also_that_of_the_winner() -> None:
    scan = predict_scan(SIMPLE, SCENE.place, SCENE.board, np.radians([270.0]))
    listed = EchoList(scan, 0, LengthUnit.M)
    half, _, outcome, path = listed.cells(0)
    assert (half, path) == ("0.827 m", "bottom>top>bottom")
    assert outcome == f"wins, receiver adds {float(scan.ranges[0]) - 0.827:.3f} m"
    second = listed.cells(1)
    assert second[2] == f"{float(second[0][:-2]) - 0.827:.3f} m behind the winner"


# scans that a search for the room uses


def sweep(number: int) -> tuple[Reading, ...]:
    return tuple(Reading(k, number, 0, 0.1 * k, float(k), (0.01,), 343.0) for k in range(3))


def test_each_scan_is_used_once_under_a_name_of_its_own_those_with_a_known_place_first() -> None:
    first, second = sweep(0), sweep(1)
    parts = [overlaid("s", part, NOWHERE) for part in (first, second)]
    hidden = replace(overlaid("hidden", sweep(2), NOWHERE), visible=False)
    shown = Shown(NOWHERE, readings=(*first, *second), overlays=(*parts, hidden))
    assert [(scan.name, scan.readings) for scan in loaded_scans(shown, "shown")] == [("s", first), ("s 2", second)]
    assert [scan.name for scan in loaded_scans(replace(shown, overlays=()), "shown")] == ["shown"]
    assert loaded_scans(replace(shown, overlays=(), readings=()), "shown") == ()
    known = loaded_scans(Shown(NOWHERE, readings=first, overlays=(overlaid("k", second, SCENE),)), "shown")
    assert [(scan.name, scan.has_place) for scan in known] == [("k", True), ("shown", False)]
    assert known[0].place is SCENE.place


def test_readings_of_the_own_body_are_left_out_so_that_evidence_belongs_to_the_right_readings() -> None:
    body = OwnBodyPart(from_deg=5.0, to_deg=7.0, nearest=1.0, farthest=2.0)  # contains the reading at 0.1 rad
    scene, readings = replace(NOWHERE, board=replace(NOWHERE.board, own_body=(body,))), sweep(0)
    (scan,) = loaded_scans(Shown(scene, readings=readings), "shown")
    assert scan.readings == (readings[0], readings[2])
    evidence = evidence_of([PlacedScan(readings, scan.place)], [PoseSpread()], scan.board, Air())
    assert len(scan.readings) == len(evidence.by_reading(evidence.first, FINE)[0])


# updates


# traces and B-scans as arrays: times, levels, gains, carriers and gaps, checked against physics


SPEED = 343.2
RATE = 50_000.0
HERE = Place("here", (0.0, 0.0))
BLACK = traces.ColourScale(np.full((256, 4), 255, dtype=np.uint8), 0.0, 1.0, "")


def spike(distance: float, reach: float = 3.0, level: float = 1.0) -> Trace:
    """Return a silent trace with one sample, at the time of an echo from `distance`."""
    trace = Trace(np.zeros(math.ceil(2 * reach / SPEED * RATE)), RATE, 0.0)
    trace.samples[round(2 * distance / SPEED * RATE)] = level
    return trace


def reading(number: int, degrees: float, trace: Trace | None = None, ranges: tuple[float, ...] = ()) -> Reading:
    times = tuple(2 * distance / SPEED for distance in ranges)
    return Reading(number, 0, 0, math.radians(degrees), 0.1 * number, times, SPEED, trace=trace)


def loudest_at(levels: FloatArray, cells: pictures.RangeCells) -> float:
    return float(cells.middles[np.nanargmax(levels)])


def facing_wall(distance: float) -> Room:
    """Return a room with one long wall in front of the place `HERE`."""
    room = load_room(ROOM)
    wall = np.array([[(distance, -3.0), (distance, 3.0)]]).reshape(room.walls[:1].shape)
    return replace(room, walls=wall, air=Air())


# rows of a B-scan


def test_an_echo_lies_with_its_level_in_the_cell_of_its_range_and_only_the_trace_has_levels() -> None:
    cells = pictures.cells_for(3.0, 0.004)
    for distance in (0.2, 1.0, 2.7):
        row = pictures.trace_row(spike(distance), SPEED, cells)
        assert loudest_at(row, cells) == pytest.approx(distance, abs=cells.width)
    for width in (pictures.RangeCells(0.005, 600), pictures.RangeCells(0.3, 10)):
        assert np.nanmax(pictures.trace_row(spike(1.0, level=0.25), SPEED, width)) == 0.25
    cells = pictures.cells_for(5.0, SPEED / 2 / RATE)
    row = pictures.trace_row(spike(1.0, reach=3.0), SPEED, cells)
    assert cells.count <= pictures.CELLS
    assert np.isfinite(row[cells.middles < 3.0 - cells.width]).all()
    assert np.isnan(row[cells.middles > 3.0 + cells.width]).all()
    for samples in (1, 7, 100, 599, 600, 601, 5000):  # no cell of a whole trace is empty
        cells = pictures.cells_for(samples * 0.004, 0.004)
        assert cells.reach == pytest.approx(samples * 0.004)
        assert np.isfinite(cells.loudest(np.arange(samples) * 0.004, np.ones(samples))).all()


def test_the_envelope_of_an_undersampled_carrier_is_correct() -> None:
    rate, carrier = 76_923.0, 49_400.0
    times = np.arange(1500) / rate
    swell = 0.8 * np.exp(-(((times - 0.01) / 0.001) ** 2))
    found = pictures.envelope_of(Trace(swell * np.cos(math.tau * carrier * times), rate, 0.0, carrier=True))
    assert np.abs(found - swell).max() < 0.01


def test_the_predicted_echo_of_a_wall_lies_where_the_wall_is_also_with_a_transducer_off_the_axis() -> None:
    room, board, cells = facing_wall(1.0), load_board("polaroid-6500"), pictures.cells_for(3.0, 0.004)
    row = pictures.predicted_row(predict_scan(room, HERE, board, np.array([0.0])), 0.0, cells)
    # the echo starts at this range and rises over some cycles
    beyond_ringing = cells.middles > 0.6
    first = cells.middles[beyond_ringing & (row >= 0.1 * np.nanmax(row[beyond_ringing]))][0]
    assert first == pytest.approx(1.0, abs=0.03)
    off_axis = replace(board, max_range=2.0, mount=Mount(ahead=0.05))
    scan = predict_scan(room, HERE, off_axis, np.radians([0.0, 20.0, 340.0]))
    assert scan.only_at is not None
    cells, speed = pictures.cells_for(2.0, 0.004), room.air.speed_of_sound
    for k, heading in enumerate(scan.headings):
        expected = pictures.trace_row(scan.ping(k).signal(2 * cells.reach / speed).envelope(), speed, cells)
        np.testing.assert_array_equal(pictures.predicted_row(scan, heading + 1e-4 - math.tau, cells), expected)


def test_the_newest_reading_lies_at_its_heading_in_the_room() -> None:
    cells, paper = pictures.cells_for(3.0, 0.004), load_board("paper")
    rows = pictures.newest_by_heading([reading(0, 350.0, spike(1.0))], paper, math.radians(30.0))
    bscan = pictures.bscan_of(
        {key: pictures.trace_row(one.trace, SPEED, cells) for key, one in rows.items() if one.trace}, cells
    )
    assert np.degrees(bscan.headings) == pytest.approx([20.0])
    assert [bscan.row_at(math.radians(degrees)) for degrees in (20.0, 380.0, 200.0)] == [0, 0, None]
    old, new = reading(0, 90.0), reading(7, 90.0)
    assert (
        pictures.newest_by_heading([old, reading(3, 180.0), new], paper, 0.0)[pictures.heading_key(math.pi / 2)] is new
    )


def test_each_heading_has_the_nearest_of_many_rows_and_a_point_the_level_of_its_cell() -> None:
    headings = np.radians([5.0, 100.0, 200.0, 280.0, 355.0])
    scan = pictures.BScan(headings, pictures.RangeCells(0.1, 3), np.ones((5, 3)), math.radians(10.0))
    degrees = [[-4.0, 356.0, -359.0, 1.0, 6.0], [96.0, 104.0, 198.0, 284.0, 160.0]]
    assert scan.rows_at(np.radians(degrees[0])).tolist() == [4, 4, 0, 0, 0]
    assert scan.rows_at(np.radians(degrees[1])).tolist() == [1, 1, 2, 3, -1]
    levels = np.array([[0.1, 0.2, 0.3, math.nan], [0.5, 0.6, 0.7, 0.8]])
    scan = pictures.BScan(np.radians([10.0, 100.0]), pictures.RangeCells(0.5, 4), levels, math.radians(6.0))
    assert scan.cells.reach == 2.0
    for degree, distance, level in (
        *((12.0, 0.6, 0.2), (100.0 - 360.0, 0.0, 0.5), (100.0, 1.99, 0.8)),
        *((10.0, 1.6, None), (100.0, 2.0, None), (100.0, -0.1, None), (50.0, 1.0, None)),
    ):
        assert scan.level_at(math.radians(degree), distance) == level


def test_the_difference_is_in_decibels_limited_by_the_floor_and_only_where_both_are_known() -> None:
    cells = pictures.RangeCells(0.1, 3)
    measured = pictures.BScan(np.array([1.0, 2.0]), cells, np.array([[0.1, 1e-5, np.nan], [1.0, 1.0, 1.0]]), 0.1)
    predicted = pictures.BScan(np.array([1.02]), cells, np.array([[0.01, 1e-4, 0.5]]), 0.1)
    result = pictures.difference(measured, predicted, -40.0)
    assert result.headings.tolist() == [1.0]
    np.testing.assert_allclose(result.levels, [[20.0, 0.0, np.nan]])
    np.testing.assert_allclose(pictures.difference(measured, predicted, None).levels[0, :2], [0.09, -9e-5])


# pictures of a B-scan


def test_missing_headings_are_gaps_and_other_headings_are_contiguous() -> None:
    cells = pictures.RangeCells(0.1, 10)
    degrees = [d for d in range(0, 360, 5) if d not in (100, 105)]
    bscan = pictures.bscan_of({pictures.heading_key(math.radians(d)): np.ones(10) for d in degrees}, cells)
    drawn = traces.draw_bscan(bscan, BLACK, None, polar=None)[:, :, 3].T > 0
    left, _, width, _ = traces.flat_area(cells)
    at = left + (np.arange(len(drawn)) + 0.5) / len(drawn) * width
    assert not drawn[(at > 98) & (at < 107)].any()
    assert drawn[(at < 97) | (at > 108)].all()


@pytest.mark.parametrize("mount", [Mount(), Mount(ahead=0.1, aside=0.2, separation=0.04)])
@pytest.mark.parametrize("degrees", [0.0, 60.0, 135.0, 290.0])
def test_a_polar_picture_shows_an_echo_in_front_of_the_transducer_at_its_range(degrees: float, mount: Mount) -> None:
    cells, middle, along = pictures.cells_for(2.0, 0.004), (0.5, -0.25), math.radians(degrees)
    bscan = pictures.bscan_of({pictures.heading_key(along): pictures.echo_row([1.0], cells)}, cells)
    polar = traces.Arm(*arm(replace(load_board("polaroid-6500"), mount=mount)))
    pixels, (left, bottom, width, height) = (
        traces.draw_bscan(bscan, BLACK, None, polar),
        traces.polar_area(cells, middle, polar),
    )
    rows, columns = np.nonzero(pixels[:, :, 3])
    x = float(left + (columns.mean() + 0.5) / pixels.shape[1] * width)
    y = float(bottom + (rows.mean() + 0.5) / pixels.shape[0] * height)
    position = mount.pose(Place("here", middle), along).receiver
    assert (x, y) == pytest.approx((position[0] + math.cos(along), position[1] + math.sin(along)), abs=0.02)
    heading, far = polar.headings_and_ranges(np.array(x - middle[0]), np.array(y - middle[1]))
    assert (math.remainder(heading - along, math.tau), far) == pytest.approx((0.0, 1.0), abs=0.02)


@dataclass(frozen=True)
class Content:
    """The arguments of a slice of the B-scan."""

    scene: Scene
    readings: tuple[Reading, ...]
    outline: PredictedScan

    def slice(self, before: traces.BScanRows | None = None) -> traces.BScans:
        settings = traces.BScanSettings(tuple(traces.Pane), polar=False, decibels=True)
        return traces.bscan_slice(self.scene, self.readings, self.outline, settings, LIGHT, before)

    def completed(self) -> traces.BScans:
        """Compute slices until the B-scan is complete, as the window does."""
        answer = self.slice()
        while answer.rows.done < 1:
            answer = self.slice(answer.rows)
        return answer


@pytest.fixture(scope="module")
def content(scene: Scene) -> Content:
    outline = predict_scan(scene.room, scene.pose, scene.board, np.radians(np.arange(0.0, 360.0, 20.0)))
    return Content(scene, tuple(reading(k, 20.0 * k, spike(1.0)) for k in range(18)), outline)


def test_slices_give_the_same_rows_as_single_predictions(content: Content) -> None:
    answer, first, outline = content.completed(), content.completed().rows, content.outline
    cells, speed = answer.rows.cells, content.scene.room.air.speed_of_sound
    np.testing.assert_allclose(answer.predicted.headings, outline.headings, atol=1e-9)
    for k, row in enumerate(answer.predicted.levels):
        envelope = outline.ping(k).signal(2 * cells.reach / SPEED).envelope()
        np.testing.assert_allclose(row[:-1], pictures.trace_row(envelope, speed, cells)[:-1])
    assert set(answer.pictures) == set(traces.Pane)
    another = (*content.readings[1:], reading(99, 0.0, spike(2.0)))
    again = replace(content, readings=another).slice(first).rows
    kept = [key for key in first.measured if again.measured[key][1] is first.measured[key][1]]
    assert len(kept) == len(content.readings) - 1
    assert all(again.predicted[key] is first.predicted[key] for key in first.predicted)
    assert loudest_at(again.measured[0][1], again.cells) == pytest.approx(2.0, abs=again.cells.width)
    again = replace(content, outline=replace(outline)).slice(first).rows
    assert all(again.measured[key] is first.measured[key] for key in first.measured)
    assert not any(row is first.predicted.get(key) for key, row in again.predicted.items())


def test_without_traces_only_ranges_are_shown_and_an_unreadable_trace_is_a_gap(content: Content) -> None:
    class Torn(Trace):
        @property
        def times(self) -> FloatArray:
            raise NotALog("scan.mcap: the trace of reading 3 cannot be read")

    answer = replace(content, readings=(reading(0, 40.0, ranges=(0.5, 1.5)), reading(1, 60.0))).completed()
    assert not answer.rows.traced
    cells, row = answer.rows.cells, answer.measured.levels[answer.measured.row_at(math.radians(40.0)) or 0]
    assert cells.middles[np.isfinite(row)] == pytest.approx([0.5, 1.5], abs=cells.width)
    assert np.isnan(answer.measured.levels[1]).all()
    broken = replace(content.readings[3], trace=Torn(np.zeros(1), RATE, 0.0))
    answer = replace(content, readings=(*content.readings[:3], broken, *content.readings[4:])).completed()
    assert "reading 3" in answer.rows.unreadable
    assert [np.isnan(row).all() for row in answer.measured.levels] == [k == 3 for k in range(18)]


# the trace of one reading

DISTANCE = 0.9  # m; its echo comes just after a gain step, where the stepped gain differs most from the ideal one


@pytest.fixture(scope="module", params=[*Receiver])
def before_a_wall(request: pytest.FixtureRequest) -> Scene:
    """A board in front of a single wall; the echo stays below full scale."""
    room = facing_wall(DISTANCE)
    board = replace(load_board("polaroid-6500"), max_range=3.0)
    room = replace(room, air=load_room(ROOM).air, reflectances=np.full_like(room.reflectances, 0.5))
    return Scene(room, HERE, board, options=PredictionOptions(receiver=request.param))


def predicted_of(scene: Scene) -> PredictedScan:
    return predict_scan(scene.room, scene.pose, scene.board, np.array([0.0]), scene.options)


def test_marks_gain_blanking_and_threshold_are_those_of_echo_receiver_and_board(before_a_wall: Scene) -> None:
    scene, board = before_a_wall, before_a_wall.board
    trace = traces.chosen_trace(scene, reading(0, 0.0), predicted_of(scene), 0)
    (echo,) = [echo for echo in trace.echoes if echo.first]
    assert echo.time == pytest.approx(2 * DISTANCE / scene.room.air.speed_of_sound, rel=1e-6)
    envelope = trace.predicted.envelope
    near = (envelope.times > echo.time) & (envelope.times < echo.time + 0.001)  # no gain step lies within this burst
    assert envelope.values[near].max() == pytest.approx(echo.level_db, abs=0.3)
    assert (trace.blanking, trace.threshold_db) == (board.blanking, board.threshold_db)
    assert trace.floor_db < trace.threshold_db
    assert trace.range_at(trace.time_at(1.25)) == pytest.approx(1.25)
    assert trace.range_at(0.01) == pytest.approx(1.716)
    steps = np.diff(trace.gain.values)
    assert trace.stepped_gain is (scene.options.receiver is Receiver.BOARD)
    if trace.stepped_gain:
        assert set(np.round(steps, 6)) == {0.0, board.gain_step_db}
        risen = trace.gain.times[1:][steps > 0].tolist()
        assert risen == [time for time in board.gain_steps if time < trace.gain.times[-1]]
    else:
        curve = traces.chosen_trace(
            replace(scene, board=replace(board, absorption=False)), reading(0, 0.0), None, 0
        ).gain
        twice = np.interp(2 * curve.times[50], curve.times, curve.values) - curve.values[50]
        assert twice == pytest.approx(20 * math.log10(2), abs=0.01)


def test_a_carrier_is_predicted_at_the_sample_rate_of_the_measured_one(before_a_wall: Scene) -> None:
    prediction = predicted_of(before_a_wall)
    samples = prediction.ping(0).signal(0.015).sampled()
    carried = Trace(samples, CONVERTER_RATE, 0.0, carrier=True)
    trace = traces.chosen_trace(before_a_wall, reading(0, 0.0, carried), prediction, 0)
    assert trace.predicted.undersampled
    count = min(len(samples), len(trace.predicted.rf.values))
    np.testing.assert_array_equal(trace.predicted.rf.values[:count], trace.measured.rf.values[:count])
    envelope, heard = trace.predicted.envelope, trace.measured.envelope
    loud = (envelope.values > -20) & (envelope.times > 0.004)
    assert np.abs(np.interp(envelope.times, heard.times, heard.values) - envelope.values)[loud].max() < 3.0
    fast = traces.chosen_trace(
        before_a_wall, reading(0, 0.0, Trace(np.zeros(4000), 400e3, 0.0, carrier=True)), prediction, 0
    )
    assert (fast.predicted.undersampled, fast.predicted.rate) == (False, 400e3)
    plain = traces.chosen_trace(before_a_wall, reading(0, 0.0, Trace(np.zeros(500), 50e3, 0.0)), prediction, 0)
    assert plain.measured.rf is None
    assert plain.predicted.rate >= 5 * before_a_wall.board.frequency
    assert plain.duration == pytest.approx(499 / 50e3)


# packed traces


# traces in memory


@pytest.mark.parametrize("full", [255, 65_535])
@pytest.mark.parametrize("carrier", [False, True])
def test_a_trace_of_converter_steps_is_packed_and_any_other_is_kept(full: int, carrier: bool) -> None:
    steps = np.array([0, 1, 77, full - 1, full]) / full
    trace = Trace(2 * steps - 1 if carrier else steps, 80e3, 0.001, carrier)
    stored = packed(trace)
    assert isinstance(stored, PackedTrace)
    np.testing.assert_array_equal(stored.samples, trace.samples)
    assert (stored.rate, stored.start, stored.carrier) == (trace.rate, trace.start, carrier)
    for samples in (steps + 0.3 / full, [0.0, math.nan], [0.0, 1 + 1 / full]):
        between = Trace(np.array(samples), 80e3, 0.0)
        assert packed(between) is between
