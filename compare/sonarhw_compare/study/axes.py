"""Axes of a study: what a key of `[vary]` may say, and which value it has where.

Takes a value, a list of values, or a way to draw one; hands on `Listed`, over whose values the study runs as a grid, or
`Drawn`, of which every draw has a value of its own.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any
from zlib import crc32

import numpy as np
from pydantic import AfterValidator

Value = bool | int | float | str

FARTHEST = 3.0  # standard deviations from its mean at which a normal draw is taken anew
_EXPECTED = "expected a value, a list of values, { uniform = [low, high] } or { normal = [mean, deviation] }"


@dataclass(frozen=True)
class Listed:
    """A grid axis; with one value, what does not vary."""

    values: tuple[Value, ...]

    @property
    def extremes(self) -> tuple[Value, ...]:
        """The values that have to be allowed."""
        return self.values


@dataclass(frozen=True)
class Drawn:
    """What is drawn at random, once for each draw."""

    kind: str  # uniform or normal
    first: float  # low, or mean
    second: float  # high, or standard deviation

    @property
    def extremes(self) -> tuple[Value, ...]:
        """The values between which all draws lie."""
        if self.kind == "uniform":
            return self.first, self.second
        return self.first - FARTHEST * self.second, self.first + FARTHEST * self.second

    def value(self, random: np.random.Generator) -> float:
        """One draw."""
        if self.kind == "uniform":
            return float(random.uniform(self.first, self.second))
        drawn = float(random.normal())
        while abs(drawn) > FARTHEST:
            drawn = float(random.normal())
        return self.first + self.second * drawn


Axis = Listed | Drawn


def read_axis(written: object) -> Axis:
    """The axis that a key says. Raises ValueError with what was expected."""
    if isinstance(written, Value):
        return Listed((written,))
    if isinstance(written, tuple) and written and all(isinstance(value, Value) for value in written):
        if len(set(written)) < len(written):
            raise ValueError(f"expected every value once, got {list(written)}")
        return Listed(_of_one_kind(written))
    if isinstance(written, Mapping) and len(written) == 1:
        ((kind, numbers),) = written.items()
        if kind in ("uniform", "normal") and isinstance(numbers, tuple) and len(numbers) == 2:
            return _drawn(kind, *numbers)
    raise ValueError(f"{_EXPECTED}, got {_as_written(written)!r}")


def _of_one_kind(values: tuple[Value, ...]) -> tuple[Value, ...]:
    """The values as one column takes them: among fractions, whole numbers are fractions, too."""
    kinds = {type(value) for value in values}
    if kinds == {int, float}:
        return tuple(float(value) for value in values)
    if len(kinds) > 1:
        raise ValueError(f"expected values of one kind, got {list(values)}")
    return values


def _drawn(kind: str, first: object, second: object) -> Drawn:
    for number in (first, second):
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise ValueError(f"{_EXPECTED}, got {number!r} in {kind}")
    drawn = Drawn(kind, float(first), float(second))  # type: ignore[arg-type]
    if kind == "uniform" and drawn.first >= drawn.second:
        raise ValueError(f"expected uniform = [low, high] with low below high, got {[first, second]}")
    if kind == "normal" and drawn.second <= 0:
        raise ValueError(f"expected normal = [mean, deviation] with a deviation over 0, got {[first, second]}")
    return drawn


def _as_written(value: object) -> object:
    """A value with its lists as a file has them."""
    if isinstance(value, tuple):
        return list(value)
    return {key: _as_written(part) for key, part in value.items()} if isinstance(value, Mapping) else value


WrittenAxis = Annotated[Any, AfterValidator(read_axis)]


def random_of(seed: int, draw: int, key: str) -> np.random.Generator:
    """The random numbers for `key` in a draw: a function of these three, never of what was drawn before."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(draw, crc32(key.encode()))))
