"""Warnings of a fit: several solutions, parameters that the data do not determine, values at their bounds."""

import math
from collections.abc import Sequence

from sonarhw_compare.fit.mismatches import mismatch_line
from sonarhw_compare.fit.values.fit_result import Estimate, FitResult, PlacedScan
from sonarhw_compare.fit.values.parameters import Parameter
from sonarhw_compare.fit.values.quantities import PlaceQuantity
from sonarhw_compare.headings import estimate_degrees
from sonarhw_compare.matching.few_explained import few_explained
from sonarhw_compare.matching.match import Summary

_INSEPARABLE = 0.95  # smallest correlation that is reported
_SAYS_NOTHING = 0.6  # of the standard deviation of the prior
_AT_BOUND = 0.01  # of the range between the bounds
_MANY_STRAYS = 0.3  # per metre


def warnings_of(result: FitResult, underestimated: Sequence[Parameter] = ()) -> tuple[str, ...]:
    """Return one line for each limit of a fit; `underestimated` are parameters whose deviations are too small."""
    lines = [*several_solutions(result)]
    if underestimated:
        several = ", ".join(parameter.name for parameter in underestimated)
        lines.append(
            f"± cannot be trusted: {several} can change together by far more; fix one of them, or give a prior"
        )
    for parameter in result.parameters:
        lines += _undetermined(parameter, result.estimates[parameter.name])
    names = list(result.estimates)
    for i in range(len(names)):
        lines += [
            f"{names[i]} and {names[j]} are only known together (correlation {result.correlations[i, j]:+.2f})"
            for j in range(i)
            if abs(result.correlations[i, j]) > _INSEPARABLE
        ]
    lines += [mismatch_line(one) for one in result.mismatches]
    if result.noise["stray_per_m"] > _MANY_STRAYS:
        lines.append("many echoes match no path of the model; an object may be missing in the room file")
    return tuple(lines)


def unexplained(scans: Sequence[PlacedScan], agreement: Sequence[Summary]) -> tuple[str, ...]:
    """Return one line for each scan that the result explains badly."""
    return tuple(
        line
        for scan, one in zip(scans, agreement, strict=True)
        for line in few_explained(scan.title or "this scan", one.within_5cm, one.n_echo)
    )


def several_solutions(result: FitResult) -> list[str]:
    """Return one line with the pose of each solution; none if only one solution is printed."""
    if len(result.modes) < 2:
        return []
    # solutions that differ only in digits that are not printed are one
    poses = [*dict.fromkeys(_pose(result, dict(mode.values)) for mode in result.modes)]
    if len(poses) < 2:
        return []
    return [
        f"{len(poses)} solutions explain the scan about equally well, the room may be symmetric: {'; '.join(poses)}"
    ]


def _pose(result: FitResult, values: dict[str, float]) -> str:
    shown = [parameter for parameter in result.parameters if isinstance(parameter.quantity, PlaceQuantity)]
    best = result.modes[0].values
    changed = [one for one in shown if result.modes[0].values is values or abs(values[one.name] - best[one.name]) > 0]
    return ", ".join(
        f"{one.name} {estimate_degrees(values[one.name], best[one.name], 1):.1f}°"
        if one.quantity.is_angle
        else f"{one.name} {values[one.name]:z.3f}"
        for one in changed or shown
    )


def is_unconstrained(parameter: Parameter, estimate: Estimate) -> bool:
    """Report whether an estimate is about as uncertain as its prior."""
    lower, upper = _bounds(parameter)
    known = (upper - lower) / math.sqrt(12)
    if parameter.deviation is not None:
        known = min(known, parameter.deviation)
    return estimate.deviation > _SAYS_NOTHING * known


def _bounds(parameter: Parameter) -> tuple[float, float]:
    return (-math.pi, math.pi) if parameter.quantity.is_angle else (parameter.lower, parameter.upper)


def _undetermined(parameter: Parameter, estimate: Estimate) -> list[str]:
    lower, upper = _bounds(parameter)
    if is_unconstrained(parameter, estimate):
        return [f"the scan hardly constrains {parameter.name}: ± is as wide as the prior"]
    if not parameter.quantity.is_angle:
        for bound in (lower, upper):
            if abs(estimate.value - bound) < _AT_BOUND * (upper - lower):
                return [f"{parameter.name} is at its bound, {bound:g} {parameter.quantity.unit}".rstrip()]
    return []
