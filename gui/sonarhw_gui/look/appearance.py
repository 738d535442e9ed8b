"""How everything looks: palette, unit of length, size of text.

Takes nothing; hands on a frozen `Look`. A view that is shown another look draws itself anew.
"""

from dataclasses import dataclass, replace
from enum import Enum

from sonarhw_gui.look.palette import LIGHT, Palette

_SMALLEST, _LARGEST = 0.7, 2.5  # scale of text


class LengthUnit(Enum):
    """In what lengths are read; everything is metres until it is written on the screen."""

    M = ("m", 1.0, 3)
    CM = ("cm", 100.0, 1)
    FT = ("ft", 1 / 0.3048, 2)

    def __init__(self, label: str, per_metre: float, decimals: int) -> None:
        self.label = label
        self.per_metre = per_metre
        self.decimals = decimals

    def of(self, metres: float) -> float:
        """A length in this unit."""
        return metres * self.per_metre

    def metres(self, length: float) -> float:
        """A length in this unit, in metres."""
        return length / self.per_metre

    def text(self, metres: float) -> str:
        """A length as people read it, with its unit."""
        return f"{self.of(metres):z.{self.decimals}f} {self.label}"


@dataclass(frozen=True)
class Look:
    """Palette, unit and size of text."""

    palette: Palette = LIGHT
    unit: LengthUnit = LengthUnit.M
    scale: float = 1.0  # of text; 1 is the system's own size

    def scaled(self, scale: float) -> "Look":
        """The same with text of another size, within what can be read and fits."""
        return replace(self, scale=min(max(scale, _SMALLEST), _LARGEST))
