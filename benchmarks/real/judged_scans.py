"""Comparison of real scans with the predictions of models."""

import csv
import math
import tempfile
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from sonarhw_cli.app import run
from sonarhw_compare.fit.starting import fit_scan
from sonarhw_compare.match import TOLERANCE, Comparison, Kind, headings_of, match_readings, roc_area
from sonarhw_sim.air import Model
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.prediction import PredictionOptions, predict_with
from sonarhw_sim.room.room import Room, load_room

from sonarhw.log import read_log
from sonarhw.mean_ranges import are_means, likely_pings
from sonarhw.readings import FloatArray, Reading

MODELS = (Model.NEAREST, Model.CONE, Model.RAY_FOLLOWING)
DEFAULT_FOLDER = Path("../shared/real_scans")
ROOM = load_room("rooms/arena.toml")
NEARBY = frozenset({"heading", "offset", "position"})
ON_THE_SPOT = frozenset({"heading", "offset"})
_UNIT, _SILENT = 0.01, 2.55  # m, of ranges in these files, and the one that stands for no echo
# echoes of the robot that carries the sensor have the same turntable angle and range at every place
_OWN_SPREAD = 0.03  # m
_OWN_SHARE = 0.7  # of the scans


def untuned(board: Board) -> Board:
    """Return the board before tuning, with a gain that rises ideally."""
    return replace(board, aperture_radius=0.005, threshold_db=-30.0, fixed_gain=False)


@dataclass(frozen=True)
class RealScan:
    """One recorded scan and its position."""

    name: str
    x: float  # m
    y: float  # m
    readings: tuple[Reading, ...]
    sensor: str = ""  # that recorded it, with its turntable

    @property
    def spot(self) -> str:
        """The place in the form of the command line."""
        return f"{self.x},{self.y}"


@dataclass(frozen=True)
class Judged:
    """The comparison of one model with one scan of n readings."""

    matched: NDArray[np.bool_]  # (n,): readings with an echo within 5 cm of the prediction
    sounding: NDArray[np.bool_]  # (n,): readings with an echo
    predicted: NDArray[np.bool_]  # (n,): readings for which one is predicted
    scores: FloatArray  # (n,), dB: level of the loudest predicted echo over the threshold


@dataclass(frozen=True)
class Figures:
    """The results of a model for several scans together."""

    share: float  # of the echoes, within 5 cm
    roc_area: float  # detection of silent headings by predicted levels, all scans together
    agreement: float  # detection of silent headings by predicted echoes: balanced accuracy


LAYOUT = """\
FOLDER contains scans.csv and one CSV file for each scan.

scans.csv has the header scan,x_m,y_m,turn and a line for each scan:
  scan        name; the readings are in NAME.csv
  x_m, y_m    position of the sensor in rooms/arena.toml, m
  turn        direction in which the turntable angles increase: cw or ccw
  sensor      optional: scans of one sensor on one turntable have the same; default: the name without its number

NAME.csv has the header turret_deg,range_cm and a line for each reading:
  turret_deg  turntable angle, degrees
  range_cm    range, cm; 255: no echo

The nine scans of the documents are not in this repository (docs/explanation/real_scans.md).
"""
_COLUMNS = {"scan", "x_m", "y_m", "turn"}


def program_options(description: str, *, sensors: bool = False, **flags: str) -> Namespace:
    """Return the command-line options of a program on real scans: `folder`, and `flags` with their help.

    With `sensors`, an option selects some of them.
    """
    parser = ArgumentParser(description=description, epilog=LAYOUT, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=DEFAULT_FOLDER, help=f"default: {DEFAULT_FOLDER}")
    if sensors:
        parser.add_argument("--sensors", default="", metavar="A,B,...", help="test these sensors only")
    for name, meaning in flags.items():
        parser.add_argument(f"--{name.replace('_', '-')}", action="store_true", help=meaning)
    return parser.parse_args()


def _check_layout(folder: Path) -> None:
    """End the program with one line if the folder has another layout."""
    listing = folder / "scans.csv"
    if not listing.is_file():
        what = "no such file" if folder.is_dir() else f"no such folder: {folder}"
        raise SystemExit(f"{listing}: {what}; --help describes the layout of the folder")
    with open(listing, encoding="utf-8", newline="") as lines:
        table = csv.DictReader(lines)
        missing = sorted(_COLUMNS.difference(table.fieldnames or ()))
        if missing:
            raise SystemExit(f"{listing}: no column {missing[0]}; --help describes the layout of the folder")
        for row in table:
            if not (folder / f"{row['scan']}.csv").is_file():
                raise SystemExit(f"{folder / row['scan']}.csv: no such file, but scans.csv lists it")


def load_scans(folder: Path) -> list[RealScan]:
    """Return the scans of a folder, converted with `sonarhw import`. Ends the program if the layout is another."""
    _check_layout(folder)
    scans = []
    with open(folder / "scans.csv", encoding="utf-8", newline="") as listing, tempfile.TemporaryDirectory() as scratch:
        for row in csv.DictReader(listing):
            log = Path(scratch) / f"{row['scan']}.mcap"
            source = str(folder / f"{row['scan']}.csv")
            columns = [
                "--heading",
                "turret_deg",
                "--range",
                "range_cm",
                "--scale",
                f"{_UNIT}",
                "--no-echo",
                f"{_SILENT / _UNIT:g}",
            ]
            # without the message about the temporary log
            status = run(["--quiet", "import", source, "--out", str(log), *columns, "--turn", row["turn"]])
            if status != 0:
                raise SystemExit(status)
            # without a column, scans are named after their sensor: A00, A01, ...
            sensor = row.get("sensor") or row["scan"].rstrip("0123456789")
            scans.append(RealScan(row["scan"], float(row["x_m"]), float(row["y_m"]), read_log(log).readings, sensor))
    return scans


def load_sensors(folder: Path) -> dict[str, list[RealScan]]:
    """Return the scans of a folder and of its folders with a scans.csv, by sensor. Ends the program as `load_scans`."""
    inner = sorted(listing.parent for listing in folder.glob("*/scans.csv"))
    outer = [folder] if (folder / "scans.csv").is_file() or not inner else []
    by_sensor: dict[str, list[RealScan]] = {}
    for each in [*outer, *inner]:
        for scan in load_scans(each):
            by_sensor.setdefault(scan.sensor, []).append(scan)
    return {sensor: _without_means(scans) for sensor, scans in by_sensor.items()}


def _without_means(scans: Sequence[RealScan]) -> list[RealScan]:
    """Return scans of one sensor without means of pings with different ranges, as by `sonarhw import --mean-of`."""
    ranges = [
        np.array([_SILENT if reading.range is None else reading.range for reading in scan.readings]) for scan in scans
    ]
    pings = likely_pings(ranges, _UNIT)
    if pings is None:
        return list(scans)
    kept = [~are_means(of_scan, _UNIT, pings) for of_scan in ranges]
    print(f"sensor {scans[0].sensor}: {sum(int((~one).sum()) for one in kept)} means of {pings} pings left out")
    return [
        replace(scan, readings=tuple(compress(scan.readings, of_scan)))
        for scan, of_scan in zip(scans, kept, strict=True)
    ]


def judge(
    scan: RealScan,
    model: Model,
    board: Board,
    free: frozenset[str] = NEARBY,
    room: Room = ROOM,
    options: PredictionOptions | None = None,
) -> Comparison:
    """Compare one scan with one model, with the `free` parameters fitted."""
    fit = fit_scan(scan.readings, room, room.place(scan.spot), board, free, model=model, options=options)
    prediction = predict_with(model, room, fit.place, board, headings_of(scan.readings, fit.place, board), options)
    return match_readings(scan.readings, prediction, fit.offset)


def judged_of(comparison: Comparison) -> Judged:
    """Return the part of a comparison that `figures_of` needs, without readings of the carrier's own body."""
    rows = [row for row in comparison.rows if row.kind is not Kind.OWN_BODY]
    return Judged(
        np.array([row.kind is Kind.MATCH for row in rows]),
        np.array([row.measured is not None for row in rows]),
        np.array([row.predicted is not None for row in rows]),
        comparison.prediction.over_threshold[[row.index for row in rows]],
    )


def figures_of(judged: Sequence[Judged]) -> Figures:
    """Return the figures of several scans together."""
    sounding = np.concatenate([scan.sounding for scan in judged])
    predicted = np.concatenate([scan.predicted for scan in judged])
    return Figures(
        share=sum(int(scan.matched.sum()) for scan in judged) / int(sounding.sum()),
        roc_area=roc_area(np.concatenate([scan.scores for scan in judged]), sounding.tolist()) or math.nan,
        agreement=float(predicted[sounding].mean() + (~predicted[~sounding]).mean()) / 2,
    )


def echoes_of_the_robot(scans: Sequence[RealScan]) -> set[tuple[str, int]]:
    """Return scan and row of the echoes with the same turntable angle and range in most scans, at any place."""
    ranges = np.array([[np.nan if r.range is None else r.range for r in scan.readings] for scan in scans])
    # at the same row, or the one before or after it
    others = np.stack([np.roll(ranges, turn, axis=1) for turn in (-1, 0, 1)])
    near = (np.abs(ranges[:, None] - others[:, None]) <= _OWN_SPREAD).any(axis=0)
    elsewhere = np.array([[scan.spot != other.spot for other in scans] for scan in scans])
    shares = (near & elsewhere[:, :, None]).sum(axis=1) / elsewhere.sum(axis=1)[:, None]
    return {(scans[k].name, int(row)) for k, row in np.argwhere(shares >= _OWN_SHARE)}


def repeated(scans: Sequence[RealScan]) -> tuple[float, float]:
    """Return the agreement of earlier with later recordings at the same place, and of later with earlier ones.

    Each is a share of echoes within 5 cm, with each pair turned, and its ranges shifted by up to 6 cm, for best
    agreement.
    """
    pairs = [(a, b) for k, a in enumerate(scans) for b in scans[k + 1 :] if a.spot == b.spot]
    forward, back = ([_agreement(*pair) for pair in some] for some in (pairs, [(b, a) for a, b in pairs]))
    return _pooled(forward), _pooled(back)


def _agreement(one: RealScan, other: RealScan) -> tuple[int, int]:
    """Return how many echoes of one scan another contains, and their number."""
    here, there = _ranges(one), _ranges(other)
    turned = np.stack([np.roll(there, k) for k in range(len(there))])
    offsets = np.arange(-0.06, 0.061, 0.005)
    near = np.abs(here - turned[:, None] - offsets[:, None]) <= TOLERANCE
    return int(near.sum(axis=2).max()), int(np.isfinite(here).sum())


def _ranges(scan: RealScan) -> FloatArray:
    return np.array([math.nan if reading.range is None else reading.range for reading in scan.readings])


def _pooled(counts: Sequence[tuple[int, int]]) -> float:
    agreeing, echoes = np.sum(counts, axis=0)
    return float(agreeing / echoes)


def as_row(figures: Figures) -> str:
    """Return figures as a row of a table."""
    return f"{figures.share:.3f} {figures.roc_area:.3f} {figures.agreement:.3f}"
