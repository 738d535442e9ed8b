"""What a fit cannot tell: several answers, directions in which the data say nothing, values at their bounds.

Takes a `FitResult`; hands on lines for a person.
"""

import math
from collections.abc import Sequence

from sonarhw_compare.fit.values.fit_result import Estimate, FitResult, PlacedScan
from sonarhw_compare.fit.values.parameters import Parameter
from sonarhw_compare.fit.values.quantities import PlaceQuantity
from sonarhw_compare.headings import heading_text
from sonarhw_compare.matching.match import Summary

_INSEPARABLE = 0.95  # correlation from which on two numbers are only known together
_SAYS_NOTHING = 0.6  # of the spread that a value anywhere between its bounds, or what was known beforehand, would have
_AT_BOUND = 0.01  # of the range
_ALONE = "the board's own receiver was taken to hear each echo alone; four regions of five hold the truth"
_MANY_STRAYS = 0.3  # for every metre
_FEW = 0.6  # of a scan's echoes: in their own rooms, real ones have more within 5 cm


def warnings_of(result: FitResult, unending: Sequence[Parameter] = (), lone: bool = False) -> tuple[str, ...]:
    """One line for everything that the data do not tell; `unending` are parameters whose deviations are too small.

    `lone`: echoes were heard by a receiver that was modelled as if each came alone.
    """
    lines = [*_several_answers(result)]
    biased = [parameter.name for parameter in result.parameters if parameter.quantity.by_levels]
    if lone and biased:
        lines.append(f"± is too small for {', '.join(biased)}: {_ALONE}")
    if unending:
        several = ", ".join(parameter.name for parameter in unending)
        lines.append(f"± cannot be trusted: {several} can change together by far more; hold one, or say what is known")
    for parameter in result.parameters:
        lines += _undetermined(parameter, result.estimates[parameter.name])
    names = list(result.estimates)
    for i in range(len(names)):
        lines += [
            f"{names[i]} and {names[j]} are only known together (correlation {result.correlations[i, j]:+.2f})"
            for j in range(i)
            if abs(result.correlations[i, j]) > _INSEPARABLE
        ]
    if result.noise["stray_per_m"] > _MANY_STRAYS:
        lines.append("many echoes come by no path of the model; something may stand in the room that the file lacks")
    return tuple(lines)


def unexplained(scans: Sequence[PlacedScan], agreement: Sequence[Summary]) -> tuple[str, ...]:
    """One line for every scan that what was found explains badly."""
    return tuple(
        f"{scan.name or 'this scan'}: only {one.within_5cm:.0%} of {one.n_echo} echoes lie within 5 cm of "
        "the prediction from there; is it this room, and this board?"
        for scan, one in zip(scans, agreement, strict=True)
        if one.within_5cm is not None and one.within_5cm < _FEW
    )


def _several_answers(result: FitResult) -> list[str]:
    if len(result.modes) < 2:
        return []
    told = "; ".join(_pose(result, dict(mode.values)) for mode in result.modes)
    return [f"{len(result.modes)} answers explain the scan about equally well, the room may be symmetric: {told}"]


def _pose(result: FitResult, values: dict[str, float]) -> str:
    shown = [parameter for parameter in result.parameters if isinstance(parameter.quantity, PlaceQuantity)]
    best = result.modes[0].values
    changed = [one for one in shown if result.modes[0].values is values or abs(values[one.name] - best[one.name]) > 0]
    return ", ".join(
        f"{one.name} {heading_text(values[one.name])}"
        if one.quantity.is_angle
        else f"{one.name} {values[one.name]:.3f}"
        for one in changed or shown
    )


def _undetermined(parameter: Parameter, estimate: Estimate) -> list[str]:
    lower, upper = (-math.pi, math.pi) if parameter.quantity.is_angle else (parameter.lower, parameter.upper)
    width = upper - lower
    known = width / math.sqrt(12)
    if parameter.deviation is not None:
        known = min(known, parameter.deviation)
    if estimate.deviation > _SAYS_NOTHING * known:
        return [f"the scan hardly tells {parameter.name}: ± as wide as what was known before it"]
    if not parameter.quantity.is_angle:
        for bound in (lower, upper):
            if abs(estimate.value - bound) < _AT_BOUND * width:
                return [f"{parameter.name} lies at the end of its range, {bound:g}"]
    return []
