"""The calibration of a board from scans of a flat plate at several distances: values, intervals, and what stays."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from sonarhw_sim.board.profile import Board

from sonarhw.errors import NoPlate, harmless
from sonarhw_compare.plate.blanking_fit import TOGETHER, blanking_end
from sonarhw_compare.plate.level_fit import LevelFit, fit_levels, free_keys
from sonarhw_compare.plate.level_keys import LevelKey
from sonarhw_compare.plate.plate_readings import PlateReadings
from sonarhw_compare.plate.pulse_fit import Measured, PulseShape, pulse_shape, ring_down
from sonarhw_compare.profile_edit import Z95, CalibratedValue, calibrated_profile

# half of a 95 % interval up to which a value counts as determined: dB, or share of the aperture
_MOST_DB = 1.0
_MOST_APERTURE = 0.05
# least standard deviations: humidity and temperature of the air, and the reflectance of the plate are assumed
_LEAST_DB = 0.1
_LEAST_APERTURE = 0.0025
_TICK = 2e-6  # s, of the clock that counts echo times
_MOST_DISTURBED = 0.02  # share of headings; outliers of a plate that stands alone are rarer
_MISFIT_DB = 1.0  # from which on the gain does not explain the levels at all distances


@dataclass(frozen=True)
class PlateCalibration:
    """The result: what was found, what stays as it was and why, and doubts."""

    board: Board  # with the values found
    findings: tuple[CalibratedValue, ...]
    kept: dict[str, str]  # reason by key
    doubts: tuple[str, ...]


def calibrate_with_plates(start: Board, scans: Sequence[PlateReadings]) -> PlateCalibration:
    """Return the calibration of a board from scans of a plate, beginning with the profile `start`."""
    result = _Result(start)
    _find_blanking(result, scans)
    shape = _find_pulse_shape(result, scans)
    levels = _find_levels(result, _after_blanking(result.board, scans))
    _find_ring_down(result, scans, shape, levels)
    if levels.misfit_db > _MISFIT_DB:
        result.doubts.append(
            f"the peaks of one log differ by {levels.misfit_db:.1f} dB from the gain of this profile; "
            "check the distances, and that the plate is large enough"
        )
    if levels.disturbed > _MOST_DISTURBED:
        result.doubts.append(
            f"{levels.disturbed:.0%} of the headings have echoes that a plate alone does not give; the intervals "
            "may be too narrow; remove what stands near the plate, and scan again"
        )
    return PlateCalibration(result.board, tuple(result.findings), result.kept, tuple(result.doubts))


def plate_profile(start: Board, found: PlateCalibration, scans: Sequence[PlateReadings], name: str) -> Board:
    """Return the profile `start` with another name and the values found. Its header names the scans.

    Raises InputError if the text of the profile cannot be changed.
    """
    keys = ", ".join(finding.key for finding in found.findings)
    header = [f"# Calibrated by `sonarhw calibrate` with a plate, beginning with profile {start.name!r}: {keys}."]
    header += [f"#   {harmless(scan.name)}: plate at {scan.distance:g} m" for scan in scans]
    return calibrated_profile(start, name, header, found.findings, found.kept)


def _after_blanking(board: Board, scans: Sequence[PlateReadings]) -> list[PlateReadings]:
    """Return the scans whose echo begins after the board is blanked. Raises NoPlate if there is none."""
    kept = [
        scan for scan in scans if 2 * scan.distance / scan.speed_of_sound > max(board.blanking_end, scan.blanked_until)
    ]
    if not kept:
        nearest = board.blanking_end * scans[0].speed_of_sound / 2
        raise NoPlate(f"no plate is beyond {nearest:.2g} m, where blanking ends; scan a plate that is farther away")
    return kept


class _Result:
    """The result so far."""

    def __init__(self, start: Board) -> None:
        self.start = self.board = start
        self.findings: list[CalibratedValue] = []
        self.kept: dict[str, str] = {}
        self.doubts: list[str] = []

    def add(self, key: str, found: Measured, unit: str) -> None:
        """Add a value with its 95 % interval."""
        half = Z95 * found.deviation
        self.add_between(key, found.value, found.value - half, found.value + half, unit)

    def add_between(self, key: str, value: float, low: float, high: float, unit: str) -> None:
        """Add a value with this interval."""
        # without `ring_cycles`, the ring-down is that of `rise_cycles`
        before = getattr(self.start, key)
        before = float(self.start.rise_cycles if before is None else before)
        self.findings.append(CalibratedValue(key, value, low, high, before, unit))
        self.board = self.board.with_numbers({key: value})


def _find_blanking(result: _Result, scans: Sequence[PlateReadings]) -> None:
    key = "blanking" if result.start.blanking_inhibit is None else "blanking_inhibit"
    found = blanking_end(result.start, scans)
    if found.time is None:
        result.kept[key] = found.reason
    else:
        result.add_between(key, found.time, found.time - TOGETHER, found.time + _TICK, "s")


def _find_pulse_shape(result: _Result, scans: Sequence[PlateReadings]) -> PulseShape | None:
    found = pulse_shape(result.start, scans, np.array([scan.middle for scan in scans]))
    if found is None:
        traces = any(scan.pulses for scan in scans)
        result.kept["rise_cycles"] = (
            "too few echoes of the plate are loud without being limited" if traces else "the logs contain no traces"
        )
        return None
    result.add("rise_cycles", found.rise, "cycles")
    if found.ring is not None or result.start.ring_cycles is not None:
        result.add("ring_cycles", found.ring or found.rise, "cycles")
    return found


def _find_levels(result: _Result, scans: Sequence[PlateReadings]) -> LevelFit:
    """Fit the levels. Keys that they do not determine stay, and count as unknown in the intervals of the others."""
    keys = free_keys(result.start, scans)
    if LevelKey.GAIN_STEP not in keys:
        result.kept[LevelKey.GAIN_STEP] = (
            "one log shows the gain at one time only" if result.start.gain_steps else "this profile has no gain steps"
        )
    fit = fit_levels(result.board, scans, keys)
    for key in keys:
        if _share(fit, key) > 1:
            result.kept[key] = f"the scans determine it to ± {_half_text(fit, key)} only"
            continue
        aperture = key is LevelKey.APERTURE
        value = float(getattr(fit.board, key))
        least = _LEAST_APERTURE * value if aperture else _LEAST_DB
        result.add(key, Measured(value, math.hypot(fit.deviations[key], least)), "m" if aperture else "dB")
    return fit


def _share(fit: LevelFit, key: LevelKey) -> float:
    """Return half of the 95 % interval of a value, as a share of the most with which it counts as determined."""
    most = _MOST_APERTURE * fit.board.aperture_radius if key is LevelKey.APERTURE else _MOST_DB
    return Z95 * fit.deviations[key] / most


def _half_text(fit: LevelFit, key: LevelKey) -> str:
    half = Z95 * fit.deviations[key]
    return f"{half / fit.board.aperture_radius:.0%}" if key is LevelKey.APERTURE else f"{half:.1f} dB"


def _find_ring_down(
    result: _Result, scans: Sequence[PlateReadings], shape: PulseShape | None, levels: LevelFit
) -> None:
    if not any(scan.pulses for scan in scans):
        result.kept["own_burst_db"] = "the logs contain no traces"
        return
    deviation = 0.0 if shape is None else (shape.ring or shape.rise).deviation
    found = ring_down(result.board, deviation, scans, levels.trace_level_db)
    if found is None:
        result.kept["own_burst_db"] = "the traces do not show how the burst decays"
        return
    cycles = result.board.ring_cycles or result.board.rise_cycles
    if not found.explained_by(cycles):
        result.kept["own_burst_db"] = (
            f"the burst decays with {found.cycles:.1f} cycles, and the echoes with {cycles:.1f}; "
            "a profile has one value for both"
        )
        return
    result.add("own_burst_db", found.level, "dB")
