"""How much of real scans each model explains: `python -m benchmarks.real.real_scans [FOLDER]`.

Takes the folder of real scans (scans.csv and a CSV a scan); imports each as a user would, lets heading, range offset
and a position within 3 cm be found for every model alike, and prints the share of echoes within 5 cm of the prediction
and the ROC area of silence, and how much two recordings of one place agree. `--cross-validation` besides tunes the
board without a place or a recording and judges it there, and prints what every candidate explains (minutes;
`benchmarks.real.tune_lego_nxt`). `--besides` prints what else was tried on it (minutes).
"""

import csv
import io
import math
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from sonarhw_cli.app import run
from sonarhw_compare.fit.plain_fit import fit_scan
from sonarhw_compare.headings import heading_text
from sonarhw_compare.matching.match import TOLERANCE, Comparison, Kind, compare_readings
from sonarhw_compare.matching.silence import roc_area
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.choices import EdgeStrength, Model, Receiver
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.model import Room, load_room
from sonarhw_sim.room.room_writing import with_material

from sonarhw.log import read_log
from sonarhw.readings import FloatArray, Reading

MODELS = (Model.NEAREST, Model.CONE, Model.RAY_FOLLOWING)
DEFAULT_FOLDER = Path("../shared/real_scans")
ROOM = load_room("rooms/arena.toml")
NEARBY = frozenset({"heading", "offset", "position"})
ON_THE_SPOT = frozenset({"heading", "offset"})
UNTUNED = {"aperture_radius": 0.005, "threshold_db": -30.0, "fixed_gain": False}
# Echoes of the carrier itself come at the same turntable angle and range wherever it stands
_OWN_SPREAD = 0.03  # m
_OWN_SHARE = 0.7  # of the scans


@dataclass(frozen=True)
class RealScan:
    """One recorded scan and where it was taken."""

    name: str
    x: float  # m
    y: float  # m
    readings: tuple[Reading, ...]

    @property
    def spot(self) -> str:
        """The place as the command line names it."""
        return f"{self.x},{self.y}"


@dataclass(frozen=True)
class Judged:
    """What one model makes of one scan of n readings."""

    matched: int  # echoes within 5 cm
    sounding: NDArray[np.bool_]  # (n,): readings with an echo
    predicted: NDArray[np.bool_]  # (n,): readings for which one is predicted
    scores: FloatArray  # (n,), dB: level of the loudest predicted echo over the threshold


@dataclass(frozen=True)
class Figures:
    """What a model makes of some scans together."""

    share: float  # of the echoes, within 5 cm
    roc_area: float  # silent headings told from sounding ones by predicted levels, all scans together
    agreement: float  # and by whether an echo is predicted: balanced accuracy


def load_scans(folder: Path) -> list[RealScan]:
    """The scans of a folder, through `sonarhw import`."""
    scans = []
    with open(folder / "scans.csv", newline="") as listing, tempfile.TemporaryDirectory() as scratch:
        for row in csv.DictReader(listing):
            log = Path(scratch) / f"{row['scan']}.mcap"
            source = str(folder / f"{row['scan']}.csv")
            columns = ["--heading", "turret_deg", "--range", "range_cm", "--scale", "0.01", "--no-echo", "255"]
            # where the log lies for a moment concerns nobody
            with redirect_stdout(io.StringIO()):
                status = run(["import", source, "--out", str(log), *columns, "--turn", row["turn"]])
            if status != 0:
                raise SystemExit(status)
            scans.append(RealScan(row["scan"], float(row["x_m"]), float(row["y_m"]), read_log(log).readings))
    return scans


def judge(
    scan: RealScan,
    model: Model,
    board: Board,
    free: frozenset[str] = NEARBY,
    room: Room = ROOM,
    options: PredictionOptions | None = None,
) -> Comparison:
    """One scan beside one model, with what is `free` found for it."""
    fit = fit_scan(scan.readings, room, room.place(scan.spot), board, free, model=model, options=options)
    return compare_readings(
        scan.readings, room, fit.place, board, heading=fit.heading, offset=fit.offset, model=model, options=options
    )


def judged_of(comparison: Comparison) -> Judged:
    """What `figures_of` needs of a comparison."""
    return Judged(
        sum(row.kind is Kind.MATCH for row in comparison.rows),
        np.array([row.measured is not None for row in comparison.rows]),
        np.array([row.predicted is not None for row in comparison.rows]),
        comparison.prediction.over_threshold,
    )


def figures_of(judged: Sequence[Judged]) -> Figures:
    """The figures of several scans together."""
    sounding = np.concatenate([scan.sounding for scan in judged])
    predicted = np.concatenate([scan.predicted for scan in judged])
    return Figures(
        share=sum(scan.matched for scan in judged) / int(sounding.sum()),
        roc_area=roc_area(np.concatenate([scan.scores for scan in judged]), sounding.tolist()) or math.nan,
        agreement=float(predicted[sounding].mean() + (~predicted[~sounding]).mean()) / 2,
    )


def of_the_carrier(scans: Sequence[RealScan]) -> set[tuple[str, int]]:
    """Scan and row of the echoes that come at one turntable angle and range in most scans, whatever the place."""
    ranges = np.array([[np.nan if r.range is None else r.range for r in scan.readings] for scan in scans])
    # at the same row, or the one before or behind it
    others = np.stack([np.roll(ranges, turn, axis=1) for turn in (-1, 0, 1)])
    near = (np.abs(ranges[:, None] - others[:, None]) <= _OWN_SPREAD).any(axis=0)
    elsewhere = np.array([[scan.spot != other.spot for other in scans] for scan in scans])
    shares = (near & elsewhere[:, :, None]).sum(axis=1) / elsewhere.sum(axis=1)[:, None]
    return {(scans[k].name, int(row)) for k, row in np.argwhere(shares >= _OWN_SHARE)}


def repeated(scans: Sequence[RealScan]) -> tuple[float, float]:
    """How much of earlier recordings agrees with later ones of the same place, and how much of later with earlier.

    Shares of the echoes within 5 cm, each pair turned and its ranges shifted by up to 6 cm as agrees best.
    """
    pairs = [(a, b) for k, a in enumerate(scans) for b in scans[k + 1 :] if a.spot == b.spot]
    forward, back = ([_agreement(*pair) for pair in some] for some in (pairs, [(b, a) for a, b in pairs]))
    return _pooled(forward), _pooled(back)


def _agreement(one: RealScan, other: RealScan) -> tuple[int, int]:
    """How many echoes of one scan another has as well, and how many there are."""
    here, there = _ranges(one), _ranges(other)
    turned = np.stack([np.roll(there, k) for k in range(len(there))])
    offsets = np.arange(-0.06, 0.061, 0.005)
    near = np.abs(here - turned[:, None] - offsets[:, None]) <= TOLERANCE
    return int(near.sum(axis=2).max()), int(np.isfinite(here).sum())


def _ranges(scan: RealScan) -> FloatArray:
    return np.array([math.nan if one.range is None else one.range for one in scan.readings])


def _pooled(counts: Sequence[tuple[int, int]]) -> float:
    agreeing, echoes = np.sum(counts, axis=0)
    return float(agreeing / echoes)


def main() -> None:
    """Print a row a scan, the figures of all scans, what the carrier's own echoes make of them, and held-out ones."""
    given = [argument for argument in sys.argv[1:] if not argument.startswith("--")]
    scans = load_scans(Path(given[0]) if given else DEFAULT_FOLDER)
    board = load_board("lego-nxt")
    for title, free in (("heading and offset found", ON_THE_SPOT), ("heading, offset, position found", NEARBY)):
        _tell_models(f"{title} for each scan and model", scans, board, free)
    untuned = [judged_of(judge(scan, Model.RAY_FOLLOWING, replace(board, **UNTUNED))) for scan in scans]
    print(f"ray following before tuning, with a gain that rises ideally: {told(figures_of(untuned))}")
    earlier, later = repeated(scans)
    print(
        f"of two recordings at one place the later has {earlier:.3f} of the earlier's echoes, the earlier {later:.3f}"
    )
    by_name = {scan.name: scan for scan in scans}
    own = [by_name[name].readings[row] for name, row in of_the_carrier(scans)]
    counts = Counter(round(math.degrees(one.angle)) for one in own)
    print("echoes that come wherever it stands, by turntable angle:", end=" ")
    print(", ".join(f"{angle}°: {count}" for angle, count in sorted(counts.items())))
    centimetres = Counter(round(100 * (one.range or math.nan)) for one in own)
    print("and by range, cm:", ", ".join(f"{range_}: {count}" for range_, count in sorted(centimetres.items())))
    if "--cross-validation" in sys.argv:
        from benchmarks.real.tune_lego_nxt import tell_candidates, tell_cross_validation, try_all

        trial = try_all(scans)
        tell_cross_validation(trial)
        tell_candidates(trial)
    if "--besides" in sys.argv:
        _tell_besides(scans, board)


def _tell_besides(scans: Sequence[RealScan], board: Board) -> None:
    """Print what was tried besides tuning and left as it is."""
    own_receiver = PredictionOptions(receiver=Receiver.BOARD)
    tried: list[tuple[str, Board, Room, PredictionOptions | None]] = [("as it is", board, ROOM, None)]
    tried += [("edges by Keller's factor", board, ROOM, PredictionOptions(edge_strength=EdgeStrength.KELLER))]
    tried += [(f"scatter {share}", board, with_material(ROOM, "board", 0.9, share), None) for share in (0.1, 0.3)]
    tried += [
        (
            f"the board's own receiver, swelling in {cycles:g} cycles",
            replace(board, rise_cycles=cycles),
            ROOM,
            own_receiver,
        )
        for cycles in (1.5, 6.0)
    ]
    print("\ntried besides: share within 5 cm, ROC area and balanced accuracy of silence")
    for title, other, room, options in tried:
        judged = [judged_of(judge(scan, Model.RAY_FOLLOWING, other, NEARBY, room, options)) for scan in scans]
        print(f"{title:50}{told(figures_of(judged))}", flush=True)


def told(figures: Figures) -> str:
    """Figures as a row of a table."""
    return f"{figures.share:.3f} {figures.roc_area:.3f} {figures.agreement:.3f}"


def _tell_models(title: str, scans: Sequence[RealScan], board: Board, free: frozenset[str]) -> None:
    print(f"\n{title}: share within 5 cm; ROC area and balanced accuracy of silence; what was found")
    print("scan " + "".join(f"{model.value:>42}" for model in MODELS))
    judged = {model: [judge(scan, model, board, free) for scan in scans] for model in MODELS}
    for k, scan in enumerate(scans):
        print(f"{scan.name:5}" + "".join(_cell(judged[model][k], scan) for model in MODELS))
    totals = [told(figures_of([judged_of(one) for one in judged[model]])) for model in MODELS]
    print("all  " + "".join(f"{total:>21}{'':21}" for total in totals))
    own = of_the_carrier(scans)
    shares = (_share_without(judged[model], scans, own) for model in MODELS)
    print(f"without {len(own)} echoes that come wherever it stands: " + ", ".join(f"{share:.3f}" for share in shares))


def _cell(comparison: Comparison, scan: RealScan) -> str:
    place = comparison.prediction.place.position
    moved = f"{(place[0] - scan.x) * 100:+3.0f}{(place[1] - scan.y) * 100:+3.0f}"
    figures = told(figures_of([judged_of(comparison)]))
    return f"{figures:>21} {heading_text(comparison.heading):>7} {comparison.offset * 100:+4.1f}{moved} cm"


def _share_without(judged: Sequence[Comparison], scans: Sequence[RealScan], own: set[tuple[str, int]]) -> float:
    """The share within 5 cm of the echoes that are not `own`."""
    rows = [
        row
        for scan, comparison in zip(scans, judged, strict=True)
        for row in comparison.rows
        if row.measured is not None and (scan.name, row.index) not in own
    ]
    return sum(row.kind is Kind.MATCH for row in rows) / len(rows)


if __name__ == "__main__":
    main()
