"""Predictions of real scans, by sensor: `python -m benchmarks.real.real_scans [FOLDER]`, about ten minutes.

Imports each scan of the folder, and of its folders with a scans.csv, as a user would. Prints share of echoes within
5 cm, detection of silence and log score of each sensor, with the generic profile, calibrated on the sensor's other
places, and calibrated on other sensors (`benchmarks.real.sensor_table`). `--figure` draws them. `--sensors A,K` tests
some sensors only. Results of each place are kept in build/real_scans, so that an interrupted run goes on; they are
computed again if a scan or the code of the predictions changes.

`--models` compares models on the scans of FOLDER/scans.csv alone (minutes): heading, range offset and a position within
3 cm are fitted for every model in the same way. `--cross-validation` tunes the generic profile without a place or a
recording, tests it there, and prints the results of every candidate (`benchmarks.real.tune_lego_nxt`). `--besides`
prints other variants that were tried.
"""

import math
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from sonarhw_compare.match import Comparison, Kind
from sonarhw_sim.air import EdgeStrength, Model, Receiver
from sonarhw_sim.board.profile import Board, load_board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Room
from sonarhw_sim.room.room_writing import with_material

from benchmarks.real.judged_scans import (
    MODELS,
    NEARBY,
    ON_THE_SPOT,
    ROOM,
    RealScan,
    as_row,
    echoes_of_the_robot,
    figures_of,
    judge,
    judged_of,
    load_scans,
    load_sensors,
    program_options,
    repeated,
    untuned,
)
from benchmarks.real.sensor_table import print_sensors
from benchmarks.real.tune_lego_nxt import print_candidates, print_cross_validation, try_all
from sonarhw.errors import heading_text

FIGURE = Path("docs/explanation/real_scans.png")


def main() -> None:
    """Print the tables that the options select; by default those of each sensor."""
    chosen = program_options(
        "Compare predictions with real scans.",
        sensors=True,
        figure=f"also draw {FIGURE}",
        models="compare models on the scans of FOLDER/scans.csv alone (minutes)",
        cross_validation="tune the board without a place or a recording, and test it there (minutes)",
        besides="print other variants that were tried (minutes)",
    )
    if not (chosen.models or chosen.cross_validation or chosen.besides):
        sensors = load_sensors(chosen.folder)
        tested = chosen.sensors.split(",") if chosen.sensors else list(sensors)
        if unknown := set(tested).difference(sensors):
            raise SystemExit(f"--sensors {sorted(unknown)[0]}: no such sensor; expected some of {', '.join(sensors)}")
        try:
            print_sensors(sensors, tested, FIGURE if chosen.figure else None)
        except KeyboardInterrupt:
            print("stopped; the places that are done are kept, and the same command goes on", file=sys.stderr)
            raise SystemExit(130) from None
        return
    scans, board = load_scans(chosen.folder), load_board("lego-nxt")
    if chosen.models:
        _print_all_models(scans, board)
    if chosen.cross_validation:
        trial = try_all(scans)
        print_cross_validation(trial)
        print_candidates(trial)
    if chosen.besides:
        _print_besides(scans, board)


def _print_all_models(scans: Sequence[RealScan], board: Board) -> None:
    """Print a row for each scan, the figures of all scans, and those without the robot's own echoes."""
    for title, free in (("heading and offset found", ON_THE_SPOT), ("heading, offset, position found", NEARBY)):
        _print_models(f"{title} for each scan and model", scans, board, free)
    earlier_board = [judged_of(judge(scan, Model.RAY_FOLLOWING, untuned(board))) for scan in scans]
    print(f"ray following before tuning, with a gain that rises ideally: {as_row(figures_of(earlier_board))}")
    earlier, later = repeated(scans)
    print(
        f"two recordings at one place: the later one contains {earlier:.3f} of the earlier one's echoes, the earlier "
        f"one {later:.3f} of the later one's"
    )
    by_name = {scan.name: scan for scan in scans}
    own = [by_name[name].readings[row] for name, row in echoes_of_the_robot(scans)]
    counts = Counter(round(math.degrees(one.angle)) for one in own)
    print("echoes at the same angle and range at every place, by turntable angle:", end=" ")
    print(", ".join(f"{angle}°: {count}" for angle, count in sorted(counts.items())))
    centimetres = Counter(round(100 * (one.range or math.nan)) for one in own)
    print("and by range, cm:", ", ".join(f"{range_}: {count}" for range_, count in sorted(centimetres.items())))


def _print_besides(scans: Sequence[RealScan], board: Board) -> None:
    """Print variants that were tried in addition to tuning and not used."""
    own_receiver = PredictionOptions(receiver=Receiver.BOARD)
    tried: list[tuple[str, Board, Room, PredictionOptions | None]] = [("as it is", board, ROOM, None)]
    tried += [("arrivals that coincide added", replace(board, sum_arrivals=True), ROOM, None)]
    tried += [("edges by Keller's factor", board, ROOM, PredictionOptions(edge_strength=EdgeStrength.KELLER))]
    tried += [(f"scatter {share}", board, with_material(ROOM, "board", 0.9, share), None) for share in (0.1, 0.3)]
    tried += [
        (
            f"the board's own receiver, rise time {cycles:g} cycles",
            replace(board, rise_cycles=cycles),
            ROOM,
            own_receiver,
        )
        for cycles in (1.5, 6.0)
    ]
    print("\ntried besides: share within 5 cm, ROC area and balanced accuracy of silence")
    for title, other, room, options in tried:
        judged = [judged_of(judge(scan, Model.RAY_FOLLOWING, other, NEARBY, room, options)) for scan in scans]
        print(f"{title:50}{as_row(figures_of(judged))}", flush=True)


def _print_models(title: str, scans: Sequence[RealScan], board: Board, free: frozenset[str]) -> None:
    print(f"\n{title}: share within 5 cm; ROC area and balanced accuracy of silence; fitted values")
    print("scan " + "".join(f"{model.value:>42}" for model in MODELS))
    judged = {model: [judge(scan, model, board, free) for scan in scans] for model in MODELS}
    for k, scan in enumerate(scans):
        print(f"{scan.name:5}" + "".join(_cell(judged[model][k], scan) for model in MODELS))
    totals = [as_row(figures_of([judged_of(one) for one in judged[model]])) for model in MODELS]
    print("all  " + "".join(f"{total:>21}{'':21}" for total in totals))
    own = echoes_of_the_robot(scans)
    shares = (_share_without(judged[model], scans, own) for model in MODELS)
    print(f"without {len(own)} echoes repeated at every place: " + ", ".join(f"{share:.3f}" for share in shares))


def _cell(comparison: Comparison, scan: RealScan) -> str:
    place = comparison.prediction.place.position
    moved = f"{(place[0] - scan.x) * 100:+3.0f}{(place[1] - scan.y) * 100:+3.0f}"
    figures = as_row(figures_of([judged_of(comparison)]))
    return f"{figures:>21} {heading_text(comparison.heading):>7} {comparison.offset * 100:+4.1f}{moved} cm"


def _share_without(judged: Sequence[Comparison], scans: Sequence[RealScan], own: set[tuple[str, int]]) -> float:
    """Return the share within 5 cm of the echoes that are not `own`."""
    rows = [
        row
        for scan, comparison in zip(scans, judged, strict=True)
        for row in comparison.rows
        if row.measured is not None and (scan.name, row.index) not in own
    ]
    return sum(row.kind is Kind.MATCH for row in rows) / len(rows)


if __name__ == "__main__":
    main()
