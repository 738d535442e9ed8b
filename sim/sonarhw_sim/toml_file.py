"""Reading TOML files and checking them against a model; an error is one line that names the file and the key."""

import tomllib
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from sonarhw.errors import InputError


class TomlModel(BaseModel):
    """Base of the models of files: unknown keys, NaN, and text instead of a number are errors."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


Model = TypeVar("Model", bound=TomlModel)


def parse_toml(text: str, where: str, model: type[Model]) -> Model:
    """Return the checked content of a file. Raises InputError with `where`, the line or key, and what is expected."""
    return checked(parse_table(text, where), where, model)


def parse_table(text: str, where: str) -> dict[str, Any]:
    """Return the content of a file, unchecked. Raises InputError with `where` and the line."""
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{where}: not TOML: {error}") from error


def checked(values: dict[str, Any], where: str, model: type[Model]) -> Model:
    """Return the values of a file as its model. Raises InputError with `where`, the key, and what is expected."""
    try:
        return model.model_validate(_arrays_as_tuples(values))
    except ValidationError as error:
        # an unknown key comes first: it is often the misspelt form of a key that is then reported as missing
        first = min(error.errors(), key=lambda one: one["type"] != "extra_forbidden")
        more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
        key = f"{_key(first['loc'])}: " if first["loc"] else ""
        raise InputError(f"{where}: {key}{_reason(first)}{more}") from error


def read_text(path: Path, what: str) -> str:
    """Return the text of a file. Raises InputError if it is missing, unreadable or not UTF-8."""
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; give the name of a {what} (*.toml)") from error
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text"
        raise InputError(f"{path}: cannot be read as a {what}: {reason}") from error


def _arrays_as_tuples(value: object) -> object:
    # a strict model accepts no list for a tuple, and frozen models contain tuples
    if isinstance(value, list):
        return tuple(_arrays_as_tuples(item) for item in value)
    if isinstance(value, dict):
        return {key: _arrays_as_tuples(item) for key, item in value.items()}
    return value


def _key(location: tuple[int | str, ...]) -> str:
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    return key.removeprefix(".")


def _reason(error: object) -> str:
    assert isinstance(error, dict)
    kind, message, got = error["type"], error["msg"], error["input"]
    if kind == "extra_forbidden":
        return "unknown key; check its spelling"
    if kind == "missing":
        return "missing; it is required"
    if kind == "too_short":
        return f"expected at least {error['ctx']['min_length']} of them, got {error['ctx']['actual_length']}"
    if kind == "too_long":
        return f"expected {error['ctx']['max_length']} of them, got {error['ctx']['actual_length']}"
    if kind == "string_pattern_mismatch":
        return f"expected a name without > and /, which join names, got {got!r}"
    message = message.removeprefix("Value error, ").replace("Input should be", "expected")
    message = message.replace("a valid tuple", "a list of numbers").replace("a valid boolean", "true or false")
    return message if isinstance(got, dict | tuple) else f"{message}, got {got!r}"
