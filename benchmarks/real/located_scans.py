"""Reliability of the probabilities of `locate`: `python -m benchmarks.real.located_scans [FOLDER]`.

Locates each scan of the folder, and of its folders with a scans.csv, in the whole arena with unknown heading, by the
generic profile. Prints stated probability and result of the first pose, the rate of being right by bands of the
probability with its 95 % binomial interval (Clopper and Pearson), and means over sensors and places. A pose within
10 cm of the written position is right.

What `locate` has learned on sensors (`compare/sonarhw_compare/learned.toml`) is learned here again for each sensor
without its scans, so that no probability in the table is learned on the sensor that it is of. `--learn` learns it on
all sensors and writes that file: so a folder with scans of another sensor adds it to the population. For this, some
scans are also located in rooms in which they were not made. Results of each scan are kept in build/real_scans, so that
an interrupted run goes on. Seven minutes of processor time for 59 scans.

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
from scipy.optimize import minimize, minimize_scalar
from scipy.special import expit, logit, softmax
from scipy.stats import binomtest
from sonarhw_compare.corrections import MIRRORED
from sonarhw_compare.locate import Learned, Located

from benchmarks.real.judged_scans import RealScan, load_sensors, program_options
from benchmarks.real.real_places import OTHER_ROOMS, locate_real
from benchmarks.real.sensor_table import kept
from sonarhw.readings import FloatArray

BANDS = (0.0, 0.5, 0.6, 0.8, 0.9, 1.0)
POOLED = (0.0, 0.8, 1.0)  # few scans in a band cannot contradict what it states
RIGHT = 0.1  # m from the true position
SAME_TEAM = {"A": "AB", "B": "AB"}  # two recordings by one team are one sensor
WRONG_ROOM = 0.03  # assumed share of scans that are located in a wrong room
_EVERY = 4  # scan is located in other rooms, too
_LEAST = 1e-3  # probability that a right pose has at least
FILE = Path("compare/sonarhw_compare/learned.toml")

First = tuple[float, bool]  # stated probability of a first pose, and whether it is right


@dataclass(frozen=True)
class Outcome:
    """What is known of one located scan."""

    sensor: str
    spot: str
    name: str
    right: tuple[bool, ...]  # of the poses
    log_likelihoods: FloatArray  # of the poses, of independent readings
    volumes: FloatArray  # their logarithms
    explained: float  # share of the echoes at the first pose
    read_rightly: float  # probability that the scan was read rightly, given that it is of this room
    mirrored: float  # logarithm of the odds that angles are clockwise, at equal prior probabilities
    seconds: float  # of processor time

    def shares(self, temperature: float) -> FloatArray:
        """Return the probabilities of the poses if one of them is right."""
        return np.asarray(softmax(self.log_likelihoods / temperature + self.volumes))


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
    found = []
    for outcome in outcomes:
        others = [one for one in outcomes if one.sensor != outcome.sensor]
        by = learned_on(others, [share for sensor, share in elsewhere if sensor != outcome.sensor])
        found.append(first_pose(outcome, by))
        stated, right = found[-1]
        print(f"{outcome.name:5} {stated:6.1%} {'right' if right else 'wrong':5} {outcome.explained:4.0%}", flush=True)
    print_reliability(outcomes, found)
    if chosen.mirrored:
        print_mirrored(outcomes)
    by = learned_on(outcomes, [share for _, share in elsewhere])
    text = learned_text(by, outcomes, [share for _, share in elsewhere])
    print(f"\n{text}")
    if chosen.learn:
        FILE.write_text(text, encoding="utf-8")


def located_outcome(scan: RealScan) -> Outcome:
    """Locate a scan in the arena."""
    begin = process_time()
    located = locate_real(scan)
    poses, spent = located.poses, process_time() - begin
    all_poses = sum(pose.probability for pose in poses)
    return Outcome(
        SAME_TEAM.get(scan.sensor, scan.sensor),
        scan.spot,
        scan.name,
        tuple(math.dist(pose.position, (scan.x, scan.y)) < RIGHT for pose in poses),
        np.array([pose.log_likelihood for pose in poses]),
        np.array([pose.log_volume for pose in poses]),
        located.explained,
        all_poses / (1 - located.nothing),
        _mirrored_odds(located, all_poses),
        spent,
    )


def _mirrored_odds(located: Located, all_poses: float) -> float:
    reversed_angles = [one.pose.probability for one in located.others if one.correction == MIRRORED]
    return math.log(max(sum(reversed_angles), 1e-12) / max(all_poses, 1e-12)) + math.log(19.0)  # prior of 0.05


def _explained(scan: RealScan, room: str) -> float:
    """Return the share of the echoes that is explained in a room in which a scan was not made."""
    return locate_real(scan, room_name=room).explained


def learned_on(outcomes: Sequence[Outcome], elsewhere: Sequence[float]) -> Learned:
    """Return what these scans show, and shares explained in other rooms; sensors and places have equal weights."""

    def loss(temperature: float) -> float:
        return mean_of(outcomes, lambda one: -math.log(max(one.shares(temperature)[list(one.right)].sum(), _LEAST)))

    temperature = float(minimize_scalar(loss, bounds=(0.2, 5.0), method="bounded").x)
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
    missing = mean_of(outcomes, lambda one: not any(one.right))
    return Learned(temperature, usual, spread, missing, float(expit(at_usual + logit(WRONG_ROOM))), by_share)


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
    shares = outcome.shares(by.temperature) * outcome.read_rightly * (1 - by.chance_of_nothing(outcome.explained))
    first = int(shares.argmax())
    return float(shares[first]), outcome.right[first]


def learned_text(by: Learned, outcomes: Sequence[Outcome], elsewhere: Sequence[float]) -> str:
    """Return the content of `learned.toml`."""
    sensors = ", ".join(dict.fromkeys(one.sensor for one in outcomes))
    return f"""\
# What `locate` has learned on scans of real sensors at known places. To add a sensor, add its scans to FOLDER:
# `python -m benchmarks.real.located_scans FOLDER --learn` writes this file. Learned on {len(outcomes)} scans of
# sensors {sensors}, and on {len(elsewhere)} searches in rooms in which they were not made.
# {WRONG_ROOM:.0%} of all scans are assumed to be located in a wrong room.
temperature = {by.temperature:.2f}
usual_explained = {by.usual_explained:.3f}
usual_explained_sd = {by.usual_explained_sd:.3f}
missing = {by.missing:.3f}
wrong_room_at_usual = {by.wrong_room_at_usual:.4f}
wrong_room_by_share = {by.wrong_room_by_share:.3f}
"""


def print_mirrored(outcomes: Sequence[Outcome]) -> None:
    """Print how often the reversed angles of a scan are recognised, by the odds at equal prior probabilities.

    The odds of a reversed copy are those of the scan the other way round.
    """
    odds = np.array([one.mirrored for one in outcomes])
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
    weights, listed = weights_of(outcomes), mean_of(outcomes, lambda one: any(one.right))
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
