"""Sensors calibrated on their other places, and on other sensors, tested on real scans.

For each place of a sensor, the profile is calibrated with the sensor's scans of all other places, as by
`sonarhw calibrate --room`, and the scans of this place are compared. Nothing of the compared scan is used but its
heading, range offset, and, if `free`, its position within 3 cm, which are fitted for every profile in the same way.
"""

import hashlib
import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from sonarhw_compare.fit.values.fit_result import PlacedScan
from sonarhw_compare.known_room.room_calibration import calibrate_in_room
from sonarhw_compare.matching.block_bootstrap import drawn_blocks
from sonarhw_compare.matching.probability_score import CalibrationBin, calibration_text, score_comparison
from sonarhw_compare.pictures.colours import MEASURED, PREDICTED
from sonarhw_compare.pictures.picture_file import write_picture
from sonarhw_compare.pictures.shown_figure import laid_out, new_figure
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.choices import Model
from sonarhw_sim.room.model import Place

from benchmarks.real.judged_scans import NEARBY, ON_THE_SPOT, ROOM, Judged, RealScan, figures_of, judge, judged_of
from sonarhw.atomic_file import atomic_file
from sonarhw.readings import FloatArray

KEPT = Path("build/real_scans")
SOURCES = (Path("sim"), Path("compare"), Path("benchmarks/real"))
GENERIC = "lego-nxt"
BLOCK = 8.0  # neighbouring readings with errors that are alike
Result = TypeVar("Result")
# title of each row of the table, and whether the position is free
VARIANTS = {
    "generic, place as written": False,
    "generic": True,
    "generic, own body left out": True,
    "calibrated, place as written": False,
    "calibrated": True,
    "calibrated on other sensors": True,
}


@dataclass(frozen=True)
class Tested:
    """One scan compared with one profile."""

    judged: Judged
    log_score: float  # mean of its readings
    bins: tuple[CalibrationBin, ...]  # stated and observed probabilities


@dataclass(frozen=True)
class HeldOut:
    """What one place of a sensor gives with each profile."""

    sensor: str
    spot: str
    profile: Board  # calibrated on the other places
    tested: Mapping[str, tuple[Tested, ...]]  # by title


@dataclass(frozen=True)
class Job:
    """One place of a sensor, to be left out."""

    scans: tuple[RealScan, ...]  # of the sensor
    spot: str
    others: Board  # the profile from all other sensors


def calibrated(scans: Sequence[RealScan]) -> Board:
    """Return the generic profile calibrated on scans."""
    placed = [PlacedScan(scan.readings, Place(scan.name, (scan.x, scan.y)), scan.name, scan.name) for scan in scans]
    return calibrate_in_room(load_board(GENERIC), placed, ROOM).board


def population(boards: Sequence[Board]) -> Board:
    """Return the generic profile with the mean detection of several sensors, and their spread in its threshold."""
    thresholds = [board.threshold_db for board in boards]
    within = [board.threshold_sd_db for board in boards]
    return replace(
        load_board(GENERIC),
        threshold_db=float(np.mean(thresholds)),
        aperture_radius=float(np.exp(np.mean(np.log([board.aperture_radius for board in boards])))),
        threshold_sd_db=float(np.hypot(np.std(thresholds, ddof=1), np.sqrt(np.mean(np.square(within))))),
        range_sd=float(np.sqrt(np.mean([board.range_sd**2 for board in boards]))),
    )


def tested_place(job: Job) -> HeldOut:
    """Calibrate without a place, and compare its scans."""
    board = calibrated([scan for scan in job.scans if scan.spot != job.spot])
    generic = load_board(GENERIC)
    profiles = {
        "generic, place as written": generic,
        "generic": generic,
        "generic, own body left out": replace(generic, own_body=board.own_body),
        "calibrated, place as written": board,
        "calibrated": board,
        "calibrated on other sensors": replace(job.others, own_body=board.own_body),
    }
    held = [scan for scan in job.scans if scan.spot == job.spot]
    tested = {
        title: tuple(_tested(scan, profile, NEARBY if VARIANTS[title] else ON_THE_SPOT) for scan in held)
        for title, profile in profiles.items()
    }
    return HeldOut(job.scans[0].sensor, job.spot, board, tested)


def _tested(scan: RealScan, board: Board, free: frozenset[str]) -> Tested:
    comparison = judge(scan, Model.RAY_FOLLOWING, board, free)
    score = score_comparison(comparison)
    return Tested(judged_of(comparison), score.log_score or 0.0, score.calibration)


def kept(name: str, scans: Sequence[RealScan], compute: Callable[[], Result], more: str = "") -> Result:
    """Return a result of scans, from the folder of results if it was computed by the same code, or computed now."""
    read = [(scan.name, scan.spot, [(one.angle, one.range) for one in scan.readings]) for scan in scans]
    key = hashlib.sha256(repr((read, more, _code())).encode()).hexdigest()[:16]
    file = KEPT / f"{name}-{key}.pickle"
    if file.is_file():
        result: Result = pickle.loads(file.read_bytes())
        return result
    found = compute()
    file.parent.mkdir(parents=True, exist_ok=True)
    with atomic_file(file) as out:
        pickle.dump(found, out)
    return found


@cache
def _code() -> str:
    """Return a checksum of the code of the predictions."""
    together = hashlib.sha256()
    for source in sorted(path for folder in SOURCES for path in folder.rglob("*") if path.suffix in {".py", ".toml"}):
        together.update(source.read_bytes())
    return together.hexdigest()


def held_out_places(
    sensors: Mapping[str, Sequence[RealScan]], tested: Sequence[str]
) -> tuple[list[HeldOut], dict[str, Board]]:
    """Return the results of all places of the sensors `tested`, and the profile of each sensor from all its scans."""
    whole = {}
    for name, scans in sensors.items():
        whole[name] = kept(f"{name}-whole", scans, partial(calibrated, scans))
        print(f"sensor {name} calibrated", flush=True)
    found = []
    for sensor in tested:
        others = population([board for name, board in whole.items() if name != sensor])
        for spot in dict.fromkeys(scan.spot for scan in sensors[sensor]):
            job = Job(tuple(sensors[sensor]), spot, others)
            name = f"{sensor}-{spot}"
            found.append(kept(name, job.scans, partial(tested_place, job), repr(others)))
            print(f"sensor {sensor} tested at {spot}", flush=True)
    return found, whole


def gained(found: Sequence[HeldOut], sensor: str, since: str, now: str) -> str:
    """Return the changes of the two shares of a sensor between two profiles, with standard errors, in words.

    Both profiles are tested with the same readings, so a bootstrap draws blocks of them for both together.
    """
    before, after = ([one.judged for one in of_title(found, title, sensor)] for title in (since, now))
    sounding = np.concatenate([one.sounding for one in before])
    draws = drawn_blocks(len(sounding), BLOCK, np.random.default_rng(0))
    changes = [_shares(after, sounding, rows) - _shares(before, sounding, rows) for rows in (np.ones((1, 1)), draws)]
    errors = np.nanstd(changes[1], axis=1)  # a draw may have no silence
    return "".join(f"{change:+9.3f} ± {error:.3f}" for change, error in zip(changes[0][:, 0], errors, strict=True))


def _shares(judged: Sequence[Judged], sounding: NDArray[np.bool_], weights: FloatArray) -> FloatArray:
    """Return share of echoes and balanced accuracy of silence, (2, w), with each row of `weights` (w, n)."""
    matched, predicted = (np.concatenate([getattr(one, name) for one in judged]) for name in ("matched", "predicted"))
    echoes, silent = weights * sounding, weights * ~sounding
    heard = (echoes * predicted).sum(axis=1) / echoes.sum(axis=1)
    quiet = (silent * ~predicted).sum(axis=1) / silent.sum(axis=1)
    return np.array([(echoes * matched).sum(axis=1) / echoes.sum(axis=1), (heard + quiet) / 2])


def print_sensors(
    sensors: Mapping[str, Sequence[RealScan]], tested: Sequence[str], picture: Path | None = None
) -> None:
    """Print the figures of the sensors `tested` with each profile, their means, and all profiles; draw the figures."""
    found, whole = held_out_places(sensors, tested)
    print("\nshare within 5 cm; ROC area and balanced accuracy of silence; log score")
    for title in VARIANTS:
        print(f"\n{title}")
        rows = []
        for sensor in tested:
            rows.append(_row(of_title(found, title, sensor)))
            print(f"  {sensor:8}" + _shown(rows[-1]))
        print("  mean    " + _shown(np.nanmean(rows, axis=0)))
        print("  pooled  " + _shown(_row(of_title(found, title, None))))
        print("  stated and observed: " + calibration_text(reliability(of_title(found, title, None))))
    print(
        "\nchange by calibration, own body left out: share within 5 cm; balanced accuracy of silence; ± standard error"
    )
    for sensor in tested:
        print(f"  {sensor:8}" + gained(found, sensor, "generic, own body left out", "calibrated"))
    print("\nprofiles from all scans of a sensor: threshold dB, aperture mm, offset mm, slope, scale, own body")
    for sensor, board in whole.items():
        print(
            f"  {sensor:8}{board.threshold_db:7.1f} ± {board.threshold_sd_db:.1f}{board.aperture_radius * 1000:7.2f}"
            f"{board.range_offset * 1000:7.1f}{board.clock_error:8.4f}{board.turntable_scale:7.3f}  "
            + ", ".join(f"{one.from_deg:.0f}° to {one.to_deg:.0f}°, {one.middle:.2f} m" for one in board.own_body)
        )
    if picture is not None:
        with picture.open("wb") as file:
            write_picture(draw_sensors(found, tested), file, picture.suffix)
    mean = population(list(whole.values()))
    print(
        f"  all     {mean.threshold_db:7.1f} ± {mean.threshold_sd_db:.1f}{mean.aperture_radius * 1000:7.2f}"
        f"   range_sd {mean.range_sd * 1000:.1f} mm"
    )


def reliability(tested: Sequence[Tested]) -> list[CalibrationBin]:
    """Return stated and observed probabilities of several scans together, in tenths of the stated one."""
    pooled: dict[int, list[CalibrationBin]] = {}
    for one in (found for scan in tested for found in scan.bins):
        pooled.setdefault(min(int(one.stated * 10), 9), []).append(one)
    bins = []
    for _, several in sorted(pooled.items()):
        counts = [one.n for one in several]
        stated, observed = (
            float(np.average([getattr(one, name) for one in several], weights=counts))
            for name in ("stated", "observed")
        )
        bins.append(CalibrationBin(sum(counts), stated, observed))
    return bins


def draw_sensors(found: Sequence[HeldOut], sensors: Sequence[str]) -> Figure:
    """Return a figure: shares and silence of each sensor, and stated against observed probabilities."""
    figure = new_figure(12, 4.4, 120)
    shares, silence, curve = figure.subplots(1, 3)
    names = [*sensors, "mean"]
    at = np.arange(len(names))
    for shift, title, colour in ((-0.2, "generic, own body left out", PREDICTED), (0.2, "calibrated", MEASURED)):
        rows = [_row(of_title(found, title, sensor)) for sensor in sensors]
        rows.append(tuple(np.nanmean(rows, axis=0).tolist()))
        shares.bar(at + shift, [row[0] for row in rows], 0.4, color=colour, label=title)
        silence.bar(at + shift, [row[2] for row in rows], 0.4, color=colour, label=title)
        bins = reliability(of_title(found, title, None))
        curve.plot([one.stated for one in bins], [one.observed for one in bins], "o-", color=colour, label=title)
    for axes, title, low in ((shares, "echoes within 5 cm", 0.6), (silence, "balanced accuracy of silence", 0.4)):
        axes.set(title=title, ylim=(low, 1.0), xticks=at, xticklabels=names)
        axes.grid(axis="y", alpha=0.25)
    curve.plot([0, 1], [0, 1], ":", color="black")
    curve.set(title="most probable reading", xlabel="stated probability", ylabel="share that was measured")
    curve.grid(alpha=0.25)
    handles, labels = shares.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=2, frameon=False)
    return laid_out(figure)


def of_title(found: Sequence[HeldOut], title: str, sensor: str | None) -> list[Tested]:
    """Return the scans of one sensor (None: of all) compared with one profile."""
    return [one for held in found if sensor in (None, held.sensor) for one in held.tested[title]]


def _row(tested: Sequence[Tested]) -> tuple[float, float, float, float]:
    figures = figures_of([one.judged for one in tested])
    readings = [len(one.judged.sounding) for one in tested]
    score = float(np.average([one.log_score for one in tested], weights=readings))
    return figures.share, figures.roc_area, figures.agreement, score


def _shown(row: Sequence[float]) -> str:
    return f"{row[0]:8.3f}{row[1]:8.3f}{row[2]:8.3f}{row[3]:8.2f}"
