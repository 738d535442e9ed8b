"""Sensors calibrated on their other places, and on other sensors, tested on real scans.

For each place of a sensor, the profile is calibrated with the sensor's scans of all other places, as by
`sonarhw calibrate --room --room-out`, and the scans of this place are compared, in the room with the reflectances that
the other places gave. Nothing of the compared scan is used but its heading, range offset, and, if `free`, its position
within 3 cm, which are fitted for every profile in the same way.
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
from sonarhw_compare.calibration.room import calibrate_in_room
from sonarhw_compare.drawings import laid_out, new_figure
from sonarhw_compare.edits import Z95
from sonarhw_compare.fit.quantities import REFLECTANCE
from sonarhw_compare.fit.result import PlacedScan
from sonarhw_compare.match import drawn_blocks
from sonarhw_compare.picture_file import write_picture
from sonarhw_compare.pictures import MEASURED, PREDICTED
from sonarhw_compare.score import CalibrationBin, calibration_text, score_comparison
from sonarhw_sim.air import Model
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.room.room import Place, Room

from benchmarks.real.judged_scans import NEARBY, ON_THE_SPOT, ROOM, Judged, RealScan, figures_of, judge, judged_of
from sonarhw.files import atomic_file
from sonarhw.readings import FloatArray

KEPT = Path("build/real_scans")
SOURCES = (Path("sim"), Path("compare"), Path("benchmarks/real"))
GENERIC = "lego-nxt"
WALLS = "board"  # material of all walls of the arena
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
class Calibrated:
    """A profile, and the reflectance of the room to which it belongs."""

    board: Board
    reflectance: float
    deviation: float  # standard deviation of the reflectance

    @property
    def room(self) -> Room:
        """The arena with this reflectance."""
        return REFLECTANCE.put(ROOM, {WALLS: self.reflectance})


@dataclass(frozen=True)
class HeldOut:
    """What one place of a sensor gives with each profile."""

    sensor: str
    spot: str
    profile: Calibrated  # on the other places
    tested: Mapping[str, tuple[Tested, ...]]  # by title


@dataclass(frozen=True)
class Job:
    """One place of a sensor, to be left out."""

    scans: tuple[RealScan, ...]  # of the sensor
    spot: str
    others: Calibrated  # the mean of all other sensors


def calibrated(scans: Sequence[RealScan]) -> Calibrated:
    """Return the generic profile calibrated on scans, together with the reflectance of the arena."""
    placed = [PlacedScan(scan.readings, Place(scan.name, (scan.x, scan.y)), scan.name, scan.name) for scan in scans]
    found = calibrate_in_room(load_board(GENERIC), placed, ROOM, reflectances=True)
    (walls,) = found.reflectances
    return Calibrated(found.board, REFLECTANCE.value(found.room, WALLS), (walls.value - walls.low) / Z95)


def population(sensors: Sequence[Calibrated]) -> Calibrated:
    """Return the generic profile with the mean detection of several sensors, and their spread in its threshold."""
    boards = [one.board for one in sensors]
    thresholds = [board.threshold_db for board in boards]
    within = [board.threshold_sd_db for board in boards]
    mean = replace(
        load_board(GENERIC),
        threshold_db=float(np.mean(thresholds)),
        aperture_radius=float(np.exp(np.mean(np.log([board.aperture_radius for board in boards])))),
        threshold_sd_db=float(np.hypot(np.std(thresholds, ddof=1), np.sqrt(np.mean(np.square(within))))),
        range_sd=float(np.sqrt(np.mean([board.range_sd**2 for board in boards]))),
    )
    reflectances = [sensor.reflectance for sensor in sensors]
    return Calibrated(mean, float(np.mean(reflectances)), float(np.std(reflectances, ddof=1)))


def tested_place(job: Job) -> HeldOut:
    """Calibrate without a place, and compare its scans."""
    own = calibrated([scan for scan in job.scans if scan.spot != job.spot])
    generic, body = load_board(GENERIC), own.board.own_body
    profiles = {
        "generic, place as written": (generic, ROOM),
        "generic": (generic, ROOM),
        "generic, own body left out": (replace(generic, own_body=body), ROOM),
        "calibrated, place as written": (own.board, own.room),
        "calibrated": (own.board, own.room),
        "calibrated on other sensors": (replace(job.others.board, own_body=body), job.others.room),
    }
    held = [scan for scan in job.scans if scan.spot == job.spot]
    tested = {
        title: tuple(_tested(scan, *profile, NEARBY if VARIANTS[title] else ON_THE_SPOT) for scan in held)
        for title, profile in profiles.items()
    }
    return HeldOut(job.scans[0].sensor, job.spot, own, tested)


def _tested(scan: RealScan, board: Board, room: Room, free: frozenset[str]) -> Tested:
    comparison = judge(scan, Model.RAY_FOLLOWING, board, free, room)
    score = score_comparison(comparison)
    return Tested(judged_of(comparison), score.log_score or 0.0, score.calibration)


def kept(name: str, scans: Sequence[RealScan], compute: Callable[[], Result], more: str = "") -> Result:
    """Return a result of scans, from the folder of results if it was computed by the same code, or computed now."""
    read = [(scan.name, scan.spot, [(reading.angle, reading.range) for reading in scan.readings]) for scan in scans]
    key = hashlib.sha256(repr((read, more, _code())).encode()).hexdigest()[:16]
    file = KEPT / f"{name}-{key}.pickle"
    if file.is_file():
        result: Result = pickle.loads(file.read_bytes())
        return result
    found = compute()
    file.parent.mkdir(parents=True, exist_ok=True)
    # another run may have written it meanwhile
    with atomic_file(file, overwrite=True) as out:
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
) -> tuple[list[HeldOut], dict[str, Calibrated]]:
    """Return the results of all places of the sensors `tested`, and what all scans of each sensor give."""
    whole = {}
    for name, scans in sensors.items():
        whole[name] = kept(f"{name}-whole", scans, partial(calibrated, scans))
        print(f"sensor {name} calibrated", flush=True)
    found = []
    for sensor in tested:
        others = population([one for name, one in whole.items() if name != sensor])
        for spot in dict.fromkeys(scan.spot for scan in sensors[sensor]):
            job = Job(tuple(sensors[sensor]), spot, others)
            name = f"{sensor}-{spot}"
            found.append(kept(name, job.scans, partial(tested_place, job), repr(others)))
            print(f"sensor {sensor} tested at {spot}", flush=True)
    return found, whole


def gained(found: Sequence[HeldOut], sensor: str, since: str, now: str) -> tuple[FloatArray, FloatArray]:
    """Return the changes of the two shares of a sensor between two profiles, (2,), and their standard errors, (2,).

    Both profiles are tested with the same readings, so a bootstrap draws blocks of them for both together.
    """
    return _with_errors(_drawn_shares(found, sensor, now) - _drawn_shares(found, sensor, since))


def _with_errors(drawn: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return values, (k,), and their standard errors, (k,), from the values and those of the bootstrap, (k, 1 + w)."""
    return drawn[:, 0], np.nanstd(drawn[:, 1:], axis=1)  # a draw may have no silence


def _drawn_shares(found: Sequence[HeldOut], sensor: str, title: str) -> FloatArray:
    """Return share of echoes and balanced accuracy of silence of a sensor with one profile, (2, 1 + w).

    The first column is that of the readings, the others are those of a bootstrap over blocks of neighbours. Equal
    numbers of readings give equal blocks.
    """
    judged = [one.judged for one in of_title(found, title, sensor)]
    matched, sounding, predicted = (
        np.concatenate([getattr(one, name) for one in judged]) for name in ("matched", "sounding", "predicted")
    )
    draws = drawn_blocks(len(sounding), BLOCK, np.random.default_rng(0))
    weights = np.concatenate((np.ones((1, len(sounding))), draws))
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
    print_errors(found, tested)
    print_changes(found, tested)
    print("\nfrom the other places: threshold dB, reflectance of the walls")
    for held in found:
        print(f"  {held.sensor} {held.spot:10}{held.profile.board.threshold_db:7.1f}{_reflectance(held.profile)}")
    print_profiles(whole)
    if picture is not None:
        with picture.open("wb") as file:
            write_picture(draw_sensors(found, tested), file, picture.suffix)


def print_errors(found: Sequence[HeldOut], tested: Sequence[str]) -> None:
    """Print the shares of the calibrated profiles with their standard errors, and the numbers of readings."""
    print("\ncalibrated: share within 5 cm; balanced accuracy of silence; ± standard error; echoes, silences")
    rows = []
    for sensor in tested:
        sounding = np.concatenate([one.judged.sounding for one in of_title(found, "calibrated", sensor)])
        rows.append(_with_errors(_drawn_shares(found, sensor, "calibrated")))
        print(f"  {sensor:8}{_with_error(*rows[-1])}{sounding.sum():9d}{(~sounding).sum():5d}")
    shares, errors = np.swapaxes(rows, 0, 1)
    print(f"  mean    {_with_error(shares.mean(axis=0), np.sqrt((errors**2).sum(axis=0)) / len(rows))}")


def _with_error(shares: FloatArray, errors: FloatArray) -> str:
    return "".join(f"{share:9.3f} ± {error:.3f}" for share, error in zip(shares.tolist(), errors.tolist(), strict=True))


def print_changes(found: Sequence[HeldOut], tested: Sequence[str]) -> None:
    """Print what calibration changes for each sensor, and which sensors are worse than with the generic profile."""
    print(
        "\nchange by calibration, own body left out: share within 5 cm; balanced accuracy of silence; ± standard error"
    )
    worse = []
    for sensor in tested:
        changes, errors = gained(found, sensor, "generic, own body left out", "calibrated")
        pairs = list(zip(("echoes", "silence"), changes.tolist(), errors.tolist(), strict=True))
        print(f"  {sensor:8}" + "".join(f"{change:+9.3f} ± {error:.3f}" for _, change, error in pairs))
        worse += [
            f"{sensor}, {of}: {change:+.3f}, {-change / error:.1f} standard errors"
            for of, change, error in pairs
            if change < 0
        ]
    print("worse than with the generic profile: " + ("; ".join(worse) or "none"))


def print_profiles(whole: Mapping[str, Calibrated]) -> None:
    """Print what all scans of each sensor give, and whether the reflectances agree: they are those of one arena."""
    print("\nfrom all scans of a sensor: threshold dB, aperture mm, offset mm, slope, scale, reflectance, own body")
    for sensor, one in whole.items():
        board = one.board
        print(
            f"  {sensor:8}{board.threshold_db:7.1f} ± {board.threshold_sd_db:.1f}{board.aperture_radius * 1000:7.2f}"
            f"{board.range_offset * 1000:7.1f}{board.clock_error:8.4f}{board.turntable_scale:7.3f}{_reflectance(one)}  "
            + ", ".join(f"{one.from_deg:.0f}° to {one.to_deg:.0f}°, {one.middle:.2f} m" for one in board.own_body)
        )
    mean = population(list(whole.values()))
    print(
        f"  all     {mean.board.threshold_db:7.1f} ± {mean.board.threshold_sd_db:.1f}"
        f"{mean.board.aperture_radius * 1000:7.2f}   range_sd {mean.board.range_sd * 1000:.1f} mm"
    )
    values, errors = (np.array([getattr(one, name) for one in whole.values()]) for name in ("reflectance", "deviation"))
    weighted = float(np.average(values, weights=errors**-2))
    misfit = float((((values - weighted) / errors) ** 2).sum())
    print(
        f"reflectance of the walls: weighted mean {weighted:.3f} ± {(errors**-2).sum() ** -0.5:.3f}, "
        f"plain {values.mean():.3f}, standard deviation between sensors {values.std(ddof=1):.3f}; "
        f"chi-square {misfit:.1f} with {len(values) - 1} degrees of freedom"
    )


def _reflectance(one: Calibrated) -> str:
    return f"{one.reflectance:7.3f} ± {one.deviation:.3f}"


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
