"""In what residuals are read: they are a hundredth of a range, so in the small unit of the same family.

Takes a unit of length; hands on the small one that goes with it.
"""

from dataclasses import dataclass

from sonarhw_gui.look.appearance import LengthUnit


@dataclass(frozen=True)
class ResidualUnit:
    """A small unit of length."""

    label: str
    per_metre: float
    decimals: int

    def text(self, metres: float) -> str:
        """A residual as people read it, with its sign and without the unit."""
        length = round(metres * self.per_metre, self.decimals)
        return f"{length:+.{self.decimals}f}" if length else f"{0:.{self.decimals}f}"


_UNITS = {
    LengthUnit.M: ResidualUnit("mm", 1000.0, 0),
    LengthUnit.CM: ResidualUnit("cm", 100.0, 1),
    LengthUnit.FT: ResidualUnit("in", 1 / 0.0254, 2),
}


def residual_unit(unit: LengthUnit) -> ResidualUnit:
    """What residuals are read in where ranges are read in `unit`."""
    return _UNITS[unit]
