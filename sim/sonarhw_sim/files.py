"""TOML files: included and own ones by name, checked against a model; an error is one line that names file and key."""

import codecs
import errno
import operator
import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo

from sonarhw.errors import InputError, did_you_mean, near_misses
from sonarhw.files import open_input

# TOML files, checked against a model; an error is one line that names the file and the key


MOST_BYTES = 16 * 2**20  # of a file; a room of 100 000 walls has about 10 MB
MOST_DOTS = 100  # in one key; tomllib takes quadratic time for them
_MOST_QUOTED = 80  # characters
_MOST_IN_OTHER_UNIT = 1e9
_LEAST_PERCENT = 5
_LOG_MAGIC = b"\x89MCAP0\r\n"
_OTHER_UNITS = {"Hz": (1000, "kHz"), "m": (0.001, "mm"), "s": (0.001, "ms")}  # that people write by mistake
_PART = r"""(?:"[^"\n]*+"|'[^'\n]*+'|[\w-]++)[ \t]*+\.[ \t]*+"""
_DOTTED = re.compile(rf"(?<![\w-])(?:{_PART}){{{MOST_DOTS}}}")  # possessive, so that the search is linear
_WITHIN = {"ge": operator.ge, "gt": operator.gt, "le": operator.le, "lt": operator.lt}
_PLACE = re.compile(r"\(at line (\d+), column \d+\)$")
_DECIMAL_COMMA = re.compile(r"= *[+-]?\d+,\d")
_POINT_ADVICE = "; write numbers with a point, such as 0.95"
# what is missing, by the begin of the parser's message, which states the next line
_MISSING = {
    "Unclosed array": "; a ] is missing before it",
    "Unclosed inline table": "; a } is missing",
    "Illegal character '\\n'": "; a quotation mark is missing at the end",
}
_BARE = re.compile(r"[A-Za-z0-9_-]+")


class TomlModel(BaseModel):
    """Base of the models of files: unknown keys, NaN, and text instead of a number are errors."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


Model = TypeVar("Model", bound=TomlModel)


def about(meaning: str, unit: str = "") -> Any:
    """Return the description of a key, for the reference page, the JSON Schema and errors. Put it into `Annotated`."""
    return Field(description=meaning, json_schema_extra={"unit": unit} if unit else None)


def parse_toml(text: str, where: str, model: type[Model]) -> Model:
    """Return the checked content of a file. Raises InputError with `where`, the line or key, and what is expected."""
    return checked(parse_table(text, where), where, model)


def parse_table(text: str, where: str) -> dict[str, Any]:
    """Return the content of a file, unchecked. Raises InputError with `where` and the line."""
    if dotted := _DOTTED.search(text):
        line = text.count("\n", 0, dotted.start()) + 1
        raise InputError(f"{where}: line {line}: a key has more than {MOST_DOTS} parts; expected at most five")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{where}: not TOML: {error}{_line_of(error, text)}") from error
    except ValueError as error:  # Python reads no decimal number of more than 4300 digits
        raise InputError(f"{where}: a number has too many digits; expected an ordinary number") from error
    except RecursionError as error:
        raise InputError(f"{where}: lists or tables are nested too deeply; expected at most three levels") from error


def _line_of(error: tomllib.TOMLDecodeError, text: str) -> str:
    """Return the line of the error, except at the end of the file, and what is missing or wrong there."""
    place = _PLACE.search(str(error))
    advice = next((what for start, what in _MISSING.items() if str(error).startswith(start)), "")
    if place is None:
        return advice
    line = text.split("\n")[int(place[1]) - 1].strip()
    return f": {quoted(line)}{_POINT_ADVICE if _DECIMAL_COMMA.search(line) else advice}"


def checked(values: dict[str, Any], where: str, model: type[Model]) -> Model:
    """Return the values of a file as its model. Raises InputError with `where`, the key, and what is expected."""
    problems, count = [], 0
    try:
        return model.model_validate(_arrays_as_tuples(values))
    except ValidationError as error:
        problems, count = _problems(error, model), error.error_count()
    except RecursionError as error:
        raise InputError(f"{where}: lists or tables are nested too deeply; expected at most three levels") from error
    more = f" (and {count - 1} more)" if count > 1 else ""
    raise InputError(f"{where}: {problems[0]}{more}")


def problems_of(values: dict[str, Any], model: type[Model]) -> list[str]:
    """Return a line for each error in the values of a file: the key, what was found and what is expected."""
    try:
        model.model_validate(_arrays_as_tuples(values))
    except ValidationError as error:
        return _problems(error, model)
    return []


def json_schema(model: type[TomlModel]) -> dict[str, Any]:
    """Return the JSON Schema (draft 7) of a model, for editors. It has no rules that connect several keys."""
    return {"$schema": "http://json-schema.org/draft-07/schema#", **_as_draft_7(model.model_json_schema())}


def _as_draft_7(schema: Any) -> Any:
    if isinstance(schema, list):
        return [_as_draft_7(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    # prefixItems is newer; the only tuples here are pairs of equal items
    renamed = {("items" if key == "prefixItems" else key): value for key, value in schema.items()}
    if "prefixItems" in schema:
        renamed["items"] = schema["prefixItems"][0]
    return {key: _as_draft_7(value) for key, value in renamed.items()}


def _problems(error: ValidationError, model: type[TomlModel]) -> list[str]:
    # an unknown key comes first: it is often the misspelt form of a key that is then reported as missing
    details = sorted(error.errors(include_url=False), key=lambda detail: detail["type"] != "extra_forbidden")
    return [": ".join(filter(None, (_key(detail["loc"]), _reason(detail, model)))) for detail in details]


def read_text(path: Path, what: str) -> str:
    """Return the text of a file. Raises InputError if it is missing, unreadable, too large or not UTF-8."""
    try:
        with open_input(path, MOST_BYTES, pipes=True) as file:
            content = file.read(MOST_BYTES + 1)
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file; give the name of a {what} (*.toml)") from error
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        if isinstance(error, OSError) and error.errno == errno.EFBIG:
            raise _too_large(path, what) from error
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"{path}: cannot be read as a {what}: {reason}") from error
    if len(content) > MOST_BYTES:  # it has grown, or it is a pipe
        raise _too_large(path, what)
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        if b"\0" in content and not content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            kind = "a log" if content.startswith(_LOG_MAGIC) else "not a text file"
            raise InputError(f"{path}: is {kind}; expected a {what}, whose name ends in .toml") from error
        line = content.count(b"\n", 0, error.start) + 1
        byte = f"byte 0x{content[error.start]:02x} in line {line}"
        raise InputError(
            f"{path}: cannot be read as a {what}: not UTF-8 text ({byte}); save the file as UTF-8"
        ) from error


def _too_large(path: Path, what: str) -> InputError:
    return InputError(f"{path}: is larger than {MOST_BYTES / 2**20:g} MiB; expected a {what}, which is small")


def quoted(value: object) -> str:
    """Return a value of a file as an error shows it: on one line, without control characters, and not long."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # Python prints no integer of more than 4300 digits
        return "a huge number" if isinstance(value, int) else "a value that is too large to print"
    return text if len(text) <= _MOST_QUOTED else f"{text[:_MOST_QUOTED]}…"


def _arrays_as_tuples(value: object) -> object:
    # a strict model accepts no list for a tuple, and frozen models contain tuples
    if isinstance(value, list):
        return tuple(_arrays_as_tuples(item) for item in value)
    if isinstance(value, dict):
        return {key: _arrays_as_tuples(item) for key, item in value.items()}
    return value


def _key(location: Sequence[int | str]) -> str:
    key = "".join(f"[{part}]" if isinstance(part, int) else f".{_part(part)}" for part in location if part != "[key]")
    return key.removeprefix(".")


def _part(name: str) -> str:
    return name if _BARE.fullmatch(name) and len(name) <= _MOST_QUOTED else quoted(name)


# kinds of error for which pydantic would name a Python type
_EXPECTED = {
    "missing": "missing; it is required",
    "model_type": "expected a table",
    "dict_type": "expected a table",
    "tuple_type": "expected a list of numbers",
}


def _reason(error: Mapping[str, Any], model: type[TomlModel]) -> str:
    kind, got = error["type"], error["input"]
    message: str = error["msg"]
    if kind == "extra_forbidden":
        return f"unknown key{_suggestion(error['loc'], model)}"
    if kind == "too_short":
        return f"expected at least {error['ctx']['min_length']} values, got {error['ctx']['actual_length']}"
    if kind == "too_long":
        most = error["ctx"]["max_length"]
        count = error["ctx"]["actual_length"]
        # the commas of decimals separate values, too
        is_divided = count == 2 * most and isinstance(got, tuple) and all(isinstance(part, int) for part in got)
        advice = _POINT_ADVICE if is_divided else ""
        return f"expected {'at most ' if most > 3 else ''}{most} values, got {count or 'more'}{advice}"
    if kind == "string_pattern_mismatch":
        return f"expected a name without > and /, which join names, got {quoted(got)}"
    if kind in ("model_type", "dict_type") and isinstance(got, tuple):
        return "expected a table, got a list; write [NAME], not [[NAME]]"
    if kind in _EXPECTED:
        return _EXPECTED[kind] if kind == "missing" else f"{_EXPECTED[kind]}, got {quoted(got)}"
    message = message.removeprefix("Value error, ").replace("Input should be", "expected")
    message = message.replace("String should have", "expected a text of").replace("a valid boolean", "true or false")
    if kind == "value_error" and isinstance(got, dict | tuple):  # a check of several keys, which names them
        return message
    shown = "a table" if isinstance(got, dict) else quoted(got)
    return f"{message}{_limit_unit(error, model)}, got {shown}{_other_unit(error, model)}"


# what people write for a key, where it is spelt too differently for a near miss
_VARIANTS = {
    "centre": "center",
    "middle": "center",
    "diameter": "radius",
    "humidity": "relative_humidity",
    "temp": "temperature_c",
    "angle": "heading_deg",
    "direction": "heading_deg",
    "xy": "position",
    "vertices": "points",
    "corners": "points",
}


def _suggestion(location: Sequence[int | str], model: type[TomlModel]) -> str:
    """Return the key that an unknown key probably means, with its unit, or all keys of its table."""
    word, fields = str(location[-1]), _fields_at(location[:-1], model)
    variant = _VARIANTS.get(word.casefold())
    near = variant if variant in fields else next(iter(near_misses(word, fields)), None)
    if near is None:
        return f"; known: {', '.join(fields)}"
    extra = fields[near].json_schema_extra
    unit = f" ({extra['unit']})" if isinstance(extra, dict) else ""
    return f"; did you mean {near!r}{unit}?"


def _limit_unit(error: Mapping[str, Any], model: type[TomlModel]) -> str:
    """Return the unit of a key whose number is beyond a limit, with a space before it."""
    field = _limited_field(error, model)
    extra = field.json_schema_extra if field else None
    return f" {extra['unit']}" if isinstance(extra, dict) else ""


def _limited_field(error: Mapping[str, Any], model: type[TomlModel]) -> FieldInfo | None:
    """Return the key whose number is beyond a limit; None for another error."""
    if not error["type"].startswith(("less_than", "greater_than")):
        return None
    *table, key = [part for part in error["loc"] if isinstance(part, str)]
    return _fields_at(table, model).get(key)


def _other_unit(error: Mapping[str, Any], model: type[TomlModel]) -> str:
    """Return the value to write if a number beyond a limit is within the limits in a unit such as mm."""
    field = _limited_field(error, model)
    own = _limit_unit(error, model).strip()
    factor, unit = _OTHER_UNITS.get(own, (0, ""))
    # a share or a ratio of amplitudes; 1.9 is another mistake
    if field is not None and not own and error["ctx"].get("le") == 1 and error["input"] >= _LEAST_PERCENT:
        factor, unit = 0.01, "%"
    # a larger number is no mistake of the unit, and may not fit into a float
    if field is None or not factor or not abs(error["input"]) < _MOST_IN_OTHER_UNIT:
        return ""
    limits = [{name: getattr(item, name, None) for name in _WITHIN} for item in field.metadata]
    value = float(f"{error['input'] * factor:.12g}")
    within = all(
        _WITHIN[name](value, limit)
        for item in [error["ctx"], *limits]
        for name, limit in item.items()
        if limit is not None
    )
    return f"; if this is in {unit}, write {value!r}" if within else ""


def _fields_at(location: Sequence[int | str], model: type[TomlModel]) -> dict[str, FieldInfo]:
    """Return the keys of the table at a location."""
    for part in location:
        field = model.model_fields.get(str(part))
        model = next(_models_in(field.annotation), model) if field else model
    return {field.alias or name: field for name, field in model.model_fields.items()}


def _models_in(annotation: object) -> Iterator[type[TomlModel]]:
    if isinstance(annotation, type) and issubclass(annotation, TomlModel):
        yield annotation
    for argument in get_args(annotation):
        yield from _models_in(argument)


# rooms and boards by name: a text that ends in `.toml` or contains a slash is a file, any other one is shipped


SUFFIX = ".toml"


def is_file(name: Path | str) -> bool:
    """Return whether `name` is the name of a file, not of something shipped."""
    return isinstance(name, Path) or name.endswith(SUFFIX) or "/" in name or os.sep in name


def file_name(name: Path | str) -> str:
    """Return the name of the file without its folder, also for something shipped."""
    return Path(name).name if is_file(name) else f"{name}{SUFFIX}"


@dataclass(frozen=True)
class Shipped:
    """The TOML files of one package."""

    package: str
    what: str  # one of them, for errors: "room"
    document: str  # its file, for errors: "room file"

    def names(self) -> list[str]:
        """Return the names of the shipped ones, in order."""
        entries = (entry.name for entry in files(self.package).iterdir())
        return sorted(name.removesuffix(SUFFIX) for name in entries if name.endswith(SUFFIX))

    def read(self, name: Path | str) -> tuple[str, str]:
        """Return the text of a file or of a shipped one, and its name for errors. Raises InputError."""
        if is_file(name):
            shipped_name = Path(name).name.removesuffix(SUFFIX)
            if not os.path.exists(name) and shipped_name in self.names():
                raise InputError(f"{name}: no such file; the shipped {self.what} is {shipped_name!r}")
            return read_text(Path(name), self.document), str(name)
        if name not in self.names():
            raise InputError(self._unknown(str(name)))
        shipped = files(self.package) / f"{name}{SUFFIX}"
        return shipped.read_text(encoding="utf-8"), shipped.name

    def _unknown(self, name: str) -> str:
        names = self.names()
        path = next((file for file in (name, f"{name}{SUFFIX}") if os.path.isfile(file)), None)
        if path:
            read_text(Path(path), self.document)  # raises an error for a log, which must not be suggested
        if path and Path(path).suffix not in ("", SUFFIX):
            return f"{path}: is not a {self.document}; expected a file NAME{SUFFIX}, or one of: {', '.join(names)}"
        hint = f"; did you mean the file ./{path}?" if path else did_you_mean(name, names)
        return f"unknown {self.what} {quoted(name)}{hint or ';'} known: {', '.join(names)}, or a file NAME{SUFFIX}"


SHIPPED_ROOMS = Shipped("sonarhw_rooms", "room", "room file")
SHIPPED_BOARDS = Shipped("sonarhw_sim.board.shipped", "board", "board profile")
