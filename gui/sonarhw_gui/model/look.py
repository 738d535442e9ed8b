"""The appearance of the window: palette, unit of length, text size and symbols."""

from dataclasses import dataclass, replace
from enum import Enum, auto

from sonarhw_compare.match import Kind
from sonarhw_compare.pictures import EXTRA, LONG, MEASURED, MISSED, OWN_BODY, PREDICTED, SHORT, WALL

# Colours and marks, the same in every view, in a light and a dark palette.
#
# The hues are those of Okabe and Ito. Each colour also has its own shape or line style, so that colour is never the
# only difference.


class Unclassed(Enum):
    """The class of a reading that is not compared."""

    MEASURED = auto()  # there is no room to compare with
    WAITING = auto()  # not compared yet


class ViewLayer(Enum):
    """What the views draw besides the readings, and the legend can hide."""

    TRACE = auto()  # measured
    PREDICTED = auto()  # outline and trace
    THRESHOLD = auto()
    RAYS = auto()
    BEAM = auto()
    BLANKING = auto()


Class = Kind | Unclassed


@dataclass(frozen=True)
class Mark:
    """The mark of readings of one class, in every palette."""

    name: str
    symbol: str  # pyqtgraph's name
    meaning: str
    hint: str = ""  # a frequent cause, or what to make of such readings
    hollow: bool = False  # drawn as an outline


UNCLASSED = Mark("measured", "o", "measured, not compared with a prediction")
MARKS: dict[Class, Mark] = {
    Kind.MATCH: Mark(
        "match",
        "o",
        "measured and predicted range differ by at most 5 cm",
        "With several reflections it is a ghost echo: there is no wall at this range",
    ),
    Kind.SHORT: Mark(
        "short",
        "t",
        "measured range is shorter than predicted by more than 5 cm",
        "Often there is something in front of the wall that the room file lacks",
    ),
    Kind.LONG: Mark(
        "long",
        "t1",
        "measured range is longer than predicted by more than 5 cm",
        "Often the predicted echo is weaker in reality, so the board reports a later one",
    ),
    Kind.EXTRA: Mark(
        "extra",
        "s",
        "an echo was measured, none was predicted",
        "Often the room file lacks something there, or the board detects weaker echoes than its profile states",
    ),
    Kind.MISSED: Mark(
        "missed",
        "x",
        "an echo was predicted, none was measured; drawn at the predicted range",
        "Often the surface reflects less sound than assumed, or reflects it elsewhere",
    ),
    Kind.OWN_BODY: Mark(
        "own body",
        "d",
        "an echo of the carrier of the sensor, not of the room (own_body of the board)",
        "It counts neither for nor against the prediction",
    ),
    Unclassed.MEASURED: UNCLASSED,
    Unclassed.WAITING: Mark("waiting", "o", "measured, not compared with the prediction yet", hollow=True),
}


# the marks of scans that are drawn over the one shown, readable on both papers: colour, and pyqtgraph's symbol
OVERLAYS = (
    ("#8E6BD8", "h"),
    ("#1C9C9C", "d"),
    ("#A6761D", "p"),
    ("#D6336C", "s"),
    ("#5B8C2A", "t2"),
    ("#7787A5", "star"),
    ("#C04CC0", "t3"),
    ("#B0554A", "o"),
)


@dataclass(frozen=True)
class Palette:
    """The colours of all parts of the window."""

    name: str
    paper: str  # background of views
    ink: str  # text and axes in views
    faint: str  # disabled or outdated text
    window: str  # background of widgets
    button: str
    stripe: str  # alternate rows of a table
    tip_paper: str
    wall: str
    chosen: str  # selected reading: ring, rays, cursor
    beam: str  # opaque, because transparency takes time at every repaint
    blanking: str
    threshold: str
    tolerance: str  # the band within which measured and predicted match
    short: str
    missed: str
    warning_paper: str
    warning_ink: str
    measured: str = MEASURED
    predicted: str = PREDICTED
    long: str = LONG
    extra: str = EXTRA
    own_body: str = OWN_BODY
    highlight: str = "#0072B2"
    note_paper: str = "#F0E442"  # the same on both papers, as the sheets that it reminds of
    note_ink: str = "#4A4400"
    live: str = "#00694C"  # badges, with white text
    replay: str = "#7A4B00"
    idle: str = "#666666"
    grid_alpha: float = 0.15

    def of(self, kind: Class) -> str:
        """Return the colour of the readings of one class."""
        match kind:
            case Kind.SHORT:
                return self.short
            case Kind.LONG:
                return self.long
            case Kind.EXTRA:
                return self.extra
            case Kind.MISSED:
                return self.missed
            case Kind.OWN_BODY:
                return self.own_body
            case Unclassed.WAITING:
                return self.faint
        return self.measured


LIGHT = Palette(
    name="light",
    paper="#FFFFFF",
    ink="#222222",
    faint="#8C8C8C",
    window="#F3F3F1",
    button="#E9E9E6",
    stripe="#F4F4F2",
    tip_paper="#FFFFE8",
    wall=WALL,
    chosen="#000000",
    beam="#F7EFB2",
    blanking="#E4E4E4",
    threshold="#777777",
    tolerance="#EAF3F8",
    short=SHORT,
    missed=MISSED,
    warning_paper="#FFF1D6",
    warning_ink="#7A3E00",
)
DARK = Palette(
    name="dark",
    paper="#14171A",
    ink="#E6E6E6",
    faint="#85898D",
    window="#22262A",
    button="#30353A",
    stripe="#1B1F23",
    tip_paper="#30353A",
    wall="#A6A6A6",
    chosen="#FFFFFF",
    beam="#3B3719",
    blanking="#2B2F33",
    threshold="#9A9A9A",
    tolerance="#12293A",
    short="#CC79A7",
    missed=MISSED,
    warning_paper="#4A3408",
    warning_ink="#FFD98A",
    predicted="#2E97D8",
    measured="#EE6C1A",
    grid_alpha=0.22,
)


# The appearance of the window: palette, unit of length and text size, as a frozen `Look`.


_SMALLEST, _LARGEST = 0.7, 2.5  # text scale


class LengthUnit(Enum):
    """The unit of displayed lengths. All values are metres until they are displayed.

    The user chooses one of `UNITS`; the others are for residuals.
    """

    M = ("m", 1.0, 3)
    CM = ("cm", 100.0, 1)
    FT = ("ft", 1 / 0.3048, 2)
    MM = ("mm", 1000.0, 0)
    INCH = ("in", 1 / 0.0254, 2)

    def __init__(self, label: str, per_metre: float, decimals: int) -> None:
        self.label = label
        self.per_metre = per_metre
        self.decimals = decimals

    @property
    def small(self) -> "LengthUnit":
        """The unit of residuals beside ranges in this one: they are about a hundredth of a range."""
        return {LengthUnit.M: LengthUnit.MM, LengthUnit.FT: LengthUnit.INCH}.get(self, self)

    def of(self, metres: float) -> float:
        """Return a length in this unit."""
        return metres * self.per_metre

    def metres(self, length: float) -> float:
        """Convert a length in this unit to metres."""
        return length / self.per_metre

    def text(self, metres: float) -> str:
        """Return the text of a length with its unit."""
        return f"{self.of(metres):z.{self.decimals}f} {self.label}"

    def signed(self, metres: float) -> str:
        """Return the text of a residual with its sign, without the unit."""
        length = round(self.of(metres), self.decimals)
        return f"{length:+.{self.decimals}f}" if length else f"{0:.{self.decimals}f}"


UNITS = LengthUnit.M, LengthUnit.CM, LengthUnit.FT


@dataclass(frozen=True)
class Look:
    """Palette, unit and text size."""

    palette: Palette = LIGHT
    unit: LengthUnit = LengthUnit.M
    scale: float = 1.0  # text scale; 1 is the system's text size

    def scaled(self, scale: float) -> "Look":
        """Return the same look with another text scale, limited to readable sizes that fit the window."""
        return replace(self, scale=min(max(scale, _SMALLEST), _LARGEST))
