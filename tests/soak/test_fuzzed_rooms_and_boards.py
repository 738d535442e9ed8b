"""Files made from the schemas of rooms and boards, valid and hostile: each is accepted, or refused with one short line.

A normal run uses 30 files of each kind, with `--soak` 20 000.
"""

import json
import math
import tomllib
import tracemalloc
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from sonarhw_sim.board.profile import BoardFile, parse_board
from sonarhw_sim.check import plan_findings
from sonarhw_sim.files import TomlModel, json_schema
from sonarhw_sim.room.room import Room, parse_room
from sonarhw_sim.room.room_file import RoomFile

from sonarhw.errors import InputError
from tests.checkout import CHECKOUT
from tests.conftest import Count

Schema = dict[str, Any]
NAMES = st.sampled_from(["m"] * 8 + ["n", "a b", "$x$", "\x1b[31m", "é" * 40, "x" * 300, "", "a/b", "=1+1", "\u202e"])
HOSTILE = st.sampled_from(
    [
        math.nan, math.inf, -math.inf, 1e154, -1e308, 5e-324, 10**400, -(2**63), True, "", "\x1b]0;x\x07", "x" * 10**5,
        [], [[]], [[[[1]]]], {}, {"a": {"b": {}}}, [1] * 1000,
    ]
)  # fmt: skip
MEMORY = 200e6  # bytes


def values(schema: Schema, root: Schema) -> st.SearchStrategy[Any]:
    """Return a strategy of values that mostly fit a schema."""
    return st.sampled_from(range(30)).flatmap(lambda chance: HOSTILE if chance == 7 else fitting(schema, root))


def fitting(schema: Schema, root: Schema) -> st.SearchStrategy[Any]:
    """Return a strategy of values that fit a schema, except perhaps in parts."""
    if "$ref" in schema:
        return fitting(root["$defs"][schema["$ref"].rsplit("/", 1)[1]], root)
    if "anyOf" in schema:
        return st.one_of(*(fitting(one, root) for one in schema["anyOf"] if one.get("type") != "null"))
    if "enum" in schema:
        return st.sampled_from(schema["enum"])
    match schema["type"]:
        case "boolean":
            return st.booleans()
        case "string":
            return NAMES
        case "integer":
            return st.integers(schema.get("minimum", -100), min(schema.get("maximum", 100), 400))
        case "number":
            low, high = schema.get("minimum", schema.get("exclusiveMinimum", -1e9)), schema.get("maximum", 1e9)
            return st.floats(low, high) | st.floats(low, high).map(lambda number: round(math.remainder(number, 4), 2))
        case "array":
            least = schema.get("minItems", 0)
            return st.lists(values(schema["items"], root), min_size=least, max_size=min(schema.get("maxItems", 4), 4))
    if "properties" not in schema:
        return st.dictionaries(NAMES, values(schema["additionalProperties"], root), max_size=3)
    needed = {key: values(schema["properties"][key], root) for key in schema.get("required", ())}
    others = {key: values(value, root) for key, value in schema["properties"].items() if key not in needed}
    return st.fixed_dictionaries(needed, optional=others)


def as_toml(value: Any) -> str:
    """Return a value as TOML, tables inline."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {as_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(as_toml, value)) + "]"
    if isinstance(value, str):
        return json.dumps(value)
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value)


def judge_room(text: str, where: str) -> None:
    room: Room = parse_room(text, where)
    if len(room.walls) < 100:
        assert all(finding.line for finding in plan_findings(room))


@pytest.mark.parametrize(
    ("model", "parse", "shipped"),
    [
        (RoomFile, judge_room, "rooms/laboratory.toml"),
        (BoardFile, parse_board, "sim/sonarhw_sim/board/shipped/polaroid-6500.toml"),
    ],
    ids=["room", "board"],
)
def test_any_file_is_accepted_or_refused_with_one_line(
    model: type[TomlModel], parse: Callable[[str, str], object], shipped: str, count: Count
) -> None:
    schema, good = json_schema(model), tomllib.loads((CHECKOUT / shipped).read_text())
    how = settings(
        max_examples=count(10, 20_000),
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    accepted: list[bool] = []

    @how
    @given(fitting(schema, schema), st.sets(st.sampled_from(sorted(schema["properties"])), max_size=2) | st.just(None))
    def check(made: dict[str, Any], replaced: set[str] | None) -> None:
        # a whole file from the schema, or a good file with one or two other tables
        table = made if replaced is None else good | {key: made[key] for key in replaced & made.keys()}
        text = "\n".join(f"{key} = {as_toml(value)}" for key, value in table.items())
        refusal = refusal_of(parse, text)
        accepted.append(refusal is None)
        if refusal is not None:
            assert refusal.startswith("own.toml: ")
            assert not any(mark in refusal for mark in "\n\x1b")
            assert len(refusal) < 1000

    tracemalloc.start()
    check()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < MEMORY
    assert 0 < sum(accepted) < len(accepted)


def refusal_of(parse: Callable[[str, str], object], text: str) -> str | None:
    """Return the error of a file, or None."""
    try:
        parse(text, "own.toml")
    except InputError as error:
        return str(error)
    return None
