"""Checks of the arguments of public functions, and warnings about them.

A check receives the name of an argument and its value. It returns the value that the function uses, or raises
InputError with a line that names the argument, what was expected and what was given. `checked` applies checks before
the function begins.
"""

import inspect
import math
import numbers
import os
import sys
import warnings
from collections.abc import Callable
from enum import Enum
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from sonarhw.errors import InputError, counted, shortened, smaller_unit

Check = Callable[[str, Any], Any]  # receives name and value of an argument, and returns the value to use

_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")

_FEW = 20  # elements that are shown
_MOST_SHOWN = 60  # characters of a value in a message
_MOST_ANGLE = 1e6  # rad; far beyond, rounding turns a heading
_LARGE_ANGLE = 10.0  # rad; headings of a turn in degrees are larger
_FARTHEST = 30.0  # m; no sonar in air has echoes from so far
_USUAL = 11.0  # m, the longest usual range


def checked(**checks: Check) -> Callable[[Callable[_Parameters, _Result]], Callable[_Parameters, _Result]]:
    """Return a decorator that applies these checks, by name of the argument, before the function begins.

    A default value is not checked. Arguments with wrong names or of a wrong number remain a TypeError.
    """

    def decorate(function: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]:
        signature = inspect.signature(function)
        defaults = {name: parameter.default for name, parameter in signature.parameters.items()}

        @wraps(function)
        def door(*values: _Parameters.args, **named: _Parameters.kwargs) -> _Result:
            bound = signature.bind(*values, **named)
            for name, value in bound.arguments.items():
                if name in checks and value is not defaults[name]:
                    bound.arguments[name] = checks[name](name, value)
            return function(*bound.args, **bound.kwargs)

        return door

    return decorate


def refusal(name: str, expected: str, value: object) -> InputError:
    """Return the error for an argument with an unexpected value."""
    return InputError(f"{name}: expected {expected}, got {described(value)}")


def described(value: object) -> str:
    """Return a value as a message shows it: short, on one line, with the shape and type of an array."""
    if value is None or isinstance(value, str | bytes | numbers.Number):
        return shortened(repr(value), _MOST_SHOWN)
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and type {value.dtype}"
    if isinstance(value, list | tuple) and all(isinstance(part, str | numbers.Number) for part in value[:_FEW]):
        return shortened(repr(value), _MOST_SHOWN)
    if isinstance(value, list | tuple | dict | set):
        return f"{type(value).__name__} of {counted(len(value), 'element')}"
    return f"{value.__name__}, a class" if isinstance(value, type) else f"an object of type {type(value).__name__}"


# single values


def number(least: float = -math.inf, most: float = math.inf, unit: str = "") -> Check:
    """Return the check for a finite number, as a float."""
    expected = f"a finite number{f' ({unit})' if unit else ''}{_limits(least, most)}"

    def check(name: str, value: Any) -> float:
        plain = value.item() if isinstance(value, np.ndarray | np.generic) and value.ndim == 0 else value
        if isinstance(plain, bool) or not isinstance(plain, numbers.Real):
            raise refusal(name, expected, value)
        try:
            read = float(plain)
        except OverflowError:
            read = math.inf
        if not math.isfinite(read) or not least <= read <= most:
            raise refusal(name, expected, value)
        return read

    return check


def whole(least: int, most: int | None = None) -> Check:
    """Return the check for a whole number, as an int."""
    expected = f"a whole number{_limits(least, math.inf if most is None else most)}"

    def check(name: str, value: Any) -> int:
        plain = value.item() if isinstance(value, np.ndarray | np.generic) and value.ndim == 0 else value
        if isinstance(plain, bool) or not isinstance(plain, int):
            raise refusal(name, expected, value)
        if plain < least or (most is not None and plain > most):
            raise refusal(name, expected, value)
        return plain

    return check


def _limits(least: float, most: float) -> str:
    if math.isfinite(least) and math.isfinite(most):
        return f" from {least:g} to {most:g}"
    if math.isfinite(least):
        return f", {least:g} or more"
    return f", {most:g} or less" if math.isfinite(most) else ""


def choice(kind: type[Enum], or_none: bool = False) -> Check:
    """Return the check for a member of an enumeration, or its value; with `or_none` also None."""
    expected = ", ".join([*(repr(member.value) for member in kind), *(["None"] if or_none else [])])

    def check(name: str, value: Any) -> Enum | None:
        if isinstance(value, kind) or (or_none and value is None):
            return value
        for member in kind:
            if isinstance(value, str) and value == member.value:
                return member
        raise refusal(name, f"one of {expected}", value)

    return check


def instance(kinds: type | tuple[type, ...], expected: str) -> Check:
    """Return the check for an object of these types."""

    def check(name: str, value: Any) -> Any:
        if not isinstance(value, kinds):
            raise refusal(name, expected, value)
        return value

    return check


def instances(kind: type, expected: str) -> Check:
    """Return the check for a sequence of objects of a type."""

    def check(name: str, value: Any) -> Any:
        if not isinstance(value, list | tuple) or not all(isinstance(part, kind) for part in value):
            raise refusal(name, expected, value)
        return value

    return check


def flag(name: str, value: Any) -> bool:
    """Check a bool."""
    if not isinstance(value, bool | np.bool_):
        raise refusal(name, "True or False", value)
    return bool(value)


def function(name: str, value: Any) -> Any:
    """Check a function."""
    if not callable(value):
        raise refusal(name, "a function", value)
    return value


text = instance(str, "a text")
file_name = instance((str, os.PathLike), "the name of a file")


def words(name: str, value: Any) -> Any:
    """Check names between commas, or a sequence of names."""
    if isinstance(value, str):
        return value
    try:
        names = [*value]
    except TypeError:
        raise refusal(name, "names between commas, or a list of names", value) from None
    for part in names:
        if not isinstance(part, str):
            raise refusal(name, "a list of names", part)
    return names


# arrays


def numbers_in(name: str, value: Any, expected: str) -> NDArray[np.float64]:
    """Return numbers as an array of floats of the same shape; None and masked elements are NaN. Raises InputError."""
    masked = isinstance(value, np.ma.MaskedArray)
    try:
        array = np.asarray(np.ma.getdata(value) if masked else value)
        if array.dtype.kind == "O":  # None among numbers, or numbers of other libraries
            array = np.array([_float(part) for part in array.ravel()], dtype=np.float64).reshape(array.shape)
    except (TypeError, ValueError, OverflowError):  # ValueError: rows of several lengths
        raise refusal(name, expected, value) from None
    if array.dtype.kind not in "iuf" and array.size:
        raise refusal(name, expected, array if array.ndim else value)
    floats = np.array(array, dtype=np.float64)
    if masked:
        floats[np.ma.getmaskarray(value)] = np.nan
    return floats


def _float(part: Any) -> float:
    if part is None:
        return math.nan
    if isinstance(part, bool | str | bytes) or (not isinstance(part, numbers.Real | np.generic) and np.ndim(part)):
        raise TypeError(type(part).__name__)
    return float(part)


def angles(name: str, value: Any) -> NDArray[np.float64]:
    """Return finite angles in rad, (n,) float; one number is an array of one. Raises InputError."""
    expected = "angles in radians, one or (n,)"
    read = numbers_in(name, value, expected)
    if read.ndim > 1:
        raise refusal(name, expected, read)
    read = np.atleast_1d(read)
    if not (np.abs(read) <= _MOST_ANGLE).all():
        row = int(np.flatnonzero(~(np.abs(read) <= _MOST_ANGLE))[0])
        raise InputError(f"{name}: expected finite angles in radians, got {read[row]:g} at index {row}")
    return read


def rows(name: str, value: Any, columns: tuple[int, ...], what: str) -> NDArray[np.float64]:
    """Return finite numbers, (n, c) float, with one of these numbers of columns; one row may be (c,)."""
    expected = f"{what}, (n, {' or '.join(map(str, columns))})"
    read = numbers_in(name, value, expected)
    if read.ndim == 1 and len(read) in columns:
        read = read[None]
    if not read.size and read.ndim <= 2:
        return np.empty((0, columns[-1]))
    if read.ndim != 2 or read.shape[1] not in columns:
        raise refusal(name, expected, read)
    if not np.isfinite(read).all():
        row = int(np.flatnonzero(~np.isfinite(read).all(axis=1))[0])
        raise InputError(f"{name}: expected finite numbers, got {read[row].tolist()} in row {row}")
    return read


# units that are probably wrong


Warn = Callable[[str], None]  # receives a warning


def emit(message: str) -> None:
    """Emit a Python warning at the line that called these packages."""
    depth, frame = 2, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").startswith("sonarhw"):
        depth, frame = depth + 1, frame.f_back
    warnings.warn(message, stacklevel=depth)


def in_radians(name: str, read: NDArray[np.float64], degrees: bool) -> NDArray[np.float64]:
    """Return angles in rad that are given in rad, or in degrees. Warns if those in rad are probably degrees."""
    if degrees:
        return np.radians(read)
    warn_of_degrees(name, read)
    return read


def are_degrees(radians: NDArray[np.float64]) -> bool:
    """Return whether angles are probably in degrees: some over 10, and all of them multiples of half a degree."""
    largest = float(np.abs(radians).max(initial=0.0))
    return largest > _LARGE_ANGLE and np.allclose(np.round(2 * radians), 2 * radians, 0, 1e-5)


def warn_of_degrees(name: str, radians: NDArray[np.float64], warn: Warn = emit) -> None:
    """Warn if angles are probably in degrees."""
    if are_degrees(radians):
        largest = float(np.abs(radians).max())
        warn(f"{name}: up to {largest:g}, taken as radians; if they are degrees, use np.radians")


def warn_of_centimetres(name: str, metres: NDArray[np.float64], warn: Warn = emit) -> bool:
    """Warn if ranges are probably in centimetres or millimetres: half of them are over 30. Return whether they are."""
    known = metres[np.isfinite(metres)]
    doubtful = bool(len(known)) and float(np.median(known)) > _FARTHEST
    if doubtful:
        unit, count = smaller_unit(float(np.median(known)), _USUAL)
        warn(f"{name}: half of them over {_FARTHEST:g} m; if they are {unit}, divide them by {count}")
    return doubtful
