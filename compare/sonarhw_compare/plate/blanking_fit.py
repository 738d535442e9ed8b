"""The end of blanking, from the first echoes that a board reports."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sonarhw_sim.air import Air
from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.room_echoes import plate_echo

from sonarhw_compare.plate.plate_readings import PlateReadings

TOGETHER = 20e-6  # s: first echoes within this are reported when blanking ends
FEWEST = 5  # such echoes in one log
_LATE = 0.1e-3  # s, later than the board detects the echo of a near plate
_WITHIN = 1e-3  # s, after the echo of a plate begins, in which it still sounds


@dataclass(frozen=True)
class BlankingEnd:
    """The end of blanking, or why it is unknown."""

    time: float | None  # s by the board's clock; None: the readings do not show it
    reason: str = ""


def blanking_end(board: Board, scans: Sequence[PlateReadings]) -> BlankingEnd:
    """Return the end of blanking: the time at which many first echoes are reported, though their sound came before.

    If a plate is so near that its echo begins within blanking and ends after it, the board reports the echo at the
    moment at which blanking ends, at all headings. `board` gives the time that it needs to detect an echo.
    """
    first = min((float(scan.first_times.min()) for scan in scans if len(scan.first_times)), default=math.inf)
    for scan in scans:
        begins = 2 * scan.distance / scan.speed_of_sound
        air = Air(Air().temperature_at(scan.speed_of_sound) or Air().temperature_c)
        detected = begins + 2 * plate_echo(board, air, scan.distance).delay / scan.speed_of_sound
        together = int((scan.first_times <= first + TOGETHER).sum())
        if together < FEWEST or not detected + _LATE < first < begins + _WITHIN:
            continue
        if first <= scan.blanked_until + TOGETHER:
            blanked = f"{scan.blanked_until * 1000:.3g} ms"
            return BlankingEnd(None, f"the scanner ignored all echoes before {blanked}; scan with less blanking")
        return BlankingEnd(first)
    return BlankingEnd(None, "no plate is so near that its echo begins while the board is blanked")
