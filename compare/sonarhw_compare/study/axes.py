"""Axes of a study: the values of a key of `[vary]`.

A value or a list becomes a `Listed` grid axis. A distribution becomes a `Drawn` axis with one value for each draw.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any
from zlib import crc32

import numpy as np
from pydantic import AfterValidator

Value = bool | int | float | str

FARTHEST = 3.0  # standard deviations; a normal draw farther from the mean is repeated
_EXPECTED = "expected a value, a list of values, { uniform = [low, high] } or { normal = [mean, deviation] }"


@dataclass(frozen=True)
class Listed:
    """A grid axis; a constant has one value."""

    values: tuple[Value, ...]

    @property
    def extremes(self) -> tuple[Value, ...]:
        """The values to validate."""
        return self.values


@dataclass(frozen=True)
class Drawn:
    """A random value for each draw."""

    kind: str  # uniform or normal
    first: float  # low, or mean
    second: float  # high, or standard deviation

    @property
    def extremes(self) -> tuple[Value, ...]:
        """The lowest and highest possible value."""
        if self.kind == "uniform":
            return self.first, self.second
        return self.first - FARTHEST * self.second, self.first + FARTHEST * self.second

    def value(self, random: np.random.Generator) -> float:
        """Draw one value."""
        if self.kind == "uniform":
            return float(random.uniform(self.first, self.second))
        drawn = float(random.normal())
        while abs(drawn) > FARTHEST:
            drawn = float(random.normal())
        return self.first + self.second * drawn


Axis = Listed | Drawn


def read_axis(written: object) -> Axis:
    """Return the axis of a key. Raises ValueError with the expected form."""
    if isinstance(written, Value):
        return Listed((written,))
    if isinstance(written, tuple) and written and all(isinstance(value, Value) for value in written):
        if len(set(written)) < len(written):
            raise ValueError(f"expected different values, got {list(written)}")
        return Listed(_of_one_kind(written))
    if isinstance(written, Mapping) and len(written) == 1:
        ((kind, numbers),) = written.items()
        if kind in ("uniform", "normal") and isinstance(numbers, tuple) and len(numbers) == 2:
            return _drawn(kind, *numbers)
    raise ValueError(f"{_EXPECTED}, got {_as_written(written)!r}")


def _of_one_kind(values: tuple[Value, ...]) -> tuple[Value, ...]:
    """Return the values with one type for a column; integers among floats become floats."""
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
    """Return a value with lists instead of tuples, as in the file."""
    if isinstance(value, tuple):
        return list(value)
    return {key: _as_written(part) for key, part in value.items()} if isinstance(value, Mapping) else value


WrittenAxis = Annotated[Any, AfterValidator(read_axis)]


def random_of(seed: int, draw: int, key: str) -> np.random.Generator:
    """Return the random numbers of `key` in a draw. They depend on these three values only."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(draw, crc32(key.encode()))))
