"""Colours and marks: one meaning, one colour and one shape in every view.

Takes the classes of a comparison; hands on how each is drawn. Okabe and Ito's palette, on white; a shape or a line
style always says the same again.
"""

from dataclasses import dataclass
from enum import Enum, auto

from compare.match import Kind
from compare.picture import MEASURED, PREDICTED, WALL

__all__ = ["MEASURED", "PREDICTED", "WALL"]

PAPER = "#FFFFFF"
INK = "#222222"
GRID_ALPHA = 0.15
CHOSEN = "#000000"  # ring, rays and cursor of the chosen reading
BEAM = "#F7EFB2"  # opaque: transparency costs time at every repaint
BLANKING = "#E4E4E4"
THRESHOLD = "#777777"
TOLERANCE_BAND = "#EAF3F8"
LIVE = "#00694C"
REPLAY = "#7A4B00"
WARNING_PAPER = "#FFF1D6"
WARNING_INK = "#7A3E00"


class Unclassed(Enum):
    """The class of a reading that has not been compared: no room, or not yet."""

    MEASURED = auto()


@dataclass(frozen=True)
class Mark:
    """How readings of one class are drawn."""

    name: str
    symbol: str  # of pyqtgraph
    colour: str
    meaning: str


UNCLASSED = Mark("measured", "o", MEASURED, "measured, not compared with a prediction")
MARKS: dict[Kind | Unclassed, Mark] = {
    Kind.MATCH: Mark("match", "o", MEASURED, "measured and predicted range differ by at most 5 cm"),
    Kind.SHORT: Mark("short", "t", "#A0578A", "measured nearer than predicted, by more than 5 cm"),
    Kind.LONG: Mark("long", "t1", "#009E73", "measured farther than predicted, by more than 5 cm"),
    Kind.EXTRA: Mark("extra", "s", "#E69F00", "an echo was measured where silence was predicted"),
    Kind.MISSED: Mark("missed", "x", "#56B4E9", "an echo was predicted, drawn where, and none was measured"),
    Unclassed.MEASURED: UNCLASSED,
}
