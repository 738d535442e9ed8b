"""The result of a fit as a table for people or as JSON for programs, in degrees and metres, with its warnings."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from sonarhw_cli.console.number_format import deviation_text, estimate_text, with_unit

if TYPE_CHECKING:
    from sonarhw_compare.fit import Estimate, FitResult, Parameter

_CORRELATED = 0.5  # weaker correlations are not printed


def fit_figures(result: "FitResult") -> dict[str, Any]:
    """Return the result of a fit under the keys of `fit --json`; headings in degrees."""
    return {
        "estimates": {
            parameter.name: {"unit": parameter.quantity.unit, **_scaled(parameter, result.estimates[parameter.name])}
            for parameter in result.parameters
        },
        "correlations": result.correlations.tolist(),
        "noise": result.noise,
        "log_likelihood": result.score,
        "answers": [
            {
                "log_likelihood": result.score + mode.score,
                **{one.name: mode.values[one.name] * one.quantity.per_unit for one in result.parameters},
            }
            for mode in result.modes
        ],
        "agreement": [
            {"n_echo": one.n_echo, "within_5cm": one.within_5cm, "explained": one.explained} for one in result.agreement
        ],
        "mismatches": [
            {
                "name": one.parameter.name,
                "unit": one.parameter.quantity.unit,
                "stated": (one.parameter.expected or 0.0) * one.parameter.quantity.per_unit,
                "shift": one.shift * one.parameter.quantity.per_unit,
                "deviation": one.deviation * one.parameter.quantity.per_unit,
                "or": list(one.alternatives),
            }
            for one in result.mismatches
        ],
        "warnings": [str(warning) for warning in result.warnings],
    }


def fit_lines(result: "FitResult") -> Iterator[str]:
    """Yield the table, the agreement, the noise and strong correlations of a fit."""
    width = max(len(parameter.name) for parameter in result.parameters)
    yield f"{'':{width}}  {'value':>12}  {'±':>10}  95 % interval"
    for parameter in result.parameters:
        yield f"{parameter.name:{width}}  {_row(parameter, result.estimates[parameter.name])}"
    yield ""
    yield f"{_agreement(result)} echoes within 5 cm of the fitted prediction"
    yield _noise_line(result.noise)
    names = list(result.estimates)
    for i, name in enumerate(names):
        for j in range(i):
            if abs(result.correlations[i, j]) >= _CORRELATED:
                yield f"{names[j]} and {name} are correlated: {result.correlations[i, j]:+.2f}"


def _row(parameter: "Parameter", estimate: "Estimate") -> str:
    shown, unit = _scaled(parameter, estimate), parameter.quantity.unit
    deviation = shown["deviation"]
    value, lower, upper = (estimate_text(shown[key], deviation) for key in ("value", "lower", "upper"))
    return f"{with_unit(value, unit):>12}  {deviation_text(deviation, unit):>10}  {lower} to {upper}"


def _agreement(result: "FitResult") -> str:
    """Return the share of echoes within 5 cm for each scan, in the order of the logs."""
    return "; ".join(f"{one.within_5cm:.0%} of {one.n_echo}" for one in result.agreement if one.within_5cm is not None)


def _noise_line(noise: dict[str, float]) -> str:
    return (
        f"errors of readings {noise['range_m'] * 1000:.1f} mm, of levels {noise['level_db']:.1f} dB; "
        f"{noise['missed']:.0%} of loud echoes missed, {noise['lost']:.0%} of pings lost, "
        f"{noise['stray_per_m']:.2f} stray echoes a metre{_stretch(noise)}"
    )


def _stretch(noise: dict[str, float]) -> str:
    # the stretch is not estimated if temperature or speed of sound is free
    return f"; ranges {noise['stretch'] - 1:+z.2%} from the speed of sound" if "stretch" in noise else ""


def _scaled(parameter: "Parameter", estimate: "Estimate") -> dict[str, float]:
    per_unit = parameter.quantity.per_unit
    return {key: getattr(estimate, key) * per_unit for key in ("value", "deviation", "lower", "upper")}
