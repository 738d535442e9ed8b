"""Tune the profile `lego-nxt` on real scans: `python -m benchmarks.real.tune_lego_nxt [FOLDER]`.

Tries apertures and thresholds on a grid, writes the best into sim/sonarhw_sim/board/shipped/lego-nxt.toml with its
origin, and prints its results, also for places and recordings that were not used for tuning.

Two numbers are tuned; the rest of the profile is known from the sensor. For each scan, only heading, range offset and a
position within 3 cm are fitted. Of all candidates whose share of echoes within 5 cm is within half a standard error of
the best, the one with the best balanced accuracy for silent headings is used. Results of a thousand readings are
noisy, so those of a candidate are averaged with its neighbours on the grid.
"""

import csv
import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path

import numpy as np
from scipy.ndimage import uniform_filter
from sonarhw_compare.fit.starting import all_round, best_agreement, places_near
from sonarhw_compare.match import headings_of, match_readings
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.prediction import PredictionOptions, paths_for, weigh_paths
from sonarhw_sim.rays.paths import Paths
from sonarhw_sim.room.room import Place

from benchmarks.real.judged_scans import (
    NEARBY,
    ROOM,
    Figures,
    Judged,
    RealScan,
    as_row,
    figures_of,
    judged_of,
    load_scans,
    program_options,
)
from sonarhw.readings import FloatArray

APERTURES = np.arange(3.0, 4.76, 0.25) / 1000  # m
THRESHOLDS = np.arange(-22.0, -13.9, 0.5)  # dB
SPREADS = {"threshold_sd_db": 3.8, "range_sd": 0.016}  # of six sensors, printed by benchmarks.real.real_scans
PROFILE = Path("sim/sonarhw_sim/board/shipped/lego-nxt.toml")

Known = Mapping[str, Sequence[tuple[Place, Paths]]]  # by spot: the places near it, and their paths


@dataclass(frozen=True)
class Trial:
    """All candidates on all scans."""

    scans: Sequence[RealScan]
    judged: dict[tuple[int, int, str], Judged]  # by row of APERTURES, row of THRESHOLDS, and name of the scan

    def figures(self, candidate: tuple[int, int], names: Sequence[str]) -> Figures:
        """Return the figures of a candidate for some scans."""
        return figures_of([self.judged[(*candidate, name)] for name in names])

    def best(self, names: Sequence[str]) -> tuple[int, int]:
        """Return the candidate that detects silence best, within half a standard error of the best share."""
        grid = range(len(APERTURES)), range(len(THRESHOLDS))
        figures = [[self.figures((a, t), names) for t in grid[1]] for a in grid[0]]
        shares = _smoothed([[found.share for found in row] for row in figures])
        agreements = _smoothed([[found.agreement for found in row] for row in figures])
        echoes = sum(int(self.judged[0, 0, name].sounding.sum()) for name in names)
        enough = shares.max() - 0.5 * math.sqrt(shares.max() * (1 - shares.max()) / echoes)
        a, t = np.unravel_index(np.where(shares >= enough, agreements, 0.0).argmax(), shares.shape)
        return int(a), int(t)


def _smoothed(figures: list[list[float]]) -> FloatArray:
    return np.asarray(uniform_filter(np.array(figures), 3, mode="nearest"))


def try_all(scans: Sequence[RealScan], progress: Callable[[str], None] = lambda _: None) -> Trial:
    """Try every candidate on every scan; paths are found once, and only their weights change."""
    base = load_board("lego-nxt")
    known = known_paths(scans, replace(base, threshold_db=float(THRESHOLDS.min())))
    judged = {}
    for a, aperture in enumerate(APERTURES.tolist()):
        for t, threshold in enumerate(THRESHOLDS.tolist()):
            board = replace(base, aperture_radius=aperture, threshold_db=threshold)
            for name, found in judge_all(scans, board, known).items():
                judged[a, t, name] = found
        progress(f"aperture radius {aperture * 1000:.2f} mm done")
    return Trial(scans, judged)


def known_paths(scans: Sequence[RealScan], board: Board) -> Known:
    """Return the paths that `board` could detect at every position near the places of the scans."""
    spots = dict.fromkeys(scan.spot for scan in scans)
    options = PredictionOptions()
    return {
        spot: [(near, paths_for(ROOM, near, board, options)) for near in places_near(ROOM.place(spot))]
        for spot in spots
    }


def judge_all(scans: Sequence[RealScan], board: Board, known: Known) -> dict[str, Judged]:
    """Compare one board with every scan, with heading, offset and position fitted for each; by name of the scan."""
    tables = {
        spot: [(place, weigh_paths(ROOM, place, board, all_round(), paths).ranges) for place, paths in near]
        for spot, near in known.items()
    }
    judged = {}
    for scan in scans:
        fit = best_agreement(scan.readings, tables[scan.spot], NEARBY, board)
        paths = next(paths for place, paths in known[scan.spot] if place.position == fit.place.position)
        prediction = weigh_paths(ROOM, fit.place, board, headings_of(scan.readings, fit.place, board), paths)
        judged[scan.name] = judged_of(match_readings(scan.readings, prediction, fit.offset))
    return judged


def held_out(trial: Trial, folds: Mapping[str, Sequence[str]]) -> dict[str, tuple[tuple[int, int], Figures]]:
    """Return, for every fold (scans by name), the candidate tuned on all others and its figures for the fold."""
    all_names = [scan.name for scan in trial.scans]
    tuned = {fold: trial.best([name for name in all_names if name not in names]) for fold, names in folds.items()}
    return {fold: (tuned[fold], trial.figures(tuned[fold], names)) for fold, names in folds.items()}


def places(scans: Sequence[RealScan]) -> dict[str, list[str]]:
    """Return the scans of each place, by name."""
    spots = dict.fromkeys(scan.spot for scan in scans)
    return {spot: [scan.name for scan in scans if scan.spot == spot] for spot in spots}


def recordings(scans: Sequence[RealScan]) -> dict[str, list[str]]:
    """Return every scan as its own fold."""
    return {scan.name: [scan.name] for scan in scans}


def pooled(trial: Trial, folds: Mapping[str, Sequence[str]]) -> Figures:
    """Return the figures of all scans, each with the candidate tuned without its fold."""
    tuned = held_out(trial, folds)
    return figures_of([trial.judged[(*tuned[fold][0], name)] for fold, names in folds.items() for name in names])


def print_candidates(trial: Trial) -> None:
    """Print the share of every candidate, and the detection of silence with the best aperture."""
    all_names = [scan.name for scan in trial.scans]
    rows = [[trial.figures((a, t), all_names) for t in range(len(THRESHOLDS))] for a in range(len(APERTURES))]
    print("\nshare within 5 cm of every candidate: thresholds across, dB, apertures down, mm")
    print(f"{'':9}" + "".join(f"{threshold:7.1f}" for threshold in THRESHOLDS))
    for aperture, row in zip(APERTURES, rows, strict=True):
        print(f"{aperture * 1000:9.2f}" + "".join(f"{found.share:7.3f}" for found in row))
    print("balanced " + "".join(f"{found.agreement:7.3f}" for found in rows[trial.best(all_names)[0]]))


def print_cross_validation(trial: Trial) -> None:
    """Print the figures of the board for places, and for recordings, that were not used for tuning."""
    for title, folds in (("one place", places(trial.scans)), ("one recording", recordings(trial.scans))):
        print(f"\ntuned without {title}, tested there: share within 5 cm, ROC area and balanced accuracy of silence")
        for fold, ((a, t), found) in held_out(trial, folds).items():
            tuned = f"{APERTURES[a] * 1000:.2f} mm, {THRESHOLDS[t]:.1f} dB"
            print(f"{fold:12} {as_row(found)}   {tuned}")
        print(f"{'all':12} {as_row(pooled(trial, folds))}")


def profile(trial: Trial, fingerprint: str, today: date) -> str:
    """Return the tuned profile with its origin, as TOML."""
    all_names = [scan.name for scan in trial.scans]
    a, t = trial.best(all_names)
    found = trial.figures((a, t), all_names)
    readings = [reading for scan in trial.scans for reading in scan.readings]
    echoes = sum(reading.range is not None for reading in readings)
    rows = (
        ("all scans", found),
        ("each place, tuned without it", pooled(trial, places(trial.scans))),
        ("each recording, tuned without it", pooled(trial, recordings(trial.scans))),
    )
    table = "\n".join(f"# {title:34}{row.share:12.3f}{row.roc_area:22.3f}{row.agreement:20.3f}" for title, row in rows)
    return f"""\
# LEGO NXT ultrasonic sensor: 40 kHz, two small transducers, whole centimetres, and a gain that does not rise.
# Aperture and threshold were tuned on {today} by `python -m benchmarks.real.tune_lego_nxt`, with the receiver named
# below, on {len(trial.scans)} scans of rooms/arena.toml from github.com/sacha-cs/roberto, commit e8e3ae61
# ({len(readings)} readings, {echoes} echoes; SHA-256 of the files begins {fingerprint}).
# For each scan, only heading, range offset and a position within 3 cm were fitted.
# {"":34}{"within 5 cm":>12}{"silence: ROC area":>22}{"balanced accuracy":>20}
{table}
# The profile describes a population. Its spreads are those of readings of six sensors, between and within sensors, from
# calibrations that began without spreads. At 95 % confidence, one of the six differs from this profile in its threshold
# (M: -14.5 dB), and none in its aperture. Profiles of single sensors: examples/lego_nxt_*.toml.
name = "lego-nxt"
aperture_radius = {APERTURES[a]:.5f}    # m, tuned
frequency = 40000.0
transmit_cycles = 12
blanking = 0.0003
max_range = 2.5
threshold_db = {THRESHOLDS[t]:.1f}  # tuned: weakest detected echo, relative to a perfect wall 0.5 m straight ahead
threshold_sd_db = {SPREADS["threshold_sd_db"]}        # of readings of six sensors, between and within them
range_sd = {SPREADS["range_sd"]}             # m, likewise; with what the room file does not describe
fixed_gain = true
rounding = 0.01              # m
receiver = "first-echo"
sum_arrivals = false         # two transducers, centimetres apart: a path and its reverse differ in length
own_burst_db = -40.0         # a second transducer receives; an assumption, low enough not to detect its own burst
"""


def fingerprint_of(folder: Path) -> str:
    """Return the first 16 digits of the SHA-256 of scans.csv and of the scans that it lists, in order of names."""
    together = hashlib.sha256()
    listed = folder / "scans.csv"
    scans = [folder / f"{row['scan']}.csv" for row in csv.DictReader(listed.read_text().splitlines())]
    for path in sorted([listed, *scans]):
        together.update(path.read_bytes())
    return together.hexdigest()[:16]


def main() -> None:
    """Tune, write the profile, print the figures."""
    folder = program_options("Tune the board profile lego-nxt on real scans, and write it.").folder
    trial = try_all(load_scans(folder), progress=print)
    text = profile(trial, fingerprint_of(folder), date.today())
    PROFILE.write_text(text, encoding="utf-8")
    print(f"\n{PROFILE}:\n{text}")
    print_cross_validation(trial)


if __name__ == "__main__":
    main()
