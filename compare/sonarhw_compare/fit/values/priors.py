"""Priors of a fit in text: `temperature=21+-1` (normal), `x=0.2..1.4` (bounds), in the units of `--prior`."""

import math
import re
from collections.abc import Sequence
from dataclasses import replace

from sonarhw.errors import InputError
from sonarhw_compare.fit.values.parameters import Parameter, quantities_of

_NUMBER = r"([-+]?\d*\.?\d+(?:[eE][-+]?\d+)?)"

_MOST = 1e6  # of a number, in the unit of --prior
_LEAST = 1e-6  # of a deviation


def check_words(words: Sequence[str], priors: Sequence[str]) -> None:
    """Raise InputError for errors in the free words and in the priors, before a log is read."""
    free = [quantity.name for word in words for quantity in quantities_of(word)]
    for prior in priors:
        name, _, text = prior.partition("=")
        if free and re.split("[:@]", name)[0] not in free:
            listed = ", ".join(free)
            raise InputError(f"prior {prior}: {name} is not free; free it too, or use one of {listed}")
        if _range_of(text) is None and _normal_of(text) is None:
            raise _malformed_prior(prior)


def with_priors(parameters: Sequence[Parameter], priors: Sequence[str]) -> tuple[Parameter, ...]:
    """Return the parameters with their priors. Raises InputError for an unknown name or an invalid prior."""
    found = list(parameters)
    for prior in priors:
        name, _, text = prior.partition("=")
        rows = [k for k, parameter in enumerate(found) if name in (parameter.name, parameter.quantity.name)]
        if not rows:
            known = ", ".join(parameter.name for parameter in parameters)
            raise InputError(f"prior {prior}: expected NAME=… with a free quantity: {known}")
        for k in rows:
            found[k] = _with_prior(found[k], prior, text)
    return tuple(found)


def _with_prior(parameter: Parameter, prior: str, text: str) -> Parameter:
    unit = 1 / parameter.quantity.per_unit
    if bounds := _range_of(text):
        return replace(parameter, lower=bounds[0] * unit, upper=bounds[1] * unit)
    if normal := _normal_of(text):
        value, deviation = normal[0] * unit, normal[1] * unit
        if normal[1] >= _LEAST and parameter.lower <= value <= parameter.upper:
            return replace(parameter, expected=value, deviation=deviation)
        bounded = math.isfinite(parameter.lower) and math.isfinite(parameter.upper)
        where = f" and a value from {parameter.lower / unit:g} to {parameter.upper / unit:g}" if bounded else ""
        raise InputError(f"prior {prior}: expected a deviation of at least {_LEAST:g}{where}")
    raise _malformed_prior(prior)


def _range_of(text: str) -> tuple[float, float] | None:
    match = re.fullmatch(rf"{_NUMBER}\s*\.\.\s*{_NUMBER}", text)
    if match is None or not -_MOST <= float(match[1]) < float(match[2]) <= _MOST:
        return None
    return float(match[1]), float(match[2])


def _normal_of(text: str) -> tuple[float, float] | None:
    match = re.fullmatch(rf"{_NUMBER}\s*(?:\+-|±)\s*{_NUMBER}", text)
    if match is None or not (abs(float(match[1])) <= _MOST and float(match[2]) <= _MOST):
        return None
    return float(match[1]), float(match[2])


def _malformed_prior(prior: str) -> InputError:
    return InputError(
        f"prior {prior}: expected NAME=VALUE+-DEVIATION, or NAME=LOW..HIGH with LOW below HIGH, "
        f"and numbers from -{_MOST:g} to {_MOST:g}"
    )
