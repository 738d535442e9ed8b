"""The warnings of a fit as values. `str` of a warning is the line that the command prints."""

from collections.abc import Sequence
from dataclasses import dataclass

from sonarhw_compare.fit.values.parameters import Parameter
from sonarhw_compare.fit.values.quantities import WALL, BoardQuantity, Quantity
from sonarhw_compare.headings import estimate_degrees
from sonarhw_compare.matching.few_explained import few_explained_line


@dataclass(frozen=True)
class FewExplained:
    """The fitted prediction explains few echoes of a scan."""

    scan: str
    share: float  # of the echoes, within 5 cm of the prediction
    echoes: int

    def __str__(self) -> str:
        return few_explained_line(self.scan, self.share, self.echoes)


@dataclass(frozen=True)
class SeveralSolutions:
    """Several solutions explain the data about equally well."""

    parameters: tuple[Parameter, ...]  # of a pose
    poses: tuple[tuple[float, ...], ...]  # values of these parameters, the best first

    def __str__(self) -> str:
        found = f"{len(self.poses)} solutions explain the scan about equally well, the room may be symmetric"
        texts = (pose_text(self.parameters, pose, self.poses[0]) for pose in self.poses)
        return f"{found}: {'; '.join(texts)}"


@dataclass(frozen=True)
class Underestimated:
    """The standard deviations are too small: these parameters can change together by far more."""

    parameters: tuple[Parameter, ...]

    def __str__(self) -> str:
        several = ", ".join(one.name for one in self.parameters)
        return f"± cannot be trusted: {several} can change together by far more; fix one of them, or give a prior"


@dataclass(frozen=True)
class Unconstrained:
    """A parameter is about as uncertain as its prior."""

    parameter: Parameter

    def __str__(self) -> str:
        return f"the scan hardly constrains {self.parameter.name}: ± is as wide as the prior"


@dataclass(frozen=True)
class AtBound:
    """The value of a parameter is at one of its bounds."""

    parameter: Parameter
    bound: float  # in the unit of the parameter

    def __str__(self) -> str:
        return f"{self.parameter.name} is at its bound, {self.bound:g} {self.parameter.quantity.unit}".rstrip()


@dataclass(frozen=True)
class KnownTogether:
    """Two parameters are so strongly correlated that only a combination of both is known."""

    names: tuple[str, str]
    correlation: float  # -1..1

    def __str__(self) -> str:
        return f"{' and '.join(self.names)} are only known together (correlation {self.correlation:+.2f})"


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


@dataclass(frozen=True)
class ManyStrays:
    """Many echoes match no path of the model, as `FitResult.noise` says."""

    def __str__(self) -> str:
        return "many echoes match no path of the model; an object may be missing in the room file"


FitWarning = (
    FewExplained | SeveralSolutions | Underestimated | Unconstrained | AtBound | KnownTogether | Mismatch | ManyStrays
)


def pose_text(parameters: Sequence[Parameter], pose: Sequence[float], best: Sequence[float]) -> str:
    """Return the values of a pose that differ from the best pose, as text; all values of the best one."""
    values = list(zip(parameters, pose, best, strict=True))
    changed = [(one, value, at_best) for one, value, at_best in values if value != at_best]
    return ", ".join(
        f"{one.name} {estimate_degrees(value, at_best, 1):.1f}°"
        if one.quantity.is_angle
        else f"{one.name} {value:z.3f}"
        for one, value, at_best in changed or values
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
