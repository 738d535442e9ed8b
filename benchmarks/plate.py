"""Errors of calibrations with plates: `python -m benchmarks.plate [BOARDS] [--traces] [--step DEG] [--emulated]`.

Each board has random constants, a tilted head, and five scans of a wall by a fake scanner: 3 mm beside the stated
distance, 0.5 dB of scatter in level, three pings at each heading. Prints the error and the half of the 95 % interval of
each constant, *open* if the calibration says that the scans do not determine it, and the share of the intervals that
contain the constant. Takes some 10 s of processor time a board. With `--emulated`, the firmware on the emulated board
makes the scans, after `make -C firmware emulator`; that takes some minutes a board.
"""

import argparse
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from sonarhw_compare.calibration.outcome import Calibration
from sonarhw_compare.calibration.plate import calibrate_with_plates
from sonarhw_compare.calibration.plate_readings import PlateReadings, plate_readings
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.room_echoes import RoomEchoes
from sonarhw_sim.room.room import Place

from sonarhw import Scanner, sector
from sonarhw.device.emulated_board import emulated_board
from tests.fixtures.plate_scans import (
    ALONE,
    DISTANCES,
    LISTEN,
    STARTS_EARLY,
    hidden_board,
    plates,
    start_board,
    wall_room,
)

BOARDS = 8
SEED = 11
WIDTH = 40.0  # degrees to either side of the plate
PINGS = 3
PACE = 2.0  # of the emulated board's time
COLUMNS = {
    "aperture_radius": "aperture, %",
    "gain_step_db": "gain step, dB",
    "threshold_db": "threshold, dB",
    "rise_cycles": "swelling, %",
    "own_burst_db": "own burst, dB",
}


@dataclass(frozen=True)
class CalibratedBoard:
    """The constants of a board, and what its calibration found."""

    constants: dict[str, float]  # by key of the profile
    found: Calibration

    def errors(self) -> dict[str, tuple[float, float, bool]]:
        """Return error, half of the interval, and whether this contains the constant, for each value that was found.

        In the units of `COLUMNS`.
        """
        errors = {}
        for finding in self.found.findings:
            if finding.key in self.constants:
                truth = self.constants[finding.key]
                unit = truth / 100 if COLUMNS[finding.key].endswith("%") else 1.0
                half = (finding.high - finding.low) / 2
                errors[finding.key] = (finding.value - truth) / unit, half / unit, finding.low <= truth <= finding.high
        return errors


def calibrated_boards(
    boards: int, traces: bool, step_deg: float = 1.0, emulated: bool = False
) -> Iterator[CalibratedBoard]:
    """Yield boards with random constants and their calibrations."""
    random, start = np.random.default_rng(SEED), start_board()
    for seed in range(boards):
        constants = {
            "aperture_radius": 0.0192 * math.exp(random.uniform(-0.15, 0.15)),
            "gain_step_db": random.uniform(3.0, 4.6),
            "threshold_db": random.uniform(-44.0, -34.0),
            # without traces, the swelling is assumed
            "rise_cycles": random.uniform(1.0, 3.5) if traces else start.rise_cycles,
            "own_burst_db": random.uniform(5.0, 14.0),
        }
        tilt = random.uniform(-3, 3)
        scanned = emulated_plates if emulated else plates
        scans = scanned(hidden_board(**constants), seed=seed, tilt_deg=tilt, traces=traces, step_deg=step_deg)
        yield CalibratedBoard(constants, calibrate_with_plates(start, scans))


def emulated_plates(board: Board, seed: int, tilt_deg: float, traces: bool, step_deg: float) -> list[PlateReadings]:
    """Return the same as `plates`, from scans by the firmware on the emulated board."""
    scans, start = [], start_board()
    for k, distance in enumerate(DISTANCES):
        place = Place("here", (-distance, 0.0), math.radians(tilt_deg))
        echoes = RoomEchoes(wall_room(), place, board, 10 * seed + k, ALONE)
        echoes.prepare()
        with emulated_board(echoes, pace=PACE) as device, Scanner.open(device.url) as scanner:
            scanner.configure(LISTEN, STARTS_EARLY, traces)
            readings = list(scanner.scan(sector(-WIDTH, WIDTH + step_deg / 2, step_deg, PINGS)))
        scans.append(plate_readings(f"{distance:g} m", readings, distance, 0.0, start, STARTS_EARLY))
    return scans


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("boards", nargs="?", type=int, default=BOARDS)
    parser.add_argument("--traces", action="store_true")
    parser.add_argument("--step", type=float, default=1.0, help="degrees from one heading to the next")
    parser.add_argument("--emulated", action="store_true", help="scans of the firmware on the emulated board")
    chosen = parser.parse_args()
    keys = list(COLUMNS) if chosen.traces else list(COLUMNS)[:3]
    print("board" + "".join(f"{COLUMNS[key]:>16}" for key in keys))
    every: list[dict[str, tuple[float, float, bool]]] = []
    for row, board in enumerate(calibrated_boards(chosen.boards, chosen.traces, chosen.step, chosen.emulated)):
        every.append(board.errors())
        cells = [f"{every[-1][key][0]:+.2f} ± {every[-1][key][1]:.2f}" if key in every[-1] else "open" for key in keys]
        print(f"{row:5}" + "".join(f"{cell:>16}" for cell in cells), flush=True)
    largest = [max((abs(errors[key][0]) for errors in every if key in errors), default=math.nan) for key in keys]
    print("most " + "".join(f"{one:>16.2f}" for one in largest))
    held = [error[2] for errors in every for error in errors.values()]
    print(f"{sum(held)} of {len(held)} intervals contain the constant")


if __name__ == "__main__":
    main()
