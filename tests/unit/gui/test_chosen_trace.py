"""The content of the trace view without a window: times, levels, gains and carriers checked against physics."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sonarhw_gui.jobs.traces import chosen_trace
from sonarhw_gui.model.scene import Scene
from sonarhw_sim.air import Receiver
from sonarhw_sim.board.profile import load_board
from sonarhw_sim.board.signal import CONVERTER_RATE
from sonarhw_sim.predict.predicted_scan import PredictedScan
from sonarhw_sim.predict.prediction import PredictionOptions, predict_scan
from sonarhw_sim.room.room import Place, load_room

from sonarhw.readings import Reading, Trace
from tests.fixtures.window_scene import ROOM

SPEED = 343.2
DISTANCE = 0.9  # m; its echo comes just after a gain step, where the stepped gain differs most from the ideal one


def reading(trace: Trace | None = None, echo_times: tuple[float, ...] = ()) -> Reading:
    return Reading(0, 0, 0, 0.0, 0.0, echo_times, SPEED, trace=trace)


@pytest.fixture(scope="module", params=[*Receiver])
def before_a_wall(request: pytest.FixtureRequest) -> Scene:
    """A board in front of a single wall; the echo stays below full scale."""
    room = load_room(ROOM)
    wall = np.array([[(DISTANCE, -3.0), (DISTANCE, 3.0)]]).reshape(room.walls[:1].shape)
    board = replace(load_board("polaroid-6500"), max_range=3.0)
    room = replace(room, walls=wall, reflectances=np.full_like(room.reflectances, 0.5))
    return Scene(room, Place("here", (0.0, 0.0)), board, options=PredictionOptions(receiver=request.param))


def predicted_of(scene: Scene) -> PredictedScan:
    return predict_scan(scene.room, scene.pose, scene.board, np.array([0.0]), scene.options)


def test_the_mark_of_an_echo_has_the_time_and_the_level_of_the_trace(before_a_wall: Scene) -> None:
    scene = before_a_wall
    trace = chosen_trace(scene, reading(), predicted_of(scene), 0)
    speed = scene.room.air.speed_of_sound
    (echo,) = [echo for echo in trace.echoes if echo.first]
    assert echo.time == pytest.approx(2 * DISTANCE / speed, rel=1e-6)
    envelope = trace.predicted.envelope
    near = (envelope.times > echo.time) & (envelope.times < echo.time + 0.001)
    # no gain step lies within this burst
    assert envelope.values[near].max() == pytest.approx(echo.level_db, abs=0.3)


def test_the_gain_depends_on_the_receiver(before_a_wall: Scene) -> None:
    scene = before_a_wall
    trace = chosen_trace(scene, reading(), None, 0)
    steps = np.diff(trace.gain.values)
    if scene.options.receiver is Receiver.BOARD:
        assert trace.stepped_gain
        assert set(np.round(steps, 6)) == {0.0, scene.board.gain_step_db}
        risen = trace.gain.times[1:][steps > 0]
        within = [time for time in scene.board.gain_steps if time < trace.gain.times[-1]]
        assert risen.tolist() == within
    else:
        assert not trace.stepped_gain
        without_air = replace(scene, board=replace(scene.board, absorption=False))
        curve = chosen_trace(without_air, reading(), None, 0).gain
        twice = np.interp(2 * curve.times[50], curve.times, curve.values) - curve.values[50]
        assert twice == pytest.approx(20 * math.log10(2), abs=0.01)


def test_blanking_and_threshold_come_from_the_board(before_a_wall: Scene) -> None:
    trace = chosen_trace(before_a_wall, reading(), None, 0)
    assert trace.blanking == before_a_wall.board.blanking
    assert trace.threshold_db == before_a_wall.board.threshold_db
    assert trace.floor_db < trace.threshold_db
    assert trace.range_at(trace.time_at(1.25)) == pytest.approx(1.25)
    assert trace.range_at(0.01) == pytest.approx(1.716)


def test_a_carrier_is_predicted_at_the_sample_rate_of_the_measured_one(before_a_wall: Scene) -> None:
    prediction = predicted_of(before_a_wall)
    samples = prediction.ping(0).signal(0.015).sampled()
    carried = Trace(samples, CONVERTER_RATE, 0.0, carrier=True)
    trace = chosen_trace(before_a_wall, reading(carried), prediction, 0)
    assert trace.predicted.undersampled
    count = min(len(samples), len(trace.predicted.rf.values))
    np.testing.assert_array_equal(trace.predicted.rf.values[:count], trace.measured.rf.values[:count])
    loud = trace.predicted.envelope.values > -20
    measured = np.interp(trace.predicted.envelope.times, trace.measured.envelope.times, trace.measured.envelope.values)
    inside = loud & (trace.predicted.envelope.times > 0.004)
    assert np.abs(measured - trace.predicted.envelope.values)[inside].max() < 3.0


def test_a_fast_converter_does_not_undersample_the_carrier(before_a_wall: Scene) -> None:
    fast = Trace(np.zeros(4000), 400e3, 0.0, carrier=True)
    trace = chosen_trace(before_a_wall, reading(fast), predicted_of(before_a_wall), 0)
    assert not trace.predicted.undersampled
    assert trace.predicted.rate == 400e3


def test_without_a_measured_carrier_the_predicted_one_has_several_samples_per_period(before_a_wall: Scene) -> None:
    envelope = Trace(np.zeros(500), 50e3, 0.0)
    trace = chosen_trace(before_a_wall, reading(envelope), predicted_of(before_a_wall), 0)
    assert trace.measured.rf is None
    assert trace.predicted.rate >= 5 * before_a_wall.board.frequency
    assert trace.duration == pytest.approx(499 / 50e3)


def test_without_prediction_the_measured_trace_is_shown(scene: Scene) -> None:
    trace = chosen_trace(scene, reading(Trace(np.full(100, 0.1), 50e3, 0.001), (0.0012, 0.0018)), None, 0)
    assert trace.predicted is None
    assert trace.echoes == ()
    np.testing.assert_allclose(trace.measured.envelope.values, -20.0)
    assert trace.measured.envelope.times[0] == 0.001
    assert trace.echo_times.tolist() == [0.0012, 0.0018]
