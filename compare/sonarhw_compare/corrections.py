"""Corrections of a scan that would raise its agreement with a known room: another heading, turn or unit.

Units and turns that no room is needed for are in `sonarhw.scan_check`.
"""

import math
from dataclasses import dataclass

import numpy as np
from sonarhw_sim.air import Model
from sonarhw_sim.predict.prediction import PredictionOptions, paths_serve_all_headings, predict_scan, predict_with

from sonarhw.errors import estimate_degrees
from sonarhw.readings import FloatArray
from sonarhw_compare.fit.starting import agreement_by_turn, all_round
from sonarhw_compare.match import TOLERANCE, Comparison, Kind, few_explained
from sonarhw_compare.regions import mean_run


@dataclass(frozen=True)
class Correction:
    """One way in which a scan may have been read wrongly."""

    name: str  # completes "of the echoes would be ..."
    correction: str
    turn: float = 1.0  # of the angles
    scale: float = 1.0  # of the ranges


def _angle_correction(name: str, key: str, command: str, turn: float) -> Correction:
    return Correction(name, f"add {key} to a `lines:` URL; {command} corrects a log", turn=turn)


def _range_correction(name: str, scale: float) -> Correction:
    command = f"`sonarhw import LOG --scale {scale:g} --out NEW.mcap`"
    return Correction(name, f"check the unit; {command} corrects a log", scale=scale)


MIRRORED = _angle_correction("with clockwise angles", "turn=cw", "`sonarhw import LOG --turn cw --out NEW.mcap`", -1.0)
AS_READ = Correction("", "")
OTHER_UNITS = tuple(
    _range_correction(f"with {scale:g} times the ranges", scale)
    for scale in (0.001, 0.01, 0.1, 0.3937, 0.5, 2.0, 2.54, 10.0, 100.0, 1000.0)
)
_CORRECTIONS = (
    MIRRORED,
    _angle_correction(
        "with angles in radians", "angle=rad", "`sonarhw import LOG --angle rad --out NEW.mcap`", math.degrees(1.0)
    ),
    _angle_correction("with angles in gradians", "angle=gon", "`sonarhw import LOG --angle gon --out NEW.mcap`", 0.9),
    *OTHER_UNITS,
)
_GAIN = 0.2  # least rise of the share of the echoes
_LEAST = 0.5  # least share after the correction
_DEVIATIONS = 3.0  # standard errors of the share, at least, by which it rises
_DEVIATIONS_TURNED = 4.0  # the same at the best of all headings
_ALIKE = 0.05  # shares that are no reason to correct more
_FEWEST = 6  # independent echoes
_SAME_HEADING = math.radians(3)


def agreement_doubts(where: str, comparison: Comparison, model: Model = Model.RAY_FOLLOWING) -> tuple[str, ...]:
    """Return a warning if a correction would explain clearly more echoes, or else if few are explained.

    `where` is the name of the scan. Corrections are those of the prediction by rays; the ranges may also be those of a
    sensor that measures light.
    """
    corrected = None
    if model is Model.RAY_FOLLOWING:
        corrected = correction_doubt(where, comparison) or _light_doubt(where, comparison)
    summary = comparison.summary()
    return (corrected,) if corrected else few_explained(where, summary.within_5cm, summary.n_echo)


def _light_doubt(where: str, comparison: Comparison) -> str | None:
    """Return a warning if the nearest wall ahead explains clearly more echoes than sound does, else None."""
    summary, prediction = comparison.summary(), comparison.prediction
    share, rows = summary.within_5cm, [row for row in comparison.rows if row.measured is not None]
    if share is None or len(rows) < _FEWEST or prediction.board.ring is not None or prediction.poses is not None:
        return None
    headings = np.array([row.heading for row in rows], np.float64)
    nearest = predict_with(Model.NEAREST, prediction.room, prediction.place, prediction.board, headings).ranges
    measured = np.array([row.measured for row in rows], np.float64)
    better = float((np.abs(measured - nearest) <= TOLERANCE).mean())
    if better < max(_LEAST, share + _GAIN):
        return None
    return (
        f"{where}: {share:.0%} of {summary.n_echo} echoes are within 5 cm of the prediction, {better:.0%} of the first "
        "wall ahead, as those of a light sensor are; `sonarhw compare LOG --model nearest` predicts them"
    )


def correction_doubt(where: str, comparison: Comparison) -> str | None:
    """Return a warning if another heading, turn or unit would explain clearly more echoes of a scan, else None.

    None also for a ring, and for a sensor that moves.
    """
    summary = comparison.summary()
    share = summary.within_5cm
    prediction = comparison.prediction
    if share is None or prediction.board.ring is not None or prediction.poses is not None:
        return None
    best = _best(comparison, share)
    if best is None:
        return None
    correction, better, heading = best
    words = [correction.name] if correction.name else []
    actions = [correction.correction] if correction.correction else []
    if heading is not None:
        degrees = estimate_degrees(heading, decimals=1)
        x, y = comparison.prediction.place.position
        words.append(f"with step 0 at {degrees:.1f}°")
        actions.insert(0, f"take the place {x:.6g},{y:.6g},{degrees:.1f}")
    return (
        f"{where}: {share:.0%} of {summary.n_echo} echoes are within 5 cm of the prediction, {better:.0%} would be "
        f"{' and '.join(words)}; {'; '.join(actions)}"
    )


def _best(comparison: Comparison, share: float) -> tuple[Correction, float, float | None] | None:
    """Return the correction with the largest share, that share, and the heading of the place if it is another one."""
    rows = [row for row in comparison.rows if row.measured is not None and row.kind is not Kind.OWN_BODY]
    prediction = comparison.prediction
    board, place = prediction.board, prediction.place
    angles = np.array([row.reading.angle for row in rows], np.float64)
    measured = np.array([row.measured for row in rows], np.float64)
    independent = len(rows) / mean_run(angles, measured)
    if independent < _FEWEST:
        return None
    error = math.sqrt(max(share * (1 - share), 0.05) / independent)
    table = _table(comparison)
    if table is None:
        return None
    choices = []
    for correction in (AS_READ, *_CORRECTIONS):
        turned = place.heading + board.turned(correction.turn * angles)
        shares = agreement_by_turn(table, turned, correction.scale * measured, TOLERANCE) / len(rows)
        best = int(shares.argmax())
        turn = math.remainder(best * math.tau / len(shares), math.tau)
        near = abs(turn) <= _SAME_HEADING or shares[0] >= shares[best] - _ALIKE
        heading = None if near else place.heading + turn - board.heading_at(0.0, 0.0)
        choices.append((correction, float(shares[0] if near else shares[best]), heading))
    choices = [
        (correction, better, heading)
        for correction, better, heading in choices
        if better
        >= max(_LEAST, share + _GAIN, share + (_DEVIATIONS if heading is None else _DEVIATIONS_TURNED) * error)
    ]
    if not choices:
        return None
    most = max(better for _, better, _ in choices)
    # as little as possible: a heading, or a unit or turn, or both
    alike = [choice for choice in choices if choice[1] >= most - _ALIKE]
    return min(alike, key=lambda choice: ((choice[0] is not AS_READ) + (choice[2] is not None), -choice[1]))


def _table(comparison: Comparison) -> FloatArray | None:
    """Return the predicted ranges all around, (720,) m; None if each heading would need a search of its own."""
    prediction = comparison.prediction
    options = PredictionOptions(receiver=prediction.receiver)
    if not paths_serve_all_headings(prediction.board, options.unit):
        return None
    return predict_scan(
        prediction.room, prediction.place, prediction.board, all_round(), options, paths=prediction.paths
    ).ranges
