"""Tune the profile `lego-nxt` on real scans: `python -m benchmarks.tune_lego_nxt [FOLDER]`.

Takes the folder of real scans; tries apertures and thresholds on a grid, writes the best into sim/boards/lego-nxt.toml
with where it comes from, and prints what it explains, also of places and recordings that it was not tuned on.

Two numbers are tuned, everything else of the profile is what is known of the sensor. Every candidate gets the mean of
two figures of all scans: the share of echoes within 5 cm, and the ROC area of silence (`compare.silence`). Of each scan
only heading, range offset and a position within 3 cm are found. Since a figure of some thousand readings is jagged, a
candidate's score is the mean of itself and its neighbours on the grid.
"""

import hashlib
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from benchmarks.real_scans import DEFAULT_FOLDER, NEARBY, ROOM, Figures, RealScan, load_scans
from compare.fit.plain import all_round, best_agreement, places_near
from compare.match import compare_readings
from compare.silence import roc_area
from sim.board import Board, load_board
from sim.paths import Paths
from sim.prediction import PredictionOptions, paths_for, weigh_paths
from sim.room import Place
from sonarhw.readings import FloatArray

APERTURES = np.arange(3.0, 5.51, 0.25) / 1000  # m
THRESHOLDS = np.arange(-28.0, -11.9, 1.0)  # dB
PROFILE = Path("sim/boards/lego-nxt.toml")

Known = Mapping[str, Sequence[tuple[Place, Paths]]]  # by spot: the places near it, and the paths of each


@dataclass(frozen=True)
class Judged:
    """What one candidate makes of one scan."""

    matched: int  # echoes within 5 cm
    sounding: NDArray[np.bool_]  # (n,): readings with an echo
    scores: FloatArray  # (n,), dB: level of the loudest predicted echo over the threshold


@dataclass(frozen=True)
class Trial:
    """All candidates on all scans."""

    scans: Sequence[RealScan]
    judged: dict[tuple[int, int, str], Judged]  # by rows of APERTURES and THRESHOLDS, and name of the scan

    def figures(self, candidate: tuple[int, int], names: Sequence[str]) -> Figures:
        """What a candidate makes of some scans."""
        return figures_of([self.judged[(*candidate, name)] for name in names])

    def best(self, names: Sequence[str]) -> tuple[int, int]:
        """The candidate with the highest score on some scans, neighbours counted in."""
        scores = np.array(
            [[_score(self.figures((a, t), names)) for t in range(len(THRESHOLDS))] for a in range(len(APERTURES))]
        )
        a, t = np.unravel_index(uniform_filter(scores, 3, mode="nearest").argmax(), scores.shape)
        return int(a), int(t)


def figures_of(judged: Sequence[Judged]) -> Figures:
    """Share and ROC area of several scans together."""
    sounding = np.concatenate([scan.sounding for scan in judged])
    scores = np.concatenate([scan.scores for scan in judged])
    return Figures(sum(scan.matched for scan in judged) / int(sounding.sum()), roc_area(scores, sounding.tolist()))


def _score(figures: Figures) -> float:
    return (figures.share + (figures.roc_area or 0.5)) / 2


def try_all(scans: Sequence[RealScan], told: Callable[[str], None] = lambda _: None) -> Trial:
    """Every candidate on every scan; paths are found once and only weighed anew."""
    base = load_board("lego-nxt")
    known = known_paths(scans, replace(base, threshold_db=float(THRESHOLDS.min())))
    judged = {}
    for a, aperture in enumerate(APERTURES.tolist()):
        for t, threshold in enumerate(THRESHOLDS.tolist()):
            board = replace(base, aperture_radius=aperture, threshold_db=threshold)
            for name, found in judge_all(scans, board, known).items():
                judged[a, t, name] = found
        told(f"aperture radius {aperture * 1000:.2f} mm done")
    return Trial(scans, judged)


def known_paths(scans: Sequence[RealScan], board: Board) -> Known:
    """The paths of every position near the places of the scans that `board` could hear."""
    spots = dict.fromkeys(scan.spot for scan in scans)
    options = PredictionOptions()
    return {
        spot: [(near, paths_for(ROOM, near, board, options)) for near in places_near(ROOM.place(spot))]
        for spot in spots
    }


def judge_all(scans: Sequence[RealScan], board: Board, known: Known) -> dict[str, Judged]:
    """What one board makes of every scan, by its name, with heading, offset and position found for each."""
    tables = {
        spot: [(place, weigh_paths(ROOM, place, board, all_round(), paths).ranges) for place, paths in near]
        for spot, near in known.items()
    }
    judged = {}
    for scan in scans:
        fit = best_agreement(scan.readings, tables[scan.spot], NEARBY)
        paths = next(paths for place, paths in known[scan.spot] if place == fit.place)
        comparison = compare_readings(
            scan.readings, ROOM, fit.place, board, heading=fit.heading, offset=fit.offset, paths=paths
        )
        sounding = np.array([row.measured is not None for row in comparison.rows])
        judged[scan.name] = Judged(
            sum(row.kind == "match" for row in comparison.rows), sounding, comparison.prediction.over_threshold
        )
    return judged


def held_out(trial: Trial, folds: Mapping[str, Sequence[str]]) -> dict[str, tuple[tuple[int, int], Figures]]:
    """For every fold, scans by name, the candidate tuned on all others, and what it makes of the fold."""
    everyone = [scan.name for scan in trial.scans]
    tuned = {fold: trial.best([name for name in everyone if name not in names]) for fold, names in folds.items()}
    return {fold: (tuned[fold], trial.figures(tuned[fold], names)) for fold, names in folds.items()}


def places(scans: Sequence[RealScan]) -> dict[str, list[str]]:
    """The scans of each place, by name."""
    spots = dict.fromkeys(scan.spot for scan in scans)
    return {spot: [scan.name for scan in scans if scan.spot == spot] for spot in spots}


def recordings(scans: Sequence[RealScan]) -> dict[str, list[str]]:
    """Every scan by itself."""
    return {scan.name: [scan.name] for scan in scans}


def pooled(trial: Trial, folds: Mapping[str, Sequence[str]]) -> Figures:
    """Figures of all scans, each judged by what was tuned without its fold."""
    tuned = held_out(trial, folds)
    return figures_of([trial.judged[(*tuned[fold][0], name)] for fold, names in folds.items() for name in names])


def tell_cross_validation(trial: Trial) -> None:
    """Print what the board explains of places, and of recordings, that it was not tuned on."""
    for title, folds in (("one place", places(trial.scans)), ("one recording", recordings(trial.scans))):
        print(f"\ntuned without {title}, judged there: share within 5 cm, ROC area of silence")
        for fold, ((a, t), found) in held_out(trial, folds).items():
            tuned = f"{APERTURES[a] * 1000:.2f} mm, {THRESHOLDS[t]:.0f} dB"
            print(f"{fold:12} {found.share:.3f} {found.roc_area or math.nan:.3f}   {tuned}")
        everything = pooled(trial, folds)
        print(f"{'all':12} {everything.share:.3f} {everything.roc_area or math.nan:.3f}")


def profile(trial: Trial, fingerprint: str, today: date) -> str:
    """The tuned profile with where it comes from, as TOML."""
    everyone = [scan.name for scan in trial.scans]
    a, t = trial.best(everyone)
    found = trial.figures((a, t), everyone)
    readings = [reading for scan in trial.scans for reading in scan.readings]
    echoes = sum(reading.range is not None for reading in readings)
    rows = (
        ("all scans", found),
        ("each place, tuned without it", pooled(trial, places(trial.scans))),
        ("each recording, tuned without it", pooled(trial, recordings(trial.scans))),
    )
    table = "\n".join(f"# {title:34}{row.share:14.3f}{row.roc_area or math.nan:21.3f}" for title, row in rows)
    return f"""\
# LEGO NXT ultrasonic sensor: 40 kHz, two small transducers, whole centimetres, and a gain that does not rise.
# Aperture and threshold were tuned on {today} by `python -m benchmarks.tune_lego_nxt`, with the receiver named below,
# on {len(trial.scans)} scans of rooms/arena.toml from github.com/sacha-cs/roberto, commit e8e3ae61 (SHA-256 of the
# files {fingerprint}...): {len(readings)} readings, {echoes} echoes. For each scan only heading,
# range offset and a position within 3 cm were found.
# {"":34}{"within 5 cm":>14}{"ROC area of silence":>21}
{table}
name = "lego-nxt"
aperture_radius = {APERTURES[a]:.5f}    # m, tuned
frequency = 40000.0
transmit_cycles = 12
blanking = 0.0003
max_range = 2.5
threshold_db = {THRESHOLDS[t]:.1f}         # tuned: of the weakest echo heard, below a perfect wall 0.5 m straight ahead
fixed_gain = true
rounding = 0.01              # m
receiver = "first-echo"
own_burst_db = -40.0         # its ear is a second transducer; a guess that keeps it from hearing itself
"""


def fingerprint_of(folder: Path) -> str:
    """The first 16 digits of the SHA-256 of all scans of a folder, in order of their names."""
    together = hashlib.sha256()
    for path in sorted(folder.glob("*.csv")):
        together.update(path.read_bytes())
    return together.hexdigest()[:16]


def main() -> None:
    """Tune, write the profile, print the figures."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT_FOLDER
    trial = try_all(load_scans(folder), told=print)
    text = profile(trial, fingerprint_of(folder), date.today())
    PROFILE.write_text(text, encoding="utf-8")
    print(f"\n{PROFILE}:\n{text}")
    tell_cross_validation(trial)


if __name__ == "__main__":
    main()
