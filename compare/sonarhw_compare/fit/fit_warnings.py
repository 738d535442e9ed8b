"""Warnings of a fit: several solutions, parameters that the data do not determine, values at their bounds."""

import math
from collections.abc import Sequence

from sonarhw_compare.fit.values.fit_result import Estimate, FitResult, PlacedScan
from sonarhw_compare.fit.values.parameters import Parameter
from sonarhw_compare.fit.values.quantities import PlaceQuantity
from sonarhw_compare.fit.values.warning_kinds import (
    AtBound,
    FewExplained,
    FitWarning,
    KnownTogether,
    ManyStrays,
    SeveralSolutions,
    Unconstrained,
    Underestimated,
    pose_text,
)
from sonarhw_compare.matching.few_explained import explains_few
from sonarhw_compare.matching.match import Summary

_INSEPARABLE = 0.95  # smallest correlation that is reported
_SAYS_NOTHING = 0.6  # of the standard deviation of the prior
_AT_BOUND = 0.01  # of the range between the bounds
_MANY_STRAYS = 0.3  # per metre


def warnings_of(result: FitResult, underestimated: Sequence[Parameter] = ()) -> tuple[FitWarning, ...]:
    """Return a warning for each limit of a fit; `underestimated` are parameters whose deviations are too small."""
    warnings: list[FitWarning] = [*_several_solutions(result)]
    if underestimated:
        warnings.append(Underestimated(tuple(underestimated)))
    for parameter in result.parameters:
        warnings += _undetermined(parameter, result.estimates[parameter.name])
    names = list(result.estimates)
    for i in range(len(names)):
        warnings += [
            KnownTogether((names[i], names[j]), float(result.correlations[i, j]))
            for j in range(i)
            if abs(result.correlations[i, j]) > _INSEPARABLE
        ]
    warnings += result.mismatches
    if result.noise["stray_per_m"] > _MANY_STRAYS:
        warnings.append(ManyStrays())
    return tuple(warnings)


def unexplained(scans: Sequence[PlacedScan], agreement: Sequence[Summary]) -> tuple[FewExplained, ...]:
    """Return a warning for each scan that the result explains badly."""
    return tuple(
        FewExplained(scan.title or "this scan", one.within_5cm, one.n_echo)
        for scan, one in zip(scans, agreement, strict=True)
        if one.within_5cm is not None and explains_few(one.within_5cm)
    )


def _several_solutions(result: FitResult) -> list[SeveralSolutions]:
    shown = tuple(one for one in result.parameters if isinstance(one.quantity, PlaceQuantity))
    poses = [tuple(mode.values[one.name] for one in shown) for mode in result.modes]
    # solutions that differ only in digits that are not printed are one
    different: dict[str, tuple[float, ...]] = {}
    for pose in poses:
        different.setdefault(pose_text(shown, pose, poses[0]), pose)
    return [SeveralSolutions(shown, tuple(different.values()))] if len(different) > 1 else []


def is_unconstrained(parameter: Parameter, estimate: Estimate) -> bool:
    """Report whether an estimate is about as uncertain as its prior."""
    lower, upper = _bounds(parameter)
    known = (upper - lower) / math.sqrt(12)
    if parameter.deviation is not None:
        known = min(known, parameter.deviation)
    return estimate.deviation > _SAYS_NOTHING * known


def _bounds(parameter: Parameter) -> tuple[float, float]:
    return (-math.pi, math.pi) if parameter.quantity.is_angle else (parameter.lower, parameter.upper)


def _undetermined(parameter: Parameter, estimate: Estimate) -> list[FitWarning]:
    lower, upper = _bounds(parameter)
    if is_unconstrained(parameter, estimate):
        return [Unconstrained(parameter)]
    if not parameter.quantity.is_angle:
        for bound in (lower, upper):
            if abs(estimate.value - bound) < _AT_BOUND * (upper - lower):
                return [AtBound(parameter, bound)]
    return []
