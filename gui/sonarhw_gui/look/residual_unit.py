"""The unit of displayed residuals. They are about a hundredth of a range, so their unit is smaller."""

from dataclasses import dataclass

from sonarhw_gui.look.appearance import LengthUnit


@dataclass(frozen=True)
class ResidualUnit:
    """A small unit of length."""

    label: str
    per_metre: float
    decimals: int

    def text(self, metres: float) -> str:
        """Return the text of a residual with its sign, without the unit."""
        length = round(metres * self.per_metre, self.decimals)
        return f"{length:+.{self.decimals}f}" if length else f"{0:.{self.decimals}f}"


_UNITS = {
    LengthUnit.M: ResidualUnit("mm", 1000.0, 0),
    LengthUnit.CM: ResidualUnit("cm", 100.0, 1),
    LengthUnit.FT: ResidualUnit("in", 1 / 0.0254, 2),
}


def residual_unit(unit: LengthUnit) -> ResidualUnit:
    """Return the unit of residuals for ranges in `unit`."""
    return _UNITS[unit]
