"""Compile all kernels now rather than in the first commands that use them; `make setup` runs this program.

With the argument `demo`, only those that the demo needs for its first scan: half of them. A kernel is compiled by a
call, because the call determines the types of its arguments. So this program predicts, fits, locates and maps a small
scan. A terminal shows the progress.
"""

import sys

import numpy as np
from sonarhw_cli.outputs import CompilationProgress
from sonarhw_compare import PlacedScan, locate_scan, map_scans
from sonarhw_compare.fit.starting import agreement_by_turn, all_round, fit_scan
from sonarhw_compare.locate import PoseSpread
from sonarhw_compare.track import log_likelihood
from sonarhw_sim import PredictionOptions, Receiver, RoomEchoes, Unit, load_board, load_room, predict_scan, predict_with
from sonarhw_sim.air import DEFAULT_BOARD, Model
from sonarhw_sim.board.signal import RATE
from sonarhw_sim.compilation import watch_compilation
from sonarhw_sim.predict.batch import predict_ranges
from sonarhw_sim.predict.predicted_scan import nearest_paths
from sonarhw_sim.room.room import Place, with_material
from sonarhw_sim.room.room_arrays import room_from_arrays

from sonarhw.readings import FloatArray, Reading

# each uses kernels that others do not use
OPTIONS = (
    PredictionOptions(Unit.REFLECT),
    PredictionOptions(Unit.BLOCK, receiver=Receiver.FIRST_ECHO),
    PredictionOptions(Unit.BLOCK, receiver=Receiver.BOARD, noise=0.01),
)


def compile_for_demo() -> None:
    """Call the kernels of the first scan of the demo."""
    room, board = load_room("laboratory"), load_board(DEFAULT_BOARD)
    place, headings = room.place("bench"), np.radians(np.arange(0.0, 360.0, 30.0))
    scan = predict_scan(room, place, board, headings)
    nearest_paths(scan, np.arange(1), np.ones(1), 0.05)
    ping = scan.ping(0)
    _ = ping.levels
    ping.echo_times()
    ping.signal(0.01).rf(RATE)
    RoomEchoes(room, place, board).prepare()
    agreement_by_turn(np.ones_like(all_round()), headings, scan.ranges, 0.05)


def compile_kernels() -> None:
    """Call every kernel that the commands use."""
    compile_for_demo()
    room, board = load_room("simple"), load_board(DEFAULT_BOARD)
    place, headings = room.place("figure9"), np.radians(np.arange(0.0, 360.0, 30.0))
    scan = predict_scan(room, place, board, headings)
    _ = scan.over_threshold
    for model in Model:
        predict_with(model, room, place, board, headings)
    for options in OPTIONS:
        predict_scan(room, place, board, headings, options)
    predict_scan(with_material(room, room.materials[0], 0.9, scatter=0.1), place, board, headings)
    with_heights = load_room("doorstep")
    predict_scan(with_heights, with_heights.place("robot"), board, headings)
    compile_for_small_things(headings)
    poses = np.array([(2.0, 1.6, 0.0), (1.5, 1.5, 0.0)])
    for of_board in ("hc-sr04", DEFAULT_BOARD):
        predict_ranges("laboratory", poses, [0.0, 1.0], of_board)
        log_likelihood("laboratory", poses, [0.0, 1.0], [0.5, np.nan], of_board)
    readings = readings_of(headings, scan.ranges, room.air.speed_of_sound)
    fit_scan(readings, room, place, board, frozenset({"heading", "offset"}))
    locate_scan(readings, room, board, expected=place, spread=PoseSpread(0.01, 0.01), rightly=True)
    map_scans([PlacedScan(readings, place)], board, room)


def compile_for_small_things(headings: FloatArray) -> None:
    """Call the kernels of posts, thin and thick, and of edges so near to each other that they answer together."""
    tray = [(-0.08, 1.9), (-0.08, 2.0), (0.08, 2.0), (0.08, 1.9)]
    walls = {"wall": [(-9.0, 0.0), (9.0, 0.0)], "tray": tray}
    room = room_from_arrays(walls, [(0.3, 0.5, 0.003), (-0.3, 0.5, 0.05)], closed=False)
    for board in ("hc-sr04", DEFAULT_BOARD):
        predict_scan(room, Place("here", (0.0, 1.0)), load_board(board), headings)


def readings_of(headings: FloatArray, ranges: FloatArray, speed: float) -> list[Reading]:
    """Return a reading for each heading (rad) and range (m, NaN for no echo) at a speed of sound, m/s."""
    echoes: list[tuple[float, ...]] = [() if np.isnan(away) else (2 * away / speed,) for away in ranges.tolist()]
    return [
        Reading(number, 0, 0, angle, 0.1 * number, times, speed)
        for number, (angle, times) in enumerate(zip(headings.tolist(), echoes, strict=True))
    ]


if __name__ == "__main__":
    watch_compilation(CompilationProgress())
    if sys.argv[1:] == ["demo"]:
        compile_for_demo()
    else:
        compile_kernels()
