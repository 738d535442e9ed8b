"""Input and result of a fit, as frozen values."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any, Literal

from sonarhw_sim.board.profile import Board
from sonarhw_sim.predict.prediction import PredictionOptions
from sonarhw_sim.room.room import Place, Room

from sonarhw.errors import InputError, deviation_text, estimate_degrees, estimate_text, with_unit
from sonarhw.readings import FloatArray, Reading
from sonarhw_compare.fit.parameters import Parameter
from sonarhw_compare.fit.quantities import ROOM_TOLERANCE, WALL, BoardQuantity, Quantity
from sonarhw_compare.match import Summary

_CORRELATED = 0.5  # weaker correlations are not printed

WarningKind = Literal[
    "few explained",  # the fitted prediction explains few echoes of a scan
    "correction",  # another turn or unit of the readings would explain clearly more
    "several solutions",  # several solutions explain the data about equally well
    "underestimated",  # the standard deviations are too small: parameters can change together by far more
    "unconstrained",  # a parameter is about as uncertain as its prior
    "at bound",  # the value of a parameter is at one of its bounds
    "known together",  # two parameters are so strongly correlated that only a combination of both is known
    "mismatch",  # a value that was not free is off
    "many strays",  # many echoes match no path of the model
]


@dataclass(frozen=True)
class FitWarning:
    """A limit of a fit."""

    kind: WarningKind
    text: str  # the line that the command prints
    share: float | None = None  # of the echoes that are within 5 cm of the prediction, if these are few

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Mismatch:
    """A value of room or board that was not free, and that the scan shows to be off."""

    parameter: Parameter  # `expected`: the value of room or board
    shift: float  # from that value
    deviation: float  # standard deviation of the shift
    alternatives: tuple[str, ...] = ()  # other values that would explain nearly as much

    def __str__(self) -> str:
        also = f", or {' or '.join(self.alternatives)} instead" if self.alternatives else ""
        source = _source(self.parameter.quantity)
        return f"{_evidence(self)}{also}; correct the {source}, or free {self.parameter.name}"


def pose_text(parameters: Sequence[Parameter], pose: Sequence[float], best: Sequence[float]) -> str:
    """Return the values of a pose that differ from the best pose, as text; all values of the best one."""
    values = list(zip(parameters, pose, best, strict=True))
    changed = [(parameter, value, at_best) for parameter, value, at_best in values if value != at_best]
    return ", ".join(
        f"{parameter.name} {estimate_degrees(value, at_best, 1):.1f}°"
        if parameter.quantity.is_angle
        else f"{parameter.name} {value:z.3f}"
        for parameter, value, at_best in changed or values
    )


def _evidence(mismatch: Mismatch) -> str:
    parameter, quantity = mismatch.parameter, mismatch.parameter.quantity
    if quantity is WALL:
        side = "left" if mismatch.shift > 0 else "right"
        by = f"{abs(mismatch.shift) * 1000:.1f} ± {mismatch.deviation * 1000:.1f} mm"
        return f"the echoes put {parameter.name} {by} to the {side} of its line in the room file"
    present = parameter.expected or 0.0
    value, spread, stated = (
        f"{number * quantity.per_unit:.{quantity.digits}f}"
        for number in (present + mismatch.shift, mismatch.deviation, present)
    )
    unit = f" {quantity.unit}" if quantity.unit else ""
    return f"the echoes fit {parameter.name} {value} ± {spread}{unit}, while the {_source(quantity)} has {stated}"


def _source(quantity: Quantity) -> str:
    return "board profile" if isinstance(quantity, BoardQuantity) else "room file"


Progress = Callable[[float, str], None]  # completed share, 0..1, and name of the present step


@dataclass(frozen=True)
class PlacedScan:
    """A measured scan and its assumed place."""

    readings: Sequence[Reading]
    place: Place
    name: str = ""  # in the names of its parameters, and of its place in a fitted room
    file: str = ""  # its log

    @property
    def title(self) -> str:
        """The log of the scan, or else its name, for messages."""
        return self.file or self.name


@dataclass(frozen=True)
class FitOptions:
    """Settings of a fit."""

    prediction: PredictionOptions = field(default_factory=PredictionOptions)
    seed: int = 0  # of the sampler; the same seed gives the same result
    samples: int = 8000  # from the posterior, about 300 of them independent; 0: intervals from the curvature
    all_echoes: bool = True  # False: use the first echo of each reading only
    global_search: bool = True  # False: start at the given places, room and board
    room_tolerance: float = ROOM_TOLERANCE  # m, standard deviation of the position of each wall that is not free
    exact: bool = False  # True: all that is not free is exact: walls, reflectances, threshold, aperture, turntable


@dataclass(frozen=True)
class Estimate:
    """One fitted number, in the unit of its parameter (rad for a heading)."""

    value: float
    deviation: float  # standard deviation
    lower: float  # of the 95 % credible interval
    upper: float


@dataclass(frozen=True)
class Mode:
    """One of several solutions that explain the data about equally well."""

    values: dict[str, float]  # by parameter name
    score: float  # log-likelihood and prior, natural logarithm, relative to the best


@dataclass(frozen=True)
class FitResult:
    """The result of a fit."""

    parameters: tuple[Parameter, ...]
    estimates: dict[str, Estimate]  # by parameter name, in the order of `parameters`
    correlations: FloatArray  # (p, p), in that order
    noise: dict[str, float]  # fitted errors of the readings: range_m, level_db, missed, lost, stray_per_m, stretch
    warnings: tuple[FitWarning, ...]  # the most important first
    modes: tuple[Mode, ...]  # the best first
    room: Room  # fitted
    places: tuple[Place, ...]  # fitted, one for each scan
    board: Board  # fitted
    score: float  # log-likelihood and prior of the best solution, natural logarithm
    samples: FloatArray  # (m, p), from the posterior; m may be 0
    agreement: tuple[Summary, ...] = ()  # of each scan with the fitted prediction
    tolerated: dict[str, Estimate] = field(default_factory=dict)  # by name, of values neither free nor exact
    mismatches: tuple[Mismatch, ...] = ()  # clearest first

    @property
    def doubts(self) -> tuple[str, ...]:
        """The warnings as text."""
        return tuple(map(str, self.warnings))

    def lines(self) -> Iterator[str]:
        """Yield the table, the agreement, the noise and strong correlations as lines of text."""
        width = max(len(parameter.name) for parameter in self.parameters)
        yield f"{'':{width}}  {'value':>12}  {'±':>10}  95 % interval"
        for parameter in self.parameters:
            yield f"{parameter.name:{width}}  {self._row(parameter)}"
        yield ""
        shares = [
            f"{summary.within_5cm:.0%} of {summary.n_echo}"
            for summary in self.agreement
            if summary.within_5cm is not None
        ]
        yield f"{'; '.join(shares)} echoes within 5 cm of the fitted prediction"
        yield _noise_line(self.noise)
        names = list(self.estimates)
        for i, name in enumerate(names):
            for j in range(i):
                if abs(self.correlations[i, j]) >= _CORRELATED:
                    yield f"{names[j]} and {name} are correlated: {self.correlations[i, j]:+.2f}"

    def figures(self) -> dict[str, Any]:
        """Return the result under the keys of `fit --json`; headings in degrees."""
        return {
            "estimates": {one.name: {"unit": one.quantity.unit, **self._scaled(one)} for one in self.parameters},
            "correlations": self.correlations.tolist(),
            "noise": self.noise,
            "log_likelihood": self.score,
            "answers": [
                {
                    "log_likelihood": self.score + mode.score,
                    **{
                        parameter.name: mode.values[parameter.name] * parameter.quantity.per_unit
                        for parameter in self.parameters
                    },
                }
                for mode in self.modes
            ],
            "agreement": [
                {"n_echo": one.n_echo, "within_5cm": one.within_5cm, "explained": one.explained}
                for one in self.agreement
            ],
            "mismatches": [
                {
                    "name": mismatch.parameter.name,
                    "unit": mismatch.parameter.quantity.unit,
                    "stated": (mismatch.parameter.expected or 0.0) * mismatch.parameter.quantity.per_unit,
                    "shift": mismatch.shift * mismatch.parameter.quantity.per_unit,
                    "deviation": mismatch.deviation * mismatch.parameter.quantity.per_unit,
                    "or": list(mismatch.alternatives),
                }
                for mismatch in self.mismatches
            ],
            "warnings": list(self.doubts),
        }

    def _row(self, parameter: Parameter) -> str:
        shown, unit = self._scaled(parameter), parameter.quantity.unit
        deviation = shown["deviation"]
        value, lower, upper = (estimate_text(shown[key], deviation) for key in ("value", "lower", "upper"))
        return f"{with_unit(value, unit):>12}  {deviation_text(deviation, unit):>10}  {lower} to {upper}"

    def _scaled(self, parameter: Parameter) -> dict[str, float]:
        """Return an estimate in the unit in which it is printed."""
        estimate, per_unit = self.estimates[parameter.name], parameter.quantity.per_unit
        return {key: getattr(estimate, key) * per_unit for key in ("value", "deviation", "lower", "upper")}


def _noise_line(noise: dict[str, float]) -> str:
    # the stretch is not estimated if temperature or speed of sound is free
    stretch = f"; ranges {noise['stretch'] - 1:+z.2%} from the speed of sound" if "stretch" in noise else ""
    return (
        f"errors of readings {noise['range_m'] * 1000:.1f} mm, of levels {noise['level_db']:.1f} dB; "
        f"{noise['missed']:.0%} of loud echoes missed, {noise['lost']:.0%} of pings lost, "
        f"{noise['stray_per_m']:.2f} stray echoes a metre{stretch}"
    )


# Check for recordings that are given twice. They would count as independent, and intervals would be too narrow.


def check_given_once(scans: Sequence[PlacedScan]) -> None:
    """Raise InputError if two scans have the same readings, or one starts with those of the other (a torn copy).

    Different scans from the same place are allowed.
    """
    for scan, other in combinations(scans, 2):
        alike = (_same(earlier, later) for earlier, later in zip(scan.readings, other.readings, strict=False))
        if scan.readings and other.readings and all(alike):
            names = f"{scan.title or 'one scan'} and {other.title or 'another'}"
            raise InputError(f"{names} contain the same readings; give each log once")


def _same(reading: Reading, other: Reading) -> bool:
    """Report whether two readings are equal apart from their traces, which are arrays."""
    return replace(reading, trace=None) == replace(other, trace=None)
