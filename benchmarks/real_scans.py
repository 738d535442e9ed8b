"""How much of real scans each model explains: `python -m benchmarks.real_scans [FOLDER]`.

Takes the folder of real scans (scans.csv and a CSV a scan); imports each as a user would, lets heading and range offset
be found for every model alike, and prints the share of echoes within 5 cm.
"""

import csv
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from cli.app import run
from compare.fit.plain import fit_scan
from compare.match import Summary, compare_readings
from sim.board import load_board
from sim.models import Model
from sim.room import load_room
from sonarhw.log import read_log
from sonarhw.readings import Reading

MODELS = (Model.NEAREST, Model.CONE, Model.RAY_FOLLOWING)
DEFAULT_FOLDER = Path("../shared/real_scans")


@dataclass(frozen=True)
class RealScan:
    """One recorded scan and where it was taken."""

    name: str
    x: float  # m
    y: float  # m
    readings: tuple[Reading, ...]


def load_scans(folder: Path) -> list[RealScan]:
    """The scans of a folder, through `sonarhw import`."""
    scans = []
    with open(folder / "scans.csv", newline="") as listing, tempfile.TemporaryDirectory() as scratch:
        for row in csv.DictReader(listing):
            log = Path(scratch) / f"{row['scan']}.mcap"
            source = str(folder / f"{row['scan']}.csv")
            columns = ["--heading", "turret_deg", "--range", "range_cm", "--scale", "0.01", "--no-echo", "255"]
            status = run(["import", source, "--out", str(log), *columns, "--turn", row["turn"]])
            if status != 0:
                raise SystemExit(status)
            scans.append(RealScan(row["scan"], float(row["x_m"]), float(row["y_m"]), read_log(log).readings))
    return scans


def judge(scan: RealScan, model: Model, board_name: str = "lego-nxt") -> Summary:
    """The figures of one scan under one model, heading and offset found for it."""
    room, board = load_room("rooms/arena.toml"), load_board(board_name)
    place = room.place(f"{scan.x},{scan.y}")
    free = frozenset({"heading", "offset"})
    fit = fit_scan(scan.readings, room, place, board, free, model=model)
    return compare_readings(
        scan.readings, room, place, board, heading=fit.heading, offset=fit.offset, model=model
    ).summary()


def main() -> None:
    """Print a row a scan, and the share of all echoes."""
    scans = load_scans(Path(sys.argv[1]) if len(sys.argv) > 1 else DEFAULT_FOLDER)
    print("scan " + "".join(f"{model.value:>28}" for model in MODELS) + "   (share within 5 cm, heading, offset)")
    totals = dict.fromkeys(MODELS, 0)
    for scan in scans:
        summaries = {model: judge(scan, model) for model in MODELS}
        cells = (
            f"{s.within_5cm or 0:12.3f} {s.heading_deg:7.1f}° {s.offset_m * 100:+4.1f} cm" for s in summaries.values()
        )
        print(f"{scan.name:5}" + "".join(cells))
        for model, summary in summaries.items():
            totals[model] += summary.matched
    echoes = sum(reading.range is not None for scan in scans for reading in scan.readings)
    print("all  " + "".join(f"{totals[model] / echoes:12.3f}{'':16}" for model in MODELS) + f"   of {echoes} echoes")


if __name__ == "__main__":
    main()
