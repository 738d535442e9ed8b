"""The log-likelihood of poses and the particle filter find the pose at which readings were predicted."""

import math

import numpy as np
import pytest
from sonarhw_compare.track import NearestLikelihood, Tracker, log_likelihood
from sonarhw_sim.air import Model

import sonarhw
from sonarhw import InputError
from sonarhw.readings import FloatArray

ROOM = sonarhw.load_room("laboratory")
BOARD = sonarhw.load_board("hc-sr04")
HEADINGS = np.arange(16) * math.tau / 16
POSE = np.array([1.72, 1.23, 0.4])


def measured(poses: FloatArray) -> FloatArray:
    return np.asarray(sonarhw.predict_ranges(ROOM, poses, HEADINGS, BOARD))


def test_the_likelihood_is_highest_at_the_pose_of_the_readings() -> None:
    ranges = measured(POSE[None])[0]
    offsets = np.array(
        [[dx, dy, turn] for dx in (-0.05, 0, 0.05) for dy in (-0.05, 0, 0.05) for turn in (-0.1, 0, 0.1)]
    )
    poses = POSE + offsets
    exact = log_likelihood(ROOM, poses, HEADINGS, ranges, BOARD)
    assert exact.argmax() == len(poses) // 2
    moved = log_likelihood(ROOM, poses, HEADINGS, ranges, BOARD, cell=0.02)
    assert moved.argmax() == len(poses) // 2
    assert np.median(np.abs(moved - exact)) < 0.2
    turned = log_likelihood(ROOM, poses * [1, 1, 180 / math.pi], np.degrees(HEADINGS), ranges, BOARD, degrees=True)
    assert np.allclose(turned, exact)


def test_silence_counts_and_readings_in_any_order_are_equal() -> None:
    ranges = measured(POSE[None])[0]
    silent = np.full(16, np.nan)
    assert log_likelihood(ROOM, POSE, HEADINGS, silent, BOARD)[0] < -16
    order = np.random.default_rng(1).permutation(16)
    both = [log_likelihood(ROOM, POSE, HEADINGS[rows], ranges[rows], BOARD)[0] for rows in (slice(None), order)]
    assert both[0] == pytest.approx(both[1])
    infinite = np.where(np.isnan(ranges), np.inf, ranges)
    assert log_likelihood(ROOM, POSE, HEADINGS, infinite, BOARD)[0] == both[0]


def test_the_nearest_wall_along_the_axis_is_the_mean_of_the_baseline() -> None:
    room = sonarhw.room_from_arrays([[0, 0], [4, 0], [4, 3], [0, 3]])
    near = NearestLikelihood(room, BOARD, Model.NEAREST)
    poses = np.array([[x, 1.5, 0.0] for x in np.linspace(0.5, 3.5, 301)])
    best = poses[near(poses, np.zeros(1), np.array([1.2])).argmax(), 0]
    assert best == pytest.approx(2.8, abs=0.02)


def driven(count: int) -> tuple[FloatArray, FloatArray]:
    """Return poses on an arc, and the odometry between them, which measures 4 % too much."""
    turns = 0.4 + 0.05 * np.arange(count)
    steps = 0.04 * np.column_stack((np.cos(turns), np.sin(turns)))
    poses = np.column_stack((POSE[:2] - (0.3, 0.2) + np.cumsum(steps, axis=0), turns))
    odometry = np.tile([0.04 * 1.04, 0.0, 0.05 * 1.04], (count, 1))
    odometry[0] = 0
    return poses, odometry


def test_a_tracker_follows_a_drive_and_repeats_with_its_seed() -> None:
    poses, odometry = driven(12)
    ranges = measured(poses)
    ranges[::3, 5] = 0.3  # stray
    results = []
    for _ in range(2):
        tracker = Tracker(ROOM, BOARD, poses[0], particles=300, seed=4)
        results.append([tracker.update(step, HEADINGS, row) for step, row in zip(odometry, ranges, strict=True)])
    assert results[0] == results[1]
    errors = [math.dist(found.position, pose[:2]) for found, pose in zip(results[0], poses, strict=True)]
    assert max(errors) < 0.05
    assert abs(math.remainder(results[0][-1].heading - poses[-1, 2], math.tau)) < math.radians(2)
    assert not any(found.lost for found in results[0])
    assert all(0 < deviation < 0.1 for deviation in results[0][-1].deviations)
    assert tracker.particles.shape == (300, 3)
    assert tracker.weights.sum() == pytest.approx(1)


def test_a_robot_that_was_carried_away_is_lost() -> None:
    tracker = Tracker(ROOM, BOARD, POSE, particles=100, cell=0.2)
    elsewhere = measured(np.array([[0.9, 0.5, 2.0]]))[0]
    found = [tracker.update([0, 0, 0], HEADINGS, elsewhere) for _ in range(4)]
    assert found[-1].lost


def test_an_update_refuses_wrong_arguments() -> None:
    tracker = Tracker(ROOM, BOARD, POSE, particles=5)
    for step, headings, ranges, refused in (
        ([0, 0], HEADINGS, np.ones(16), "odometry"),
        ("left", HEADINGS, np.ones(16), "odometry"),
        ([0, 0, 0], "all", np.ones(16), "headings"),
        ([0, 0, 0], HEADINGS, np.ones(3), "ranges"),
    ):
        with pytest.raises(InputError, match=refused):
            tracker.update(step, headings, ranges)
