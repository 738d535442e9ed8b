"""The appearance of the window: palette, unit of length and text size, as a frozen `Look`."""

from dataclasses import dataclass, replace
from enum import Enum

from sonarhw_gui.look.palette import LIGHT, Palette

_SMALLEST, _LARGEST = 0.7, 2.5  # text scale


class LengthUnit(Enum):
    """The unit of displayed lengths. All values are metres until they are displayed."""

    M = ("m", 1.0, 3)
    CM = ("cm", 100.0, 1)
    FT = ("ft", 1 / 0.3048, 2)

    def __init__(self, label: str, per_metre: float, decimals: int) -> None:
        self.label = label
        self.per_metre = per_metre
        self.decimals = decimals

    def of(self, metres: float) -> float:
        """Return a length in this unit."""
        return metres * self.per_metre

    def metres(self, length: float) -> float:
        """Convert a length in this unit to metres."""
        return length / self.per_metre

    def text(self, metres: float) -> str:
        """Return the text of a length with its unit."""
        return f"{self.of(metres):z.{self.decimals}f} {self.label}"


@dataclass(frozen=True)
class Look:
    """Palette, unit and text size."""

    palette: Palette = LIGHT
    unit: LengthUnit = LengthUnit.M
    scale: float = 1.0  # text scale; 1 is the system's text size

    def scaled(self, scale: float) -> "Look":
        """Return the same look with another text scale, limited to readable sizes that fit the window."""
        return replace(self, scale=min(max(scale, _SMALLEST), _LARGEST))
