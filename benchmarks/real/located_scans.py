"""Reliability of the probabilities of `locate`: `python -m benchmarks.real.located_scans [FOLDER]`.

Locates each scan of the folder, and of its folders with a scans.csv, in the whole arena with unknown heading, by the
generic profile. Prints stated probability and result of the first pose, the rate of being right by bands of the
probability with its 95 % binomial interval (Clopper and Pearson), and means over sensors and places. A pose within
10 cm of the written position is right.

What `locate` has learned on sensors (`compare/sonarhw_compare/learned.toml`) is learned here again for each sensor
without its scans, so that no probability in the table is learned on the sensor that it is of. `--learn` learns it on
all sensors and writes that file: so a folder with scans of another sensor adds it to the population. For this, some
scans are also located in rooms in which they were not made. Results of each scan are kept in build/real_scans, so that
an interrupted run goes on. Ten minutes of processor time for 59 scans.

`--mirrored` also prints how often scans with reversed angles are recognised, and others are taken for reversed ones.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from statistics import fmean, median, pstdev
from time import process_time

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit, logit, logsumexp, softmax
from scipy.stats import binomtest
from sonarhw_compare.corrections import MIRRORED
from sonarhw_compare.locate import CLOCKWISE, Learned, learned
from sonarhw_compare.regions import angles_and_ranges, shares_of_readings

from benchmarks.real.judged_scans import RealScan, load_sensors, program_options
from benchmarks.real.real_places import OTHER_ROOMS, locate_real
from benchmarks.real.sensor_table import kept
from sonarhw.readings import BoolArray, FloatArray

BANDS = (0.0, 0.5, 0.6, 0.8, 0.9, 1.0)
POOLED = (0.0, 0.8, 1.0)  # few scans in a band cannot contradict what it states
RIGHT = 0.1  # m from the true position
SAME_TEAM = {"A": "AB", "B": "AB"}  # two recordings by one team are one sensor
WRONG_ROOM = 0.03  # assumed share of scans that are located in a wrong room
ALIKE = tuple(k / 10 for k in range(1, 10))  # the likelihood is flat, and a search depends a little on it
_EVERY = 4  # scan is located in other rooms, too
_LEAST = 1e-3  # probability that a right pose has at least
_IMPOSSIBLE = -30.0  # logarithm of the weight of reversed angles without a pose
FILE = Path("compare/sonarhw_compare/learned.toml")

First = tuple[float, bool]  # stated probability of a first pose, and whether it is right


@dataclass(frozen=True)
class Outcome:
    """What is known of one located scan; its poses are followed by those with reversed angles."""

    sensor: str
    spot: str
    name: str
    angles: FloatArray  # (n,) rad, of the readings
    ranges: FloatArray  # (n,) m, NaN without an echo
    right: BoolArray  # (poses,)
    mirrored: BoolArray  # (poses,), whether the angles are reversed
    log_likelihoods: FloatArray  # (poses, n), of each reading
    priors: FloatArray  # (poses,), logarithms of prior density and volume
    explained: float  # share of the echoes at the first pose
    unit: float  # probability that the ranges are in this unit, given that the scan is of this room
    seconds: float  # of processor time

    def weights(self, alike: float) -> FloatArray:
        """Return the logarithm of the weight of each pose, at equal prior probabilities of both directions."""
        return self.log_likelihoods @ shares_of_readings(self.angles, self.ranges, alike) + self.priors

    def odds_of_mirrored(self, alike: float) -> float:
        """Return the logarithm of the odds that the angles are reversed, at equal prior probabilities."""
        weights = self.weights(alike)
        return float(logsumexp([_IMPOSSIBLE, *weights[self.mirrored]]) - logsumexp(weights[~self.mirrored]))


def main() -> None:
    """Print a row for each scan, then the tables."""
    chosen = program_options(
        "Reliability of the probabilities of locate on real scans.",
        learn=f"also write {FILE}",
        mirrored="also print how often reversed angles are recognised",
    )
    scans = [scan for of_sensor in load_sensors(chosen.folder).values() for scan in of_sensor]
    outcomes = [kept(f"located-{scan.name}", [scan], partial(located_outcome, scan)) for scan in scans]
    elsewhere = [
        (SAME_TEAM.get(scan.sensor, scan.sensor), kept(f"{room}-{scan.name}", [scan], partial(_explained, scan, room)))
        for scan in scans[::_EVERY]
        for room in OTHER_ROOMS
    ]
    found, odds = [], []
    without = {
        left_out: learned_on(
            [one for one in outcomes if one.sensor != left_out],
            [share for sensor, share in elsewhere if sensor != left_out],
        )
        for left_out in {outcome.sensor for outcome in outcomes}
    }
    for outcome in outcomes:
        by = without[outcome.sensor]
        found.append(first_pose(outcome, by))
        odds.append(outcome.odds_of_mirrored(by.alike))
        stated, right = found[-1]
        print(f"{outcome.name:5} {stated:6.1%} {'right' if right else 'wrong':5} {outcome.explained:4.0%}", flush=True)
    print_reliability(outcomes, found)
    if chosen.mirrored:
        print_mirrored(outcomes, np.array(odds))
    by = learned_on(outcomes, [share for _, share in elsewhere])
    text = learned_text(by, outcomes, [share for _, share in elsewhere])
    print(f"\n{text}")
    if chosen.learn:
        FILE.write_text(text, encoding="utf-8")


def located_outcome(scan: RealScan) -> Outcome:
    """Locate a scan in the arena."""
    begin = process_time()
    located = locate_real(scan)
    spent = process_time() - begin
    mirrored = [pose for one in located.others if one.correction == MIRRORED for pose in one.poses]
    poses = [*located.poses, *mirrored]
    of_units = sum(one.pose.probability for one in located.others if one.correction != MIRRORED)
    angles, ranges = angles_and_ranges(located.readings)
    by_reading = np.array([pose.by_reading for pose in poses])
    weighed = by_reading @ shares_of_readings(angles, ranges, learned().alike)
    turned = np.repeat([False, True], [len(located.poses), len(mirrored)])
    return Outcome(
        SAME_TEAM.get(scan.sensor, scan.sensor),
        scan.spot,
        scan.name,
        angles,
        ranges,
        np.array([math.dist(pose.position, (scan.x, scan.y)) < RIGHT for pose in poses]) & ~turned,
        turned,
        by_reading,
        np.array([pose.log_likelihood + pose.log_volume for pose in poses]) - weighed,
        located.explained,
        1 - of_units / (1 - located.nothing),
        spent,
    )


def _explained(scan: RealScan, room: str) -> float:
    """Return the share of the echoes that is explained in a room in which a scan was not made."""
    return locate_real(scan, room_name=room).explained


def learned_on(outcomes: Sequence[Outcome], elsewhere: Sequence[float]) -> Learned:
    """Return what these scans show, and shares explained in other rooms; sensors and places have equal weights."""

    def loss(alike: float) -> float:
        return mean_of(outcomes, lambda one: -math.log(max(softmax(one.weights(alike))[one.right].sum(), _LEAST)))

    alike = min(ALIKE, key=loss)
    usual = mean_of(outcomes, lambda one: one.explained)
    shares = np.array([*(one.explained for one in outcomes), *elsewhere])
    wrong = np.repeat([False, True], [len(outcomes), len(elsewhere)])
    weights = np.concatenate((weights_of(outcomes), np.full(len(elsewhere), 1 / len(elsewhere)))) / 2

    def wrong_room_loss(values: FloatArray) -> float:
        chances = expit(values[0] + values[1] * 100 * (usual - shares))
        return float(-(weights * np.log(np.where(wrong, chances, 1 - chances))).sum())

    # both kinds of rooms are as frequent here
    at_usual, by_share = minimize(wrong_room_loss, [0.0, 0.1], method="Nelder-Mead").x.tolist()
    spread = pstdev([one.explained for one in outcomes if one.right[0]])
    missing = (1 + sum(not one.right.any() for one in outcomes)) / (2 + len(outcomes))  # rule of succession
    return Learned(alike, usual, spread, missing, float(expit(at_usual + logit(WRONG_ROOM))), by_share)


def weights_of(outcomes: Sequence[Outcome]) -> FloatArray:
    """Return a weight for each scan, (n,), with the sum 1: equal ones for sensors, and for the places of a sensor."""
    sensors = [one.sensor for one in outcomes]
    spots = [(one.sensor, one.spot) for one in outcomes]
    places = {sensor: len({spot for spot in spots if spot[0] == sensor}) for sensor in sensors}
    return np.array([1 / (len(places) * places[spot[0]] * spots.count(spot)) for spot in spots])


def mean_of(outcomes: Sequence[Outcome], value: Callable[[Outcome], float]) -> float:
    """Return the mean over sensors and places."""
    return float(weights_of(outcomes) @ [value(one) for one in outcomes])


def first_pose(outcome: Outcome, by: Learned) -> First:
    """Return the probability of the first pose, and whether it is right."""
    shares = softmax(outcome.weights(by.alike) + np.log(np.where(outcome.mirrored, CLOCKWISE, 1 - CLOCKWISE)))
    shares *= np.where(outcome.mirrored, 0.0, outcome.unit * (1 - by.chance_of_nothing(outcome.explained)))
    first = int(shares.argmax())
    return float(shares[first]), bool(outcome.right[first])


def learned_text(by: Learned, outcomes: Sequence[Outcome], elsewhere: Sequence[float]) -> str:
    """Return the content of `learned.toml`."""
    sensors = ", ".join(dict.fromkeys(one.sensor for one in outcomes))
    return f"""\
# What `locate` has learned on scans of real sensors at known places. To add a sensor, add its scans to FOLDER:
# `python -m benchmarks.real.located_scans FOLDER --learn` writes this file. Learned on {len(outcomes)} scans of
# sensors {sensors}, and on {len(elsewhere)} searches in rooms in which they were not made.
# {WRONG_ROOM:.0%} of all scans are assumed to be located in a wrong room.
alike = {by.alike:.2f}
usual_explained = {by.usual_explained:.3f}
usual_explained_sd = {by.usual_explained_sd:.3f}
missing = {by.missing:.3f}
wrong_room_at_usual = {by.wrong_room_at_usual:.4f}
wrong_room_by_share = {by.wrong_room_by_share:.3f}
"""


def print_mirrored(outcomes: Sequence[Outcome], odds: FloatArray) -> None:
    """Print how often the reversed angles of a scan are recognised, by the logarithms of the odds of them (n,).

    The odds of a reversed copy are those of the scan the other way round.
    """
    weights = weights_of(outcomes)
    for title, least in (("more probable", 0.0), ("9 times as probable", math.log(9.0))):
        copies, scans = weights @ (odds < -least), weights @ (odds > least)
        print(f"reversed angles {title}: {copies:.2f} of reversed copies, {scans:.2f} of the scans as they are")


def print_reliability(outcomes: Sequence[Outcome], found: Sequence[First]) -> None:
    """Print the bands, means over sensors and places, and how many right poses the stated probabilities promise."""
    print("stated probability  scans  mean stated  rate of being right, 95 % interval")
    for low, high in [*pairwise(BANDS), *pairwise(POOLED), (0.0, 1.0)]:
        _print_band(low, high, [one for one in found if low <= one[0] < high or (high == one[0] == 1.0)])
    stated = np.array([probability for probability, _ in found])
    spread = math.sqrt(float((stated * (1 - stated)).sum()))
    right = np.array([float(one) for _, one in found])
    weights, listed = weights_of(outcomes), mean_of(outcomes, lambda one: float(one.right.any()))
    brier, count = weights @ (stated - right) ** 2, right.sum()
    print(f"right first poses: {stated.sum():.1f} ± {spread:.1f} expected, {count:.0f} found; Brier score {brier:.3f}")
    print(
        f"means over sensors and places: right {weights @ right:.3f}, stated {weights @ stated:.3f}; "
        f"true pose listed {listed:.3f}"
    )
    print(f"wrong at 0.95 or more: {int(((stated >= 0.95) & (right == 0)).sum())}")
    print(f"median processor time of a scan: {median(one.seconds for one in outcomes):.1f} s")


def _print_band(low: float, high: float, band: Sequence[First]) -> None:
    """Print one band of stated probabilities, with whether each first pose is right."""
    if not band:
        return
    stated, right = fmean(one[0] for one in band), sum(one[1] for one in band)
    interval = binomtest(right, len(band)).proportion_ci(method="exact")
    rate = f"{right / len(band):.2f}, {interval.low:.2f} to {interval.high:.2f}"
    print(f"{low:8.2f} to {high:4.2f} {len(band):10} {stated:12.2f}  {rate}")


if __name__ == "__main__":
    main()
