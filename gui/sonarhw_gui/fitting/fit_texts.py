"""The result of a fit as text: values with standard deviations, the share of matching echoes, warnings."""

import math
from typing import TYPE_CHECKING

from sonarhw_gui.fitting.fit_request import FitFound, FitSettings
from sonarhw_gui.look.appearance import LengthUnit
from sonarhw_gui.look.residual_unit import residual_unit

if TYPE_CHECKING:
    from sonarhw_compare.fit import Estimate, Parameter  # importing it takes half a second
    from sonarhw_compare.fit.result import FitWarning


def rows(found: FitFound, solution: int, unit: LengthUnit) -> list[tuple[str, str, str]]:
    """Return name, value and standard deviation in the same unit. Only the best solution has deviations."""
    values = found.solutions[solution].values
    if solution > 0:
        return [(_name(one), value_text(one, value, unit), "") for one, value in values.items()]
    estimates = found.result.estimates
    return [
        (_name(one), _as_known(one, value, estimates[one.name], unit), _deviation(one, estimates[one.name], unit))
        for one, value in values.items()
    ]


def share_line(found: FitFound, solution: int) -> str:
    """Return the shares of echoes within 5 cm before the fit and with this solution."""
    before, after = (_percent(share) for share in (found.within_5cm, found.solutions[solution].within_5cm))
    return f"within 5 cm: {before} before, {after} after"


def solution_line(found: FitFound, solution: int, unit: LengthUnit) -> str:
    """Return the pose of a solution in one line."""
    values = found.solutions[solution].values
    pose = {one.quantity.name: value_text(one, value, unit) for one, value in values.items()}
    place = ", ".join(pose[name] for name in ("x", "y", "heading") if name in pose)
    return f"{solution + 1}: {place or 'same pose'}"


def warnings(found: FitFound) -> list[str]:
    """Return what the scan cannot determine, and whether the fit matches worse than before."""
    texts = [_warning_text(warning, found.request.settings) for warning in found.result.warnings]
    before, after = found.within_5cm, found.solutions[0].within_5cm
    if before is not None and after is not None and after < before:
        texts.append("fewer echoes match than before: the room differs from its file in something else")
    return texts


def _warning_text(warning: "FitWarning", settings: FitSettings) -> str:
    """Return a warning in the words of the window: its list has the solutions, and no command is named."""
    from sonarhw_compare.fit import FewExplained, SeveralSolutions

    match warning:
        case SeveralSolutions():
            return "several poses explain the scan about equally well, the room may be symmetric; try each above"
        case FewExplained(share=share):
            elsewhere = "" if settings.everywhere else ", or search in the whole room"
            return f"only {_percent(share)} of the echoes are within 5 cm; check the room and the board{elsewhere}"
        case _:
            return str(warning)


def _name(one: "Parameter") -> str:
    return f"{one.quantity.label} {one.of}".strip()


def value_text(one: "Parameter", value: float, unit: LengthUnit) -> str:
    """Return the text of a value with its unit."""
    match one.quantity.unit:
        case "°":
            return _signed(f"{math.degrees(value):z.2f}°")
        case "m" if one.quantity.word == "position":
            return _signed(unit.text(value))
        case "m":
            small = residual_unit(unit)
            return _signed(f"{value * small.per_metre:+z.{small.decimals + 1}f} {small.label}")
        case "":
            return f"{value:.3f}"
        case printed:
            return _signed(f"{value:z.1f} {printed}")


def _as_known(one: "Parameter", value: float, estimate: "Estimate", unit: LengthUnit) -> str:
    """Return a value with as many digits as its deviation justifies; a position in the unit of its deviation."""
    if one.quantity.word != "position":
        return value_text(one, value, unit)
    small = residual_unit(unit)
    decimals = min(2, _decimals(estimate.deviation * small.per_metre))
    return _signed(f"{value * small.per_metre:z.{decimals}f} {small.label}")


def _deviation(one: "Parameter", estimate: "Estimate", unit: LengthUnit) -> str:
    match one.quantity.unit:
        case "°":
            return f"± {_two_figures(math.degrees(estimate.deviation))}°"
        case "m":
            small = residual_unit(unit)
            return f"± {_two_figures(estimate.deviation * small.per_metre)} {small.label}"
        case printed:
            return f"± {_two_figures(estimate.deviation)} {printed}".rstrip()


def _signed(text: str) -> str:
    return text.replace("-", "−")


def _two_figures(deviation: float) -> str:
    if not math.isfinite(deviation):
        return "?"
    return f"{deviation:.{min(_decimals(deviation), 4)}f}"


def _decimals(deviation: float) -> int:
    """Return the number of decimals for two significant digits."""
    return max(0, 1 - math.floor(math.log10(deviation))) if deviation > 0 and math.isfinite(deviation) else 0


def _percent(share: float | None) -> str:
    return "no echo" if share is None else f"{share:.0%}"
