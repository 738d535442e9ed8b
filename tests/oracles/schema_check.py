"""An independent check of a value against a JSON Schema, for the keywords that the schemas of the product use."""

import re
from collections.abc import Callable
from typing import Any

Schema = dict[str, Any]
NOTES = {"title", "description", "default", "unit", "$defs", "$schema"}
TYPES: dict[str, Callable[[Any], bool]] = {
    "object": lambda value: isinstance(value, dict),
    "array": lambda value: isinstance(value, list),
    "string": lambda value: isinstance(value, str),
    "boolean": lambda value: isinstance(value, bool),
    "integer": lambda value: isinstance(value, int) and not isinstance(value, bool),
    "number": lambda value: isinstance(value, int | float) and not isinstance(value, bool),
    "null": lambda value: value is None,
}


def fits(value: Any, schema: Schema, root: Schema | None = None) -> bool:
    """Return whether a value fits a schema. Raises KeyError for a keyword that is not known here."""
    root = root or schema
    keys = sorted(schema.keys() - NOTES, key=lambda key: key != "type")  # the other rules need a value of that type
    return all(_RULES[key](value, schema[key], schema, root) for key in keys)


def _properties(value: Any, wanted: Schema, schema: Schema, root: Schema) -> bool:
    return all(fits(value[key], wanted[key], root) for key in value if key in wanted)


def _others(value: Any, wanted: Any, schema: Schema, root: Schema) -> bool:
    others = [value[key] for key in value if key not in schema.get("properties", {})]
    return not others if wanted is False else all(fits(other, wanted, root) for other in others)


_RULES: dict[str, Callable[[Any, Any, Schema, Schema], bool]] = {
    "$ref": lambda value, wanted, _, root: fits(value, root["$defs"][wanted.removeprefix("#/$defs/")], root),
    "anyOf": lambda value, wanted, _, root: any(fits(value, one, root) for one in wanted),
    "type": lambda value, wanted, *_: TYPES[wanted](value),
    "enum": lambda value, wanted, *_: value in wanted,
    "properties": _properties,
    "additionalProperties": _others,
    "propertyNames": lambda value, wanted, _, root: all(fits(key, {"type": "string", **wanted}, root) for key in value),
    "required": lambda value, wanted, *_: set(wanted) <= set(value),
    "items": lambda value, wanted, _, root: all(fits(item, wanted, root) for item in value),
    "minItems": lambda value, wanted, *_: len(value) >= wanted,
    "maxItems": lambda value, wanted, *_: len(value) <= wanted,
    "maxLength": lambda value, wanted, *_: len(value) <= wanted,
    "pattern": lambda value, wanted, *_: re.search(wanted, value) is not None,
    "minimum": lambda value, wanted, *_: value >= wanted,
    "maximum": lambda value, wanted, *_: value <= wanted,
    "exclusiveMinimum": lambda value, wanted, *_: value > wanted,
}
